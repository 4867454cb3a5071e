"""What acts on a robot from outside: stimuli, what its layers make of them, loads, and bodies on prescribed paths."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..integrators.method import Method
from ..model.model import Model, scheduled_motion
from ..model.records.step import Course
from ..model.rest_strains import RestStrains
from ..model.state import State
from ..scene.piece import Pieces
from ..scene.transduction import follow, free_strain

Array = np.ndarray


@dataclass(frozen=True)
class Prescribed:
    """Motion of prescribed bodies at the time of a stage.

    Attributes
    ----------
    index : Array
        Which bodies.
    position, rotation : Array
        Of all bodies [m], shapes (n_body, 3), (n_body, 3, 3).
    rates : Array
        Velocity [m/s] and angular velocity [rad/s] of all bodies, shape (n_body, 6).
    """

    index: Array
    position: Array
    rotation: Array
    rates: Array


@dataclass(frozen=True)
class Drive:
    """Values of stimuli, what the laws made of them, rest strains and factors of loads at one time."""

    stimulus: Array
    transduction: Array
    rest: RestStrains
    load_factor: Array


def _value(schedule: Pieces, time: float, ended: float) -> float:
    return schedule.value_before(time, ended) if ended > 0.0 else schedule.value(time)


class Surroundings:
    """Stimuli, loads and prescribed motion of a scene over time."""

    def __init__(self, model: Model):
        self.model = model
        self._prescribed = np.flatnonzero(model.bodies.free_index[:-1] < 0)
        self._channels = list(model.scene.stimuli.values())
        self._moves = any(len(model.bodies.times[index]) for index in self._prescribed)
        self._courses: dict[tuple[int, int], Course] = {}

    def prescribed(self, state: State, time: float) -> Prescribed:
        """Motion of prescribed bodies at `time`, of free ones as they are, without rates."""
        position, rotation = state.body_position.copy(), state.body_rotation.copy()
        rates = np.zeros((len(position), 6))
        for index in self._prescribed:
            position[index], rotation[index], rates[index] = scheduled_motion(self.model.bodies, index, time)
        return Prescribed(self._prescribed, position, rotation, rates)

    def stimulus_at(self, state: State, time: float, ended: float = 0.0) -> Array:
        """Value of each channel at `time`, shape (n_channel,): that set from outside, or the schedule's.

        At the end of a step of length `ended` [s], a schedule that jumps there still has its value from before.
        """
        scheduled = [_value(channel.schedule, time, ended) for channel in self._channels]
        return np.where(np.isnan(state.override), np.array(scheduled, dtype=float), state.override)

    def rest_strains_of(self, transduction: Array) -> RestStrains:
        """Strains without stress from the filtered stimuli."""
        model = self.model
        strain = free_strain(transduction, model.law_gain, model.law_reference, model.law_saturation)
        grown = np.bincount(model.driven_edge, model.driven_weight * strain[model.driven_law], model.edge_count)
        joint = model.joint_rest
        if len(model.driven_joint):
            bent = model.driven_joint_weight * strain[model.driven_joint_law]
            joint = joint.copy()
            joint[:, 0] += np.bincount(model.driven_joint, bent, len(joint))
            joint.flags.writeable = False
        return RestStrains(model.rest_strain + grown, joint)

    def load_factor(self, time: float, ended: float = 0.0) -> Array:
        """Factor of each load at `time`, at the end of a step of length `ended` [s], shape (n_load,)."""
        return np.array([_value(load.factor, time, ended) for load in self.model.scene.loads], dtype=float)

    def loads_jump(self, time: float, h: float) -> bool:
        """Whether a load jumps at `time`, seen from a step of length `h` [s]."""
        return any(load.factor.jumps_at(time, h) for load in self.model.scene.loads)

    def drive(self, state: State, first_stimulus: Array, begin: float, elapsed: float) -> Drive:
        """What acts from outside `elapsed` [s] after `begin` [s], the start of a step."""
        model = self.model
        stimulus = self.stimulus_at(state, begin + elapsed, elapsed)
        transduction = state.transduction
        if len(transduction):
            ends = first_stimulus[model.law_channel], stimulus[model.law_channel]
            transduction = follow(transduction, *ends, model.law_rising, model.law_falling, elapsed)
        load_factor = self.load_factor(begin + elapsed, elapsed)
        return Drive(stimulus, transduction, self.rest_strains_of(transduction), load_factor)

    def course(self, state: State, method: Method, times: list[float], h: float) -> Course:
        """What acts from outside at the points of steps of length `h` [s] that end at `times` [s].

        It is good until the next one is asked for with as many steps and points, which is made in its place.
        """
        elapsed = [node * h for node in method.points]
        begins = [time - h for time in times]
        stages = [begin + part for begin in begins for part in elapsed]
        parts = elapsed * len(times)
        loads = self.model.scene.loads
        course = self._courses.get((len(times), len(elapsed)))
        if course is None or self._moves:
            course = self._courses[len(times), len(elapsed)] = self.new_course(state, method, times, h)
        course.time[:], course.elapsed[:] = times, elapsed
        for index, (channel, value) in enumerate(zip(self._channels, state.override.tolist(), strict=True)):
            if math.isnan(value):
                course.first[:, index] = channel.schedule.values_at(begins, h)
                ends = channel.schedule.values_before(stages, parts)
                course.stimulus[:, :, index] = np.reshape(ends, course.stimulus.shape[:2])
            else:
                course.first[:, index] = course.stimulus[:, :, index] = value
        if loads:
            factors = [load.factor.values_before(stages, parts) for load in loads]
            course.load_factor[:] = np.transpose(factors).reshape(course.load_factor.shape)
            if method.history is not None:
                course.jumps[:] = [self.loads_jump(begin, h) for begin in begins]
        return course

    def new_course(self, state: State, method: Method, times: list[float], h: float) -> Course:
        """Room for a course, with the poses of prescribed bodies, of which it has one row if none of them moves."""
        steps, points = len(times), len(method.points)
        placed = times if self._moves else times[:1]
        poses = [self.prescribed(state, time - (1.0 - node) * h) for time in placed for node in method.points]
        rows = len(placed), points, len(self.model.bodies.names)
        return Course(
            time=np.empty(steps),
            elapsed=np.empty(points),
            first=np.empty((steps, len(self._channels))),
            jumps=np.zeros(steps, dtype=bool),
            stimulus=np.empty((steps, points, len(self._channels))),
            load_factor=np.empty((steps, points, len(self.model.scene.loads))),
            position=np.array([pose.position for pose in poses]).reshape(*rows, 3),
            rotation=np.array([pose.rotation for pose in poses]).reshape(*rows, 3, 3),
            rates=np.array([pose.rates for pose in poses]).reshape(*rows, 6),
        )
