"""Fixed steps: each in as few equal parts as Newton needs, each part accepted only if it converged."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SimulationError
from ..march.engine import Engine, MarchReport, Settings
from ..march.step import AT_ONCE, NO_JUMP
from ..model.model import Model
from ..model.rest_strains import RestStrains
from ..model.state import State
from ..solve.configuration import Configuration
from ..solve.newton import NewtonReport, NewtonSolver, NewtonStatus
from ..solve.potential import IncrementalPotential
from ..solve.terms.term import StepContext
from .method import Method
from .motion import MOMENT, momentary_context
from .sdirk2 import METHOD as SELF_STARTING
from .slopes import keep_slopes, move_along, slopes_of
from .stages import Point, Prescribed, combine, end_point, predict, start_point, write_state
from .surroundings import Surroundings

if TYPE_CHECKING:
    from .ledger import EnergyLedger

Array = np.ndarray


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

    @classmethod
    def of(cls, found: MarchReport, time: float) -> StepReport:
        """That of the only step of a compiled loop, which ended at `time` [s]."""
        newton = found.newton
        counts = 1, found.rejected, newton.iterations, newton.factorisations
        return cls(time, found.length, *counts, newton.residual, found.inaccurate)


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
    surroundings : Surroundings
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
        self.surroundings = Surroundings(model)
        places = [self._start, self.end, self._trial]
        self._places = places
        self.engine = Engine(model, self.potential, places, method.history is not None)
        self._arrays = {used: used.arrays() for used in {method, SELF_STARTING} if used.weights is None}
        self._touched = self.engine.touched
        self.loops = method.weights is None
        self.stimulus = np.zeros(len(model.scene.stimuli))
        self.ledger: EnergyLedger | None = None

    def rest(self, state: State) -> None:
        """Evaluate the potential at a state as it stands, for energies and contact forces before the first step."""
        time = float(state.time[0])
        stimulus = self.surroundings.stimulus_at(state, time)
        rest = self.surroundings.rest_strains_of(state.transduction)
        load_factor = self.surroundings.load_factor(time)
        if self.loops:
            self.engine.set_drive(rest, load_factor)
            self._look(state)
            self._touched[:] = self._touching()
        else:
            self.end.take_state(state)
            self._look_at(state, rest, load_factor)
        self.stimulus = stimulus

    def _look(self, state: State) -> None:
        """`_look_at` in a compiled loop, with what acts set before."""
        self._loop(state, self.method, [float(state.time[0])], self.dt, moment=MOMENT)

    def _look_at(self, state: State, rest: RestStrains, load_factor: Array) -> None:
        """Evaluate the potential at `end` with the velocities of the state."""
        self.potential.start_step(momentary_context(self.model, self.end, state, rest, load_factor))
        self.potential.evaluate(self.end, False)
        self._touched[:] = self._touching()

    def compile(self, state: State) -> None:
        """Make a step, for its kernels; `state` stays as it is."""
        self._attempt(state.copy(), self.dt, float(state.time[0]) + self.dt)

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

    def march(self, state: State, steps: int, until: float = math.inf) -> MarchReport | None:
        """As many of the next fixed steps as a compiled loop makes without help, at most `steps`, wherever they end,
        each taken into the tally. None if it made none: the next step is one for `advance`.
        """
        count = float(state.step[0])
        if not self.loops or self.ledger is not None or state.halvings[0] or state.time[0] != count * self.dt:
            return None
        times = [(count + done) * self.dt for done in range(1, steps + 1)]
        found = self._loop(state, self.method, times, self.dt, changes=self.method.history is not None, counts=True)
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
        method = self.used = self._method_at(state, time - h, h)
        found = self._loop(state, method, [time], h)
        if found is None:
            return None
        report = found.newton
        if not report.converged:
            return replace(report, detail=self.solver.who_blocks(found.pair)) if found.pair >= 0 else report
        if self.ledger is not None:
            rest = self.surroundings.rest_strains_of(state.transduction)
            self.ledger.record(state, rest, self.surroundings.load_factor(time, h), h)
        return report

    def _loop(
        self, state: State, method: Method, times: list[float], h: float, *, moment=0.0, changes=False, counts=False
    ) -> MarchReport | None:
        """Steps that end at the given times, as many as succeed, in a compiled loop; None if none is for one."""
        solver = self.model.scene.solver
        settings = Settings(self.solver.tolerance, solver.max_newton_iterations, moment, changes, counts)
        course = self.surroundings.course(state, method, times, h)
        while True:
            found = self.engine.march(state, self._arrays[method], course, h, settings)
            if not self.engine.make_room(found.status) or found.done > 0:
                break
        if found.done == 0 and not found.failed and not found.finished:
            return None
        self.end = self._places[found.place]
        self._start, self._trial = (self._places[k] for k in range(3) if k != found.place)
        if found.done > 0:
            self.stimulus = course.stimulus[found.done - 1, -1].copy()
        return found

    def _attempt_by_terms(self, state: State, h: float, time: float) -> NewtonReport:
        """`_attempt` term by term, for what compiled loops do not know: ends of steps beyond their last stage."""
        model = self.model
        self._start.take_state(state)
        first = start_point(model, state, self._start)
        first_stimulus = self.surroundings.stimulus_at(state, time - h)
        method = self.used = self._method_at(state, time - h, h)
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
            drive = self.surroundings.drive(state, first_stimulus, time - h, node * h)
            prescribed = self.surroundings.prescribed(state, time - (1.0 - node) * h)
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
            drive = self.surroundings.drive(state, first_stimulus, time - h, h)
            prescribed = self.surroundings.prescribed(state, time)
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
        self.stimulus = drive.stimulus
        if self.ledger is not None:
            self.ledger.record(state, drive.rest, drive.load_factor, h)
        return report

    def _touching(self) -> Array:
        """Which carriers something pushed at the last evaluation, shape (n_carrier,)."""
        return np.any(self.potential.carrier_gradient != 0.0, axis=1)

    def _method_at(self, state: State, time: float, h: float) -> Method:
        """The method for a step of length `h` [s] that begins at `time` [s]: one without history after a jump."""
        if self.method.history is None:
            return self.method
        model = self.model
        jumped = not state.kept[0] or self.surroundings.loads_jump(time, h)
        if len(state.transduction):
            stimulus = self.surroundings.stimulus_at(state, time)
            way = stimulus[model.law_channel] - state.transduction
            lag = np.where(way > 0.0, model.law_rising, model.law_falling)
            seen = np.abs(way) > NO_JUMP * self.engine.ranges[model.law_channel]
            jumped |= bool(np.any(seen & (lag < AT_ONCE * h)))
        return SELF_STARTING if jumped else self.method

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
