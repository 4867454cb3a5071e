"""A run in rerun while it goes on, by what sends whole runs there (`rrd_writer`)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from bilayer_core.log.run.run_data import RunData
from bilayer_core.log.run.unfinished_run import ArrivingRun
from bilayer_core.observed.frame import Description
from bilayer_core.view.arrows import metres_per, scaled_reactions
from bilayer_core.view.colouring import STRAIN
from bilayer_core.view.live_scales import LiveScales
from bilayer_core.view.recording_layout import GRAVITY, Curves, Plot, arranged, entity_name, explanation, robot_view
from bilayer_core.view.rrd_writer import RunSender
from bilayer_core.view.scales import place_moving_eye
from bilayer_core.view.server import ViewServer, suffixed

APPLICATION = "bilayer_sim"
SHOWN = 10.0
"""Longest time that plots show [s]; who looks can zoom out."""
STILL_ROOM, MOVING_ROOM = 1.6, 1.3
"""Times as far as the first frame asks for: what will come is not known."""


class LiveView:
    """Shows messages as they come, each run as a recording of its own.

    Where a limit of colours, or the size of arrows, turns out to be too small, it changes; legend and text change at
    the same time of the run, so that each moment is shown by what is said of it. `colour`: what the colours of rods
    say. `save`: file that is written as well; those of later runs are numbered.
    """

    def __init__(self, server: ViewServer, colour: str = STRAIN, save: Path | None = None):
        self._server, self._colour, self._save = server, colour, save
        self._number = -1
        self._recording: rr.RecordingStream | None = None
        self._arriving: ArrivingRun | None = None
        self._sender: RunSender | None = None
        self._scales: LiveScales | None = None
        self._arranged = ""

    def begin(self, description: Description) -> None:
        """Begin a run: from now on messages are those of another one."""
        self.close()
        self._number += 1
        self._arriving = ArrivingRun(description)
        self._scales = None

    def add(self, topic: str, stamp: int, data: bytes) -> None:
        """Take a message: full name of its topic in a log, time [ns]."""
        self._arriving.add(topic, stamp, data)

    def show(self) -> None:
        """Send what has become whole. OutputError if there is no server any more."""
        self._server.check()
        run = self._arriving.take() if self._arriving else None
        if run is None:
            return
        if self._sender is None:
            if not len(run.shape_times) or not len(run.times):
                return  # the first frame to be shown is a whole one
            self._start(run)
        elif self._scales.update(run):
            self._explain(float(min((*run.times[:1], *run.shape_times[:1]))))
        of = self._scales
        self._sender.send(run, of.scales, of.colouring, scaled_reactions(run, of.scales, of.reactions))

    def close(self) -> None:
        """Send and write all that is left."""
        if self._recording is not None:
            self._recording.flush()
            self._recording.disconnect()
            self._recording = self._sender = None
            # Which is how rerun gives back the threads and the memory of recordings that nobody holds.
            rr.init(APPLICATION, recording_id="none", send_properties=False)

    def _start(self, run: RunData) -> None:
        self._scales = LiveScales(run, self._colour)
        sinks: list = [rr.GrpcSink(self._server.url)]
        if self._save is not None:
            sinks.append(rr.FileSink(suffixed(self._save, self._number)))
        self._recording = rr.RecordingStream(APPLICATION)
        # The viewer keeps one layout for all runs, and rerun never gives back the memory of one: it goes there once.
        needed = self._save is not None or self._arranged != run.description.scene_text
        self._recording.set_sinks(*sinks, default_blueprint=_layout(run, self._scales) if needed else None)
        self._arranged = run.description.scene_text
        self._sender = RunSender(self._recording, run.description)
        self._sender.begin(self._scales.scales)
        self._explain(float(run.times[0]))

    def _explain(self, time: float) -> None:
        of = self._scales
        sizes = {name: metres_per(reference, of.scales.size) for name, reference in of.reactions.items()}
        text = explanation(self._arriving.description, of.scales, of.colouring, of.contact, sizes)
        self._sender.explain(text, of.colouring, time)


def _layout(run: RunData, scales: LiveScales) -> rrb.Blueprint:
    """Return the window of a run of which only the beginning is known; all possible curves have a place in it."""
    description = run.description
    if scales.moves:
        eye, target = place_moving_eye(run)
    else:
        eye, target = scales.scales.eye, scales.scales.target
    eye = target + (MOVING_ROOM if scales.moves else STILL_ROOM) * (eye - target)
    bodies = len(description.bodies)
    plots = [Plot("stimulus", "Stimulus", len(description.channels))] if description.channels else []
    if description.obstacles or any(body.shape for body in description.bodies):
        plots.append(Plot("contact_force", "Contact force [N]", bodies + 1))
    if any(body.holds_rods for body in description.bodies):
        plots.append(Plot("clamp_force", "Force on clamps [N]", bodies))
    plots.append(Plot("height", "Height of mass centres [mm]", bodies + 1))
    groups = {name: GRAVITY if name == GRAVITY else "energy" for name in run.energy}
    for group, count in sorted(Counter(groups.values()).items()):
        plots.append(Plot(group, f"{group.capitalize()} [mJ]", count))
    plots.append(Plot("solver", "Solver", 2))
    alone = [Plot(f"{group}/{entity_name(name)}", f"{name} [mJ]") for name, group in groups.items()]
    robot = robot_view(eye, target, scales.moves)
    title = scales.colouring.title if scales.colouring.quantity == STRAIN else scales.colouring.quantity  # units change
    return arranged(robot, title, Curves.until_now(SHOWN), plots, alone, events=True, play="following")
