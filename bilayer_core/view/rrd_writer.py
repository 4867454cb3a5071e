"""A run as a rerun recording: entities, time columns, and the layout stored in the file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import rerun as rr

from bilayer_core.log.messages.events import LEVEL_NAMES
from bilayer_core.log.messages.node_frames import layer_rows
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Description, ShapeInfo, Strand
from bilayer_core.view import geometry
from bilayer_core.view.arrows import Arrows, contact_arrows, reaction_arrows
from bilayer_core.view.colouring import STRAIN, Colouring, choose_colouring
from bilayer_core.view.drawable import has_sections, refuse_undrawable
from bilayer_core.view.recording_layout import (
    CHANNEL_COLOURS,
    EVENTS,
    GRAVITY,
    MIDDLE,
    TIMELINE,
    blueprint,
    energy_groups,
    entity_name,
    summary,
)
from bilayer_core.view.scales import Scales, choose_scales, middles_of
from bilayer_core.view.theme import (
    ARROW_COLOUR,
    BACKGROUND,
    BALL_COLOURS,
    JOINT_COLOURS,
    OBSTACLE_COLOURS,
    REACTION_COLOURS,
    SIDE_SHADE,
)

GROUND_COLOURS = ((74, 79, 88), (62, 66, 74), BACKGROUND)
CHUNK = 150  # frames in a chunk: chunks are what the viewer loads, caches and drops
LEGEND_HEIGHT = 14  # pixels of the colour bar
EVENT_COLOURS = {"flight": (255, 214, 90), "contact": (64, 224, 148), "stimulus": (255, 130, 110)}
PLAIN_COLOUR = (200, 204, 210)
BODIES = "world/bodies"
SUMMED = "sum over nodes"
"""Curve of the sizes of all contact forces."""


def write_recording(run: RunData, rrd_path: str | Path, colour: str = STRAIN) -> None:
    """Write `run` to an ``.rrd`` file; InputError if it holds no frame, OSError if the file cannot be written.

    `colour`: what the colours of rods say, from `colouring.QUANTITIES`.
    """
    recording = rr.RecordingStream("bilayer_sim")
    memory = recording.memory_recording()  # rerun's own writer ends well where it has lost the end of a file
    send_run(recording, run, colour)
    Path(rrd_path).write_bytes(memory.drain_as_bytes())
    recording.disconnect()


def send_run(recording: rr.RecordingStream, run: RunData, colour: str = STRAIN) -> None:
    """Send a whole run and its layout to a recording; InputError if it holds no frame."""
    refuse_undrawable(run, run.description.scene_name)
    scales, colouring = choose_scales(run), choose_colouring(run, colour)
    recording.send_blueprint(blueprint(run, scales, colouring))  # active: rerun's page ignores one that is not
    sender = RunSender(recording, run.description)
    sender.begin(scales)
    sender.explain(summary(run, scales, colouring), colouring)
    sender.send(run, scales, colouring, reaction_arrows(run, scales))


class RunSender:
    """Sends a run to a recording, as a whole or piece by piece: what never changes goes there once.

    `description`: of the run.
    """

    def __init__(self, recording: rr.RecordingStream, description: Description):
        self._recording = recording
        self._description = description
        self._rows = layer_rows(description)
        self._declared: set[str] = set()
        self._curves: dict[str, list[str]] = {}

    def begin(self, scales: Scales) -> None:
        """Send what stands still, and what moving things are made of."""
        recording, description = self._recording, self._description
        recording.send_recording_name(f"{description.scene_name}: {description.title}")
        recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        log_obstacles(recording, description, scales)
        log_bodies(recording, description, scales, BODIES)
        for layer in filter(has_sections, description.layers):
            triangles = geometry.ribbon_triangles(layer.nodes.stop - layer.nodes.start)
            recording.log(_strand(layer), rr.Mesh3D.from_fields(triangle_indices=triangles), static=True)
        for joint in description.joints:
            recording.log(f"world/{joint.name}", _mesh(geometry.shape_mesh(joint.shape, JOINT_COLOURS)), static=True)
        # The viewer follows what it draws, and draws points of no size.
        recording.log(MIDDLE, rr.Points3D.from_fields(radii=0.0), static=True)

    def explain(self, text: str, colouring: Colouring, time: float | None = None) -> None:
        """Say in plain text what is shown and draw the colour bar: for the whole run, or from a time on [s]."""
        bar = np.tile(_bytes(colouring.colour_map[:, :3]), (LEGEND_HEIGHT, 1, 1))
        steps = bar.shape[1]
        ticks = [[min(max(6.0, place * steps), steps - 6.0), LEGEND_HEIGHT + 8] for place, _ in colouring.ticks]
        texts = [text for _, text in colouring.ticks]
        shown = {
            "summary": plain_text(text),
            "legend": rr.Image(bar),
            "legend/ticks": rr.Points2D(ticks, labels=texts, radii=0.01, colors=(200, 200, 200), show_labels=True),
        }
        if time is not None:
            self._recording.set_log_time_enabled(False)  # the only time is that of the run
            self._recording.set_time(TIMELINE, duration=time)
        for path, archetype in shown.items():
            self._recording.log(path, archetype, static=time is None)

    def send(self, run: RunData, scales: Scales, colouring: Colouring, reactions: Mapping[str, Arrows]) -> None:
        """Send all that changes with time; `reactions` by name."""
        recording = self._recording
        self._send_strands(run, colouring)
        send_bodies(recording, run, BODIES)
        middles = middles_of(run)
        send_columns(recording, MIDDLE, run.shape_times, lambda part: rr.Points3D.columns(positions=middles[part]))
        self._send_joints(run)
        self._send_arrows("world/contact_forces", ARROW_COLOUR, contact_arrows(run, scales), scales)
        for name, arrows in reactions.items():
            self._send_arrows(f"world/{name}", REACTION_COLOURS[name], arrows, scales)
        if len(run.times):  # shapes may have come alone
            self._send_series(run)
        self._send_total_force(run)
        self._send_events(run)

    def _send_strands(self, run: RunData, colouring: Colouring) -> None:
        """Send layers as ribbons, or where their cross-sections are not known, their nodes as points."""
        for layer, rows in zip(run.description.layers, self._rows, strict=True):
            self._send_layer(run, layer, run.material_frames[:, rows], colouring)

    def _send_layer(self, run: RunData, layer: Strand, frames: np.ndarray, colouring: Colouring) -> None:
        positions, values = run.positions[:, layer.nodes], colouring.values(run, layer)
        shade = np.where(np.arange(geometry.CORNERS) < geometry.WIDE_CORNERS, 1.0, SIDE_SHADE)[:, None]
        nodes = positions.shape[1]

        def points(part: slice) -> rr.ComponentColumnList:
            colours = _bytes(colouring.colours(values[part])[..., :3])
            columns = rr.Points3D.columns(positions=positions[part].reshape(-1, 3), colors=colours.reshape(-1, 3))
            return columns.partition([nodes] * len(colours))

        def ribbon(part: slice) -> rr.ComponentColumnList:
            vertices = geometry.ribbon_vertices(layer, positions[part], frames[part]).reshape(-1, 3)
            colours = _bytes(colouring.colours(values[part])[:, :, None, :3] * shade)
            columns = rr.Mesh3D.columns(vertex_positions=vertices, vertex_colors=colours.reshape(-1, 3))
            return columns.partition([nodes * geometry.CORNERS] * len(colours))

        send_columns(self._recording, _strand(layer), run.shape_times, ribbon if has_sections(layer) else points)

    def _send_joints(self, run: RunData) -> None:
        """Send joints and guides, each on the body that carries it."""
        for joint in run.description.joints:
            if joint.body >= 0:
                _send_poses(self._recording, f"world/{joint.name}", run, joint.body)

    def _send_arrows(self, path: str, colour: tuple, arrows: Arrows, scales: Scales) -> None:
        if path not in self._declared:
            self._declared.add(path)
            looks = rr.Arrows3D.from_fields(colors=colour, radii=0.005 * scales.size)
            self._recording.log(path, looks, static=True)
        shown = np.linalg.norm(arrows.forces, axis=2) > arrows.shown

        def columns(part: slice) -> rr.ComponentColumnList:
            which = shown[part]
            vectors = arrows.forces[part][which] * arrows.metres_per_unit
            found = rr.Arrows3D.columns(origins=arrows.origins[part][which], vectors=vectors)
            return found.partition(which.sum(axis=1))

        send_columns(self._recording, path, arrows.times, columns)

    def _send_series(self, run: RunData) -> None:
        """Send curves: stimulus, forces of contact and of rods on each body, heights, energies, the solver's health."""
        groups: dict[str, dict[str, np.ndarray]] = {
            "stimulus": {name: run.stimulus[:, i] for i, name in enumerate(run.description.channels)},
            "contact_force": self._sizes("contact_force", run, run.contact_wrenches),
            "clamp_force": self._sizes("clamp_force", run, run.clamp_wrenches),
            "height": {
                "robot": 1e3 * run.com[:, 2],
                **{
                    body.name: 1e3 * run.body_positions[:, i, 2]
                    for i, body in enumerate(run.description.bodies)
                    if not body.prescribed
                },
            },
            **energy_groups(run, set(self._curves.get("energy", ())) | set(self._curves.get(GRAVITY, ()))),
            "solver": _health(run.solver),
        }
        for group, series in groups.items():
            for name, values in series.items():
                self._send_curve(group, name, run.times, values)

    def _send_total_force(self, run: RunData) -> None:
        if run.contact_forces.any() or SUMMED in self._curves.get("contact_force", ()):
            # Forces that hold a body cancel in their sum; this shows how hard it is held.
            total = np.linalg.norm(run.contact_forces, axis=2).sum(axis=1)
            self._send_curve("contact_force", SUMMED, run.shape_times, total)

    def _sizes(self, group: str, run: RunData, wrenches: np.ndarray) -> dict[str, np.ndarray]:
        """Return how large the forces on each body are that any acts on, or has acted on [N]."""
        sizes = {
            f"on {body.name}": np.linalg.norm(wrenches[:, i, :3], axis=1)
            for i, body in enumerate(run.description.bodies)
        }
        known = self._curves.get(group, ())
        return {name: size for name, size in sizes.items() if name in known or size.any()}

    def _send_events(self, run: RunData) -> None:
        """Send the events of a run as text."""
        if not run.events:
            return
        columns = rr.TextLog.columns(
            text=[event.text for event in run.events],
            level=[LEVEL_NAMES.get(event.level, "INFO") for event in run.events],
            color=[EVENT_COLOURS.get(event.name, PLAIN_COLOUR) for event in run.events],
        )
        times = rr.TimeColumn(TIMELINE, duration=[event.time for event in run.events])
        self._recording.send_columns(EVENTS, [times], columns)

    def _send_curve(self, group: str, name: str, times: np.ndarray, values: np.ndarray) -> None:
        path, known = f"plots/{group}/{entity_name(name)}", self._curves.setdefault(group, [])
        if name not in known:
            colour = CHANNEL_COLOURS[len(known) % len(CHANNEL_COLOURS)]
            self._recording.log(path, rr.SeriesLines(names=name, colors=colour, widths=2), static=True)
            known.append(name)
        send_columns(self._recording, path, times, lambda part: rr.Scalars.columns(scalars=values[part]))


def _strand(layer: Strand) -> str:
    """Return the entity of a layer of a rod."""
    return f"world/strands/{layer.name}"


def send_columns(
    recording: rr.RecordingStream, path: str, times: np.ndarray, columns: Callable[[slice], rr.ComponentColumnList]
) -> None:
    """Send what `columns` makes of each part of the times [s]; nothing if there is none, since a viewer ends where it
    meets no rows.
    """
    for first in range(0, len(times), CHUNK):
        part = slice(first, first + CHUNK)
        recording.send_columns(path, [rr.TimeColumn(TIMELINE, duration=times[part])], columns(part))


def _health(solver: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the curves of the solver's figures, as far as the log has them."""
    curves = {}
    if "iterations" in solver and "substeps" in solver:
        curves["iterations per step"] = solver["iterations"] / np.maximum(solver["substeps"], 1)
    if "min_gap" in solver and np.isfinite(solver["min_gap"]).all():  # infinite where nothing can touch
        curves["smallest gap [mm]"] = 1e3 * solver["min_gap"]
    return curves


def _bytes(colours: np.ndarray) -> np.ndarray:
    """Return the colours from 0 to 1 as uint8."""
    return np.rint(colours * 255).astype(np.uint8)


def plain_text(text: str) -> rr.TextDocument:
    """Return text that viewers show as it is: as Markdown, a title from a stranger could make them fetch an address."""
    return rr.TextDocument(text, media_type=rr.MediaType.TEXT)


def log_obstacles(recording: rr.RecordingStream, description: Description, scales: Scales) -> None:
    """Write the fixed surfaces."""
    for obstacle in description.obstacles:
        shape = obstacle.shape
        mesh = _plane(shape, scales) if shape.kind == "plane" else _mesh(geometry.shape_mesh(shape, OBSTACLE_COLOURS))
        recording.log(f"world/obstacles/{obstacle.name}", mesh, static=True)


def _plane(shape: ShapeInfo, scales: Scales) -> rr.Mesh3D:
    vertices, colours, triangles = geometry.plane_mesh(
        shape, scales.target, scales.size + 2 * scales.extent, scales.cell, GROUND_COLOURS
    )
    return rr.Mesh3D(vertex_positions=vertices, vertex_colors=colours, triangle_indices=triangles)


def _mesh(parts: geometry.Mesh) -> rr.Mesh3D:
    vertices, normals, colours, triangles = parts
    return rr.Mesh3D(
        vertex_positions=vertices, vertex_normals=normals, vertex_colors=colours, triangle_indices=triangles
    )


def log_bodies(recording: rr.RecordingStream, description: Description, scales: Scales, under: str) -> None:
    """Log the surfaces of bodies; one without any has a pose alone."""
    for body in description.bodies:
        if body.shape is not None:
            plane = body.shape.kind == "plane"
            shape = _plane(body.shape, scales) if plane else _mesh(geometry.shape_mesh(body.shape, BALL_COLOURS))
            recording.log(f"{under}/{body.name}", shape, static=True)


def send_bodies(recording: rr.RecordingStream, run: RunData, under: str) -> None:
    """Send the poses of bodies."""
    for index, body in enumerate(run.description.bodies):
        _send_poses(recording, f"{under}/{body.name}", run, index)


def _send_poses(recording: rr.RecordingStream, path: str, run: RunData, body: int) -> None:
    """Send the poses of a body for what is drawn on it."""
    positions, quaternions = run.body_positions[:, body], run.body_quaternions[:, body]

    def columns(part: slice) -> rr.ComponentColumnList:
        return rr.Transform3D.columns(translation=positions[part], quaternion=quaternions[part])

    send_columns(recording, path, run.times, columns)
