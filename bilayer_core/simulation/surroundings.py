"""Actions on a robot from outside: stimuli, loads, and bodies on prescribed paths."""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.engine.actuation import Actuation, Paths
from bilayer_core.model.model import Model
from bilayer_core.model.override import acts, no_overrides, spans_of, value_at
from bilayer_core.model.state import POSE_GOAL, State
from bilayer_core.scene.body import Prescribed
from bilayer_core.scene.spans import Span, Spans
from bilayer_core.simulation.poses import BEGIN, DURATION, MOVE, POSITION, ROTATION, ROTATION_VECTOR, SPIN, VELOCITY

Array = np.ndarray
SPANS_AT_ONCE = 8
"""Of each schedule, that steps are given at least."""


class Surroundings:
    """Evaluates what acts on a model.

    Parameters
    ----------
    model : Model
    ahead : float
        Time by which `actuation` reaches beyond the present, both ways, at least [s].

    Attributes
    ----------
    actuation : Actuation
        The same for steps, as far as `cover` has made it.
    """

    def __init__(self, model: Model, ahead: float = 0.0):
        self.model, self._ahead = model, ahead
        scene = model.scene
        self._channels = [channel.schedule for channel in scene.stimuli.values()]
        self._loads = [load.factor for load in scene.loads]
        self._ranges = np.array([c.maximum - c.minimum for c in scene.stimuli.values()], dtype=float)
        self._begin, self._override = 0.0, no_overrides(len(self._channels) + len(self._loads))
        self._overriding = self._override.tobytes()
        self._pose_goal = np.zeros((len(model.bodies.controlled), POSE_GOAL))
        self._paths = paths_of(model, self._pose_goal)
        self.actuation: Actuation | None = None
        self.actuation = self._spans_about(0.0)

    def stimulus_at(self, state: State, time: float, ended: float = 0.0) -> Array:
        """Return the value of each channel at `time`, shape (n_channel,): that set from outside, or the schedule's;
        `ended` as for `load_factor`.
        """
        scheduled = [channel.value_before(time, ended) if ended else channel.value(time) for channel in self._channels]
        return _overridden(scheduled, state.override[: len(scheduled)], time)

    def load_factor(self, state: State, ended: float = 0.0) -> Array:
        """Return the factor of each load in a state, shape (n_load,): at the end of a step of length `ended` [s] that
        from before a jump there.
        """
        time = float(state.time[0])
        scheduled = [load.value_before(time, ended) if ended else load.value(time) for load in self._loads]
        return _overridden(scheduled, state.override[len(self._channels) :], time)

    def present(self, state: State, index: int) -> float:
        """Return the value of a channel or the factor of a load in a state; loads are numbered after channels."""
        row, time = state.override[index].tolist(), float(state.time[0])
        return value_at(row, time) if acts(row) else [*self._channels, *self._loads][index].value(time)

    def cover(self, time: float, override: Array, pose_goal: Array) -> None:
        """Let `actuation` hold what acts from `time` [s] on, and a little before, where something may jump.

        Parameters
        ----------
        time : float
        override : Array
            What is set from outside of channels and loads, NaN where schedules act (`State.override`).
        pose_goal : Array
            How controlled bodies go to where they are asked to be (`State.pose_goal`).
        """
        moved = pose_goal.size > 0 and not np.array_equal(pose_goal, self._pose_goal)
        if moved:
            self._pose_goal = pose_goal.copy()
            self._paths = paths_of(self.model, pose_goal)
        known = self._begin <= time and time + self._ahead < self.actuation.horizon[0]
        overriding = override.tobytes()  # several times as fast to compare as arrays
        if moved or not known or overriding != self._overriding:
            self._begin, self._override, self._overriding = time, override.copy(), overriding
            self.actuation = self._spans_about(time, afresh=moved)

    def _spans_about(self, time: float, afresh: bool = False) -> Actuation:
        schedules = zip([*self._channels, *self._loads], self._override.tolist(), strict=True)
        rows = [_next_spans(*of, time - self._ahead, time + self._ahead) for of in schedules]
        size = max([SPANS_AT_ONCE, *map(len, rows)])  # so that it seldom changes
        present = self.actuation
        if afresh or present is None or present.stimulus.shape[1] != size:
            stimulus, load = (np.zeros((len(of), size, len(Span._fields))) for of in (self._channels, self._loads))
            present = Actuation(
                stimulus=stimulus, load=load, ranges=self._ranges, horizon=np.zeros(1), paths=self._paths
            )
        present.horizon[0] = min([row[-1].until for row in rows], default=math.inf)
        for place, row in zip([*present.stimulus, *present.load], rows, strict=True):
            place[: len(row)], place[len(row) :] = row, row[-1]
        return present


def _overridden(scheduled: list[float], override: Array, time: float) -> Array:
    """Return the values of schedules at a time [s], or those set from outside where there are any."""
    given = [value_at(row, time) for row in override.tolist()]
    return np.array([value if math.isnan(by) else by for value, by in zip(scheduled, given, strict=True)], dtype=float)


def _next_spans(schedule: Spans, override: list[float], begin: float, end: float) -> list[Span]:
    """Return the spans of a setting from outside, or those of a schedule over an interval.

    They reach from the span that ends at `begin` or later to one that does not end before `end`.
    """
    if acts(override):
        return spans_of(override)
    spans = [schedule.span(begin)]
    while math.isfinite(spans[-1].until) and (len(spans) < SPANS_AT_ONCE or spans[-1].until <= end):
        spans.append(schedule.span(spans[-1].until))
    return spans


def paths_of(model: Model, pose_goal: Array) -> Paths:
    """Return the keyframes of prescribed bodies that move; absent if none moves.

    A controlled body with a goal has the keyframes of its goal.
    """
    bodies, scene = model.bodies, model.scene.bodies
    moving = [b for b, body in enumerate(scene) if isinstance(body.motion, Prescribed) and body.motion.moves]
    if not moving:
        return Paths.absent()
    goals = {b: goal for b, goal in zip(bodies.controlled.tolist(), pose_goal, strict=True) if goal[DURATION] > 0.0}
    position, rotation = bodies.start_position.copy(), bodies.start_rotation.copy()
    columns: list[tuple[Array, ...]] = []
    for b in moving:
        if b in goals:
            goal = goals[b]
            position[b], rotation[b] = goal[POSITION], goal[ROTATION].reshape(3, 3)
            ends = goal[BEGIN] + np.array([0.0, goal[DURATION]])
            steps = (MOVE, ROTATION_VECTOR, VELOCITY, SPIN)
            reached, turned, velocity, spin = (np.array([np.zeros(3), goal[part]]) for part in steps)
            columns.append((ends, reached, turned, velocity[::-1], spin[::-1]))
            continue
        motion = scene[b].motion
        times = np.array(motion.times or [0.0], dtype=float)
        rest = np.zeros((len(times), 3))
        keyframes = (np.array(of if of else rest, dtype=float) for of in (motion.displacements, motion.rotations))
        columns.append((times, *keyframes, rest, rest))
    time, displacement, rotation_vector, velocity, rotation_rate = map(np.concatenate, zip(*columns, strict=True))
    return Paths(
        body=np.array(moving, dtype=np.int64),
        first=np.cumsum([0, *(len(column[0]) for column in columns)]),
        time=time,
        displacement=displacement,
        rotation_vector=rotation_vector,
        velocity=velocity,
        rotation_rate=rotation_rate,
        position=position,
        rotation=rotation,
    )
