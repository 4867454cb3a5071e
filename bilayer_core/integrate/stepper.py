"""Fixed steps: each in as few equal parts as Newton needs, each part accepted only if it converged."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SimulationError
from ..march.engine import Engine, MarchReport, Settings
from ..march.step import AT_ONCE, NO_JUMP
from ..march.step_groups import Course
from ..model.model import Model, scheduled_motion
from ..model.state import State
from ..scene.schedule import value_before
from ..scene.transduction import follow, free_strain
from ..solve.configuration import Configuration
from ..solve.newton import NewtonReport, NewtonSolver, NewtonStatus
from ..solve.potential import IncrementalPotential
from ..solve.terms.term import RestStrains, StepContext
from .method import Method
from .motion import momentary_context
from .sdirk2 import METHOD as SELF_STARTING
from .slopes import keep_slopes, move_along, slopes_of
from .stages import Point, Prescribed, combine, end_point, predict, start_point, write_state

if TYPE_CHECKING:
    from .ledger import EnergyLedger

Array = np.ndarray
LISTS_AT_MOST = 10
"""That are made anew for one step of a loop."""


@dataclass(frozen=True)
class StepReport:
    """How a step went.

    Attributes
    ----------
    time : float
        At its end [s].
    length : float
        [s].
    substeps, rejected : int
        Parts accepted, and attempts that were not.
    iterations, factorisations : int
        Newton corrections and factorised Hessians, failed attempts included.
    residual : float
        Largest speed of a correction left [m/s].
    inaccurate : int
        Attempts that were not accepted because of their error.
    """

    time: float
    length: float
    substeps: int
    rejected: int
    iterations: int
    factorisations: int
    residual: float
    inaccurate: int = 0


@dataclass(frozen=True)
class _Drive:
    """Values of stimuli, what the laws made of them, rest strains and factors of loads at one time."""

    stimulus: Array
    transduction: Array
    rest: RestStrains
    load_factor: Array


def _value(value: Callable[[float], float], time: float, ended: float) -> float:
    return value_before(value, time, ended) if ended > 0.0 else value(time)


class Stepper:
    """Advances a `State` by fixed steps dt, halving where Newton fails and doubling again where it succeeds.

    Attributes
    ----------
    end : Configuration
        The last accepted configuration.
    stimulus : Array
        Value of each channel over the last step.
    used : Method
        The method of the last attempt, which after a jump is not `method`.
    loops : bool
        Whether steps are made in compiled loops where they can.
    ledger : EnergyLedger or None
        What keeps the energy budget, if anything does.
    """

    def __init__(
        self, model: Model, method: Method, dt: float, newton_tolerance: float, max_iterations: int, max_halvings: int
    ):
        self.model = model
        self.method = self.used = method
        self.dt = dt
        self.max_halvings = max_halvings
        self.potential = IncrementalPotential(model)
        self.solver = NewtonSolver(model, self.potential, newton_tolerance, max_iterations)
        self._start = Configuration(model)
        self._target = Configuration(model)
        self.end = Configuration(model)
        self._trial = Configuration(model)
        self._prescribed = np.flatnonzero(model.bodies.free_index[:-1] < 0)
        self._channels = list(model.scene.stimuli.values())
        self._range = np.array([channel.maximum - channel.minimum for channel in self._channels])
        places = [self._start, self.end, self._trial]
        self._places = places
        self.engine = Engine(model, self.potential, places, method.history is not None)
        self._arrays = {used: used.arrays() for used in {method, SELF_STARTING} if used.weights is None}
        self._touched = self.engine.touched
        self.loops = method.weights is None
        self.stimulus = np.zeros(len(self._channels))
        self.rest_strains = RestStrains(model.rest_strain, model.joint_rest)
        self.ledger: EnergyLedger | None = None

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
        scheduled = [_value(channel.schedule.value, time, ended) for channel in self._channels]
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

    def rest(self, state: State) -> None:
        """Evaluate the potential at a state as it stands, for energies and contact forces before the first step."""
        time = float(state.time[0])
        self.end.take_state(state)
        self.stimulus = self.stimulus_at(state, time)
        self.rest_strains = self.rest_strains_of(state.transduction)
        self._look_at(state, self.rest_strains, self.load_factor(time))

    def _look_at(self, state: State, rest: RestStrains, load_factor: Array) -> None:
        """Evaluate the potential at `end` with the velocities of the state."""
        self.potential.start_step(momentary_context(self.model, self.end, state, rest, load_factor))
        self.potential.evaluate(self.end, False)
        self._touched[:] = self._touching()

    def compile(self, state: State) -> None:
        """Make a step of every kind that the run may need, for its kernels; `state` stays as it is."""
        for attempt in (self._attempt, self._attempt_by_terms) if self.model.rod_surfaces else (self._attempt,):
            attempt(state.copy(), self.dt, float(state.time[0]) + self.dt)

    def restart(self, state: State) -> None:
        """Something has jumped: fixed steps go on as they are."""

    def advance(self, state: State, until: float = math.inf) -> StepReport:
        """One step dt, in place, wherever it ends.

        Raises
        ------
        SimulationError
            If the smallest part does not converge either; nothing is changed then.
        """
        parts = 2**self.max_halvings
        if self.ledger is not None:
            self.ledger.mark()
        kept: State | None = None  # of the start, once a part of the step is done
        begin, count = float(state.time[0]), float(state.step[0])
        on_grid = begin == count * self.dt  # not so after steps of another length
        level = int(state.halvings[0])
        done = substeps = rejected = iterations = factorisations = 0
        residual = 0.0
        while done < parts:
            size = parts >> level
            fraction = (done + size) / parts
            time = (count + fraction) * self.dt if on_grid else begin + fraction * self.dt
            if done == 0 and size < parts:
                kept = state.copy()
            report = self._attempt(state, self.dt * size / parts, time)
            iterations += report.iterations
            factorisations += report.factorisations
            if report.converged:
                done += size
                substeps += 1
                residual = max(residual, report.residual)
                if level > 0 and done % (2 * size) == 0:
                    level -= 1
                continue
            rejected += 1
            if level == self.max_halvings:
                if kept is not None:
                    state.take(kept)
                if self.ledger is not None:
                    self.ledger.roll_back()
                raise SimulationError(self._explain(report, time, self.dt * size / parts), begin)
            level += 1
        state.time[0] = time
        state.step += 1.0
        state.halvings[0] = level
        return StepReport(time, self.dt, substeps, rejected, iterations, factorisations, residual)

    def march(self, state: State, steps: int) -> MarchReport | None:
        """As many of the next fixed steps as a compiled loop makes without help, at most `steps`, each taken into the
        tally. None if it made none: the next step is one for `advance`.
        """
        count = float(state.step[0])
        if not self.loops or self.ledger is not None or state.halvings[0] or state.time[0] != count * self.dt:
            return None
        times = [(count + done) * self.dt for done in range(1, steps + 1)]
        found = self._loop(state, self.method, times, self.dt, self.method.history is not None, counts=True)
        if found is None or found.done == 0:
            return None
        state.time[0], state.step[0] = times[found.done - 1], count + found.done
        self.used = self.method
        if not found.finished:
            self.rest(state)  # what the last attempt left is not what the state is
        return found

    def _attempt(self, state: State, h: float, time: float) -> NewtonReport:
        """Try one part of length `h` [s] that ends at `time` [s]; `state` changes only if it converged."""
        report = self._attempt_in_loop(state, h, time) if self.loops else None
        return self._attempt_by_terms(state, h, time) if report is None else report

    def _attempt_in_loop(self, state: State, h: float, time: float) -> NewtonReport | None:
        """`_attempt` in a compiled loop; None, and nothing is changed, if it is not for one."""
        method = self.used = self._method_at(state, self.stimulus_at(state, time - h), time - h, h)
        found = self._loop(state, method, [time], h, changes=False, counts=False)
        if found is None:
            return None
        report = found.newton
        if not report.converged:
            return replace(report, detail=self.solver.who_blocks(found.pair)) if found.pair >= 0 else report
        if self.ledger is not None:
            self.ledger.record(state, self.rest_strains, self.load_factor(time, h), h)
        return report

    def _loop(
        self, state: State, method: Method, times: list[float], h: float, changes: bool, counts: bool
    ) -> MarchReport | None:
        """Steps that end at the given times, as many as succeed, in a compiled loop; None if none is for one."""
        solver = self.model.scene.solver
        settings = Settings(self.solver.tolerance, solver.max_newton_iterations, changes, counts)
        course = self._course(state, method, times, h)
        for attempt in range(LISTS_AT_MOST):
            found = self.engine.march(state, self._arrays[method], course, h, settings)
            if found.done > 0 or not self.engine.make_room(found.status, attempt):
                break
        if found.done == 0 and found.failure is None and not found.finished:
            return None
        self.end = self._places[found.place]
        self._start, self._trial = (self._places[k] for k in range(3) if k != found.place)
        if found.done > 0:
            self.stimulus = self.stimulus_at(state, times[found.done - 1], h)
            self.rest_strains = self.rest_strains_of(state.transduction)
        return found

    def _course(self, state: State, method: Method, times: list[float], h: float) -> Course:
        """What acts from outside at the stages of steps of length `h` [s] that end at `times` [s]."""
        elapsed = [node * h for node in method.nodes]
        shape = len(times), len(elapsed)
        begins = [time - h for time in times]
        stages = [begin + part for begin in begins for part in elapsed]
        parts = elapsed * len(times)
        loads = self.model.scene.loads
        factors = np.array([[_value(load.factor, *when) for load in loads] for when in zip(stages, parts, strict=True)])
        jumps = np.zeros(len(times), dtype=bool)
        if loads and method.history is not None:
            jumps[:] = [not np.array_equal(self.load_factor(t), self.load_factor(t, h)) for t in begins]
        placed = self._when_placed(times)
        poses = [self.prescribed(state, time - (1.0 - node) * h) for time in placed for node in method.nodes]
        rows = len(placed), shape[1], len(self.model.bodies.names)
        return Course.of(
            time=np.array(times),
            elapsed=np.array(elapsed),
            first=self._stimuli(state, begins, [0.0] * len(begins)),
            jumps=jumps,
            stimulus=self._stimuli(state, stages, parts).reshape(*shape, -1),
            load_factor=factors.reshape(*shape, len(loads)),
            position=np.array([pose.position for pose in poses]).reshape(*rows, 3),
            rotation=np.array([pose.rotation for pose in poses]).reshape(*rows, 3, 3),
            rates=np.array([pose.rates for pose in poses]).reshape(*rows, 6),
        )

    def _when_placed(self, times: list[float]) -> list[float]:
        """The times of which the poses of prescribed bodies are needed: one if none of them moves."""
        moves = any(len(self.model.bodies.times[index]) for index in self._prescribed)
        return times if moves else times[:1]

    def _stimuli(self, state: State, times: list[float], ended: list[float]) -> Array:
        """`stimulus_at` for several times, shape (n_time, n_channel)."""
        values = np.empty((len(times), len(self._channels)))
        for index, (channel, fixed) in enumerate(zip(self._channels, state.override.tolist(), strict=True)):
            value = channel.schedule.value
            values[:, index] = (
                [_value(value, *when) for when in zip(times, ended, strict=True)] if math.isnan(fixed) else fixed
            )
        return values

    def _attempt_by_terms(self, state: State, h: float, time: float) -> NewtonReport:
        """`_attempt` term by term, for what compiled loops do not know: rods that touch, and ends of steps beyond their
        last stage.
        """
        model = self.model
        self._start.take_state(state)
        first = start_point(model, state, self._start)
        first_stimulus = self.stimulus_at(state, time - h)
        method = self.used = self._method_at(state, first_stimulus, time - h, h)
        slopes = slopes_of(model, state, first) if method.history else None
        turned = np.zeros(model.edge_count)
        length, momentum_length = method.diagonal * h, (method.momentum_diagonal or method.diagonal) * h
        stages: list[tuple[Point, Point]] = []
        iterations = factorisations = backtracks = 0
        residual = 0.0
        for number, (node, couplings) in enumerate(zip(method.nodes, method.couplings, strict=True)):
            weights = [coupling / method.diagonal for coupling in couplings]
            origin = combine(first, [(w, *stage) for w, stage in zip(weights, stages, strict=True)])
            if slopes is not None:
                move_along(origin, slopes, method.history, number, h)
            drive = self._drive(state, first_stimulus, time - h, node * h)
            prescribed = self.prescribed(state, time - (1.0 - node) * h)
            driven = drive.rest, drive.load_factor
            context = predict(model, origin, self._start, turned, length, *driven, momentum_length, prescribed)
            report = self._solve(context, prescribed)
            iterations += report.iterations
            factorisations += report.factorisations
            backtracks += report.backtracks
            if not report.converged:
                return replace(report, iterations=iterations, factorisations=factorisations, backtracks=backtracks)
            residual = max(residual, report.residual)
            stages.append((origin, end_point(model, context, origin, turned, self.end, prescribed)))
            turned = stages[-1][1].turn
            if len(stages) < len(method.nodes):
                self._start, self.end = self.end, self._start
                self._start.turn[:] = 0.0
        report = NewtonReport(NewtonStatus.CONVERGED, iterations, factorisations, residual, backtracks)
        origin, last = stages[-1]
        if method.weights is not None:
            weights = [weight / method.diagonal for weight in method.weights]
            last = combine(first, [(w, *stage) for w, stage in zip(weights, stages, strict=True)])
            drive = self._drive(state, first_stimulus, time - h, h)
            prescribed = self.prescribed(state, time)
            last.body_position[prescribed.index] = prescribed.position[prescribed.index]
            last.rotation[prescribed.index] = prescribed.rotation[prescribed.index]
            if not self._go_beyond(last, turned):
                return replace(report, status=NewtonStatus.BEYOND, residual=math.inf)
        write_state(model, state, last, self.end, prescribed.rates)
        if method.weights is not None:
            self._look_at(state, drive.rest, drive.load_factor)
        if self.method.history is not None:
            keep_slopes(state, origin, last, momentum_length, method.history)
            touching = self._touching()
            state.kept[0] = np.array_equal(touching, self._touched)
            self._touched[:] = touching
        state.transduction[:] = drive.transduction
        self.stimulus, self.rest_strains = drive.stimulus, drive.rest
        if self.ledger is not None:
            self.ledger.record(state, drive.rest, drive.load_factor, h)
        return report

    def _touching(self) -> Array:
        """Which carriers something pushed at the last evaluation, shape (n_carrier,)."""
        return np.any(self.potential.carrier_gradient != 0.0, axis=1)

    def _method_at(self, state: State, stimulus: Array, time: float, h: float) -> Method:
        """The method for a step of length `h` [s] that begins at `time` [s]: one without history after a jump."""
        if self.method.history is None:
            return self.method
        model = self.model
        jumped = not state.kept[0] or not np.array_equal(self.load_factor(time), self.load_factor(time, h))
        if len(state.transduction):
            way = stimulus[model.law_channel] - state.transduction
            lag = np.where(way > 0.0, model.law_rising, model.law_falling)
            jumped |= bool(np.any((np.abs(way) > NO_JUMP * self._range[model.law_channel]) & (lag < AT_ONCE * h)))
        return SELF_STARTING if jumped else self.method

    def _drive(self, state: State, first_stimulus: Array, begin: float, elapsed: float) -> _Drive:
        """What acts from outside `elapsed` [s] after `begin` [s], the start of a step."""
        model = self.model
        stimulus = self.stimulus_at(state, begin + elapsed, elapsed)
        transduction = state.transduction
        if len(transduction):
            ends = first_stimulus[model.law_channel], stimulus[model.law_channel]
            transduction = follow(transduction, *ends, model.law_rising, model.law_falling, elapsed)
        load_factor = self.load_factor(begin + elapsed, elapsed)
        return _Drive(stimulus, transduction, self.rest_strains_of(transduction), load_factor)

    def _solve(self, context: StepContext, prescribed: Prescribed) -> NewtonReport:
        """Solve a stage; its result is `end`."""
        self.potential.start_step(context)
        self._target.place_prescribed(prescribed.position, prescribed.rotation)
        report = self.solver.first_guess(context, self._target, self.end)
        if report is not None:
            return report
        report, end = self.solver.minimise(self.end, self._trial)
        if end is not self.end:
            self.end, self._trial = end, self.end
        return report

    def _go_beyond(self, last: Point, turned: Array) -> bool:
        """Move `end` from the last stage on to the end of the step; false if a surface is in the way."""
        begin, end, free = self.end, self._trial, self.model.bodies.body_of_free
        end.position[:] = last.position
        end.body_position[:], end.body_rotation[:] = last.body_position[free], last.rotation[free]
        end.place_prescribed(last.body_position, last.rotation)
        end.place_held()
        end.carry_frames(begin, last.turn - turned)
        end.joint_strain[:, 2] = begin.joint_strain[:, 2]
        if self.solver.bound_between(begin, end) < 1.0:
            return False
        if not math.isfinite(self.potential.evaluate(end, False)):
            return False
        self.end, self._trial = end, begin
        return True

    def _explain(self, report: NewtonReport, time: float, h: float) -> str:
        text = f"{report.status.value} in the step to t = {time:.6g} s, tried down to {h:.3g} s"
        if np.isfinite(report.residual):
            tolerance = self.model.scene.solver.newton_tolerance
            text += f" (correction left {report.residual:.3g} m/s, allowed {tolerance:.3g} m/s, "
            text += f"{report.iterations} iterations)"
        return text + (f": {report.detail}" if report.detail else "")
