"""Many runs from one instant in one recording: their rods as lines, coloured by what differs, and their curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from bilayer_core.log.run.run_data import RunData
from bilayer_core.view.drawable import refuse_undrawable
from bilayer_core.view.recording_layout import TIMELINE, Curves, Plot, robot_view, whole
from bilayer_core.view.rrd_writer import log_bodies, log_obstacles, plain_text, send_bodies
from bilayer_core.view.scales import Scales, choose_scales

FIRST, LAST = np.array([70, 150, 255]), np.array([255, 120, 50])
"""Colours of the smallest and the largest value."""
LINE_WIDTH = 1.5
"""[points]"""
MOST_IN_LEGEND = 10
"""Curves whose values are told beside them."""
CURVES = {"height": "Height of the mass centre [mm]", "along": "Way of the mass centre along x [mm]"}


class Branch(Protocol):
    """One of the runs; `runs.branches.Branch`."""

    @property
    def value(self) -> float: ...

    @property
    def run(self) -> RunData: ...

    @property
    def stopped(self) -> str: ...


def write_branches(branches: Sequence[Branch], name: str, rrd_path: str | Path) -> None:
    """Write runs to one ``.rrd`` file.

    `branches`: at least one. `name`: what differs. Raises InputError if one holds no frame. Raises OSError if the file
    cannot be written.
    """
    widest = max((of.run for of in branches), key=lambda run: float(np.ptp(run.positions, axis=(0, 1)).max()))
    scales, values = choose_scales(widest), np.array([of.value for of in branches])
    recording = rr.RecordingStream("bilayer_sim")
    memory = recording.memory_recording()
    recording.send_recording_name(f"{widest.description.scene_name}: {len(branches)} branches by {name}")
    times = min(of.run.times[0] for of in branches), max(of.run.times[-1] for of in branches)
    recording.send_blueprint(
        _blueprint(name, scales, Curves.between(*map(float, times)), len(branches) <= MOST_IN_LEGEND)
    )
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("summary", plain_text(summary(branches, name)), static=True)
    log_obstacles(recording, widest.description, scales)
    digits = len(str(len(branches) - 1))
    extent = float(np.ptp(values)) or 1.0
    for number, of in enumerate(branches):
        refuse_undrawable(of.run, f"{name} = {of.value:g}")
        share = (of.value - float(values.min())) / extent
        colour = np.rint(FIRST + share * (LAST - FIRST)).astype(np.uint8)
        under = f"world/branches/{number:0{digits}}"
        _send_rods(recording, under, of.run, colour)
        log_bodies(recording, of.run.description, scales, f"{under}/bodies")
        send_bodies(recording, of.run, f"{under}/bodies")
        _send_curves(recording, f"{number:0{digits}}", f"{of.value:.4g}", of.run, colour)
    Path(rrd_path).write_bytes(memory.drain_as_bytes())
    recording.disconnect()


def summary(branches: Sequence[Branch], name: str) -> str:
    """Return what is shown, as plain text."""
    run, values = branches[0].run, [of.value for of in branches]
    begin = float(run.times[0])
    lines = [
        f"{run.description.scene_name}: {len(branches)} branches from t = {begin:.6g} s",
        f"Colour: {name} from {min(values):g} (blue) to {max(values):g} (orange).",
    ]
    lines += [f"{name} = {of.value:g} stopped: {of.stopped}." for of in branches if of.stopped]
    return "\n".join(lines)


def _send_rods(recording: rr.RecordingStream, under: str, run: RunData, colour: np.ndarray) -> None:
    """Send all strands of a run as lines."""
    recording.log(
        f"{under}/rods", rr.LineStrips3D.from_fields(colors=colour, radii=rr.Radius.ui_points(LINE_WIDTH)), static=True
    )
    strands = [strand.nodes for strand in run.description.strands]
    strips = [positions[nodes] for positions in run.positions for nodes in strands]
    recording.send_columns(
        f"{under}/rods",
        [rr.TimeColumn(TIMELINE, duration=run.shape_times)],
        rr.LineStrips3D.columns(strips=strips).partition([len(strands)] * len(run.shape_times)),
    )


def _send_curves(recording: rr.RecordingStream, number: str, label: str, run: RunData, colour: np.ndarray) -> None:
    for curve, axis in (("height", 2), ("along", 0)):
        path = f"plots/{curve}/{number}"
        recording.log(path, rr.SeriesLines(colors=colour, names=label, widths=1.0), static=True)
        recording.send_columns(
            path,
            [rr.TimeColumn(TIMELINE, duration=run.times)],
            rr.Scalars.columns(scalars=1e3 * run.com[:, axis]),
        )


def _blueprint(name: str, scales: Scales, curves: Curves, legend: bool) -> rrb.Blueprint:
    robot = robot_view(scales.eye, scales.target, follows=False, name="Branches")
    plots = [curves.view(Plot(curve, f"{title} by {name}"), legend) for curve, title in CURVES.items()]
    text = rrb.TextDocumentView(name="Run", origin="summary")
    left = rrb.Vertical(robot, text, row_shares=[9, 2])
    return whole(rrb.Horizontal(left, rrb.Vertical(*plots), column_shares=[5, 3]), time_panel="collapsed")
