"""From one corner or jump of stimuli, loads and prescribed paths to the next: adaptive steps end there."""

from __future__ import annotations

import math

import numpy as np

from ..engine.actuation import PARTS, Acting, Paths
from ..model.model import Model, keyframes_about
from ..scene.body import Prescribed
from ..scene.piece import Piece

Array = np.ndarray


class Stretch:
    """The pieces of all schedules that a time lies in.

    Attributes
    ----------
    until : float
        Where the first of them ends [s], infinity if none does.
    acting : Acting
        The same for compiled loops, in arrays that stay.
    """

    def __init__(self, model: Model):
        scene, bodies = model.scene, model.bodies
        self._bodies = bodies
        self._schedules = [channel.schedule for channel in scene.stimuli.values()]
        self._schedules += [load.factor for load in scene.loads]
        paths = {
            index: body.motion
            for index, body in enumerate(scene.bodies)
            if isinstance(body.motion, Prescribed) and body.motion.moves
        }
        self._motions = list(paths.values())
        self._pieces: list[Piece] = []
        self._begin = self.until = math.inf
        self._override = np.zeros(len(scene.stimuli))
        self.acting = Acting(
            stimulus=np.zeros((len(scene.stimuli), len(PARTS))),
            load=np.zeros((len(scene.loads), len(PARTS))),
            paths=self._room_for(np.array(list(paths), dtype=np.int64)) if paths else Paths.absent(),
        )

    def _room_for(self, moving: Array) -> Paths:
        vectors = {name: np.zeros((len(moving), 3)) for name in ("displacement", "way", "turn", "turn_way")}
        return Paths(
            body=moving,
            begin=np.zeros(len(moving)),
            duration=np.ones(len(moving)),
            position=self._bodies.start_position,
            rotation=self._bodies.start_rotation,
            **vectors,
        )

    def cover(self, time: float, override: Array) -> None:
        """Make it that which `time` [s] lies in.

        Parameters
        ----------
        time : float
        override : ndarray
            Values of channels set from outside, NaN where the schedule acts (`State.override`).
        """
        if self._begin <= time < self.until and np.array_equal(override, self._override, equal_nan=True):
            return
        self._begin, self._override = time, override.copy()
        fixed = [*override.tolist(), *[math.nan] * len(self.acting.load)]
        self._pieces = [
            schedule.piece(time) if math.isnan(value) else Piece(math.inf, value)
            for schedule, value in zip(self._schedules, fixed, strict=True)
        ]
        rows = np.array([[getattr(piece, part) for part in PARTS] for piece in self._pieces]).reshape(-1, len(PARTS))
        count = len(override)
        self.acting.stimulus[:], self.acting.load[:] = rows[:count], rows[count:]
        if self.acting.paths.exists:
            self._cover_paths(self.acting.paths, time)
        ends = [piece.until for piece in self._pieces] + [motion.breakpoint_after(time) for motion in self._motions]
        self.until = min(ends, default=math.inf)

    def _cover_paths(self, paths: Paths, time: float) -> None:
        for k, b in enumerate(paths.body):
            times = self._bodies.times[b]
            moved = keyframes_about(times, self._bodies.displacements[b], time)
            turned = keyframes_about(times, self._bodies.rotations[b], time)
            paths.displacement[k], paths.way[k], paths.turn[k], paths.turn_way[k] = *moved[2:], *turned[2:]
            paths.begin[k], paths.duration[k] = moved[:2] if moved[3].any() else turned[:2]

    def jumps_at(self, time: float) -> tuple[bool, bool]:
        """Whether a stimulus, and whether a load, jumps where it ends; `time` [s] is just after that."""
        jumps = [
            piece.until <= time and piece.jump_to(schedule.piece(time))
            for piece, schedule in zip(self._pieces, self._schedules, strict=True)
        ]
        count = len(self._override)
        return any(jumps[:count]), any(jumps[count:])
