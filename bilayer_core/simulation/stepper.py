"""Fixed steps: each in as few equal parts as Newton needs, each part accepted only if it converged."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..engine.engine import Engine, MarchReport, Settings
from ..engine.modes import LOOK, STEP
from ..engine.newton_report import NewtonReport
from ..engine.step import AT_ONCE, NO_JUMP
from ..errors import SimulationError
from ..integrators.method import Method
from ..integrators.sdirk2 import METHOD as SELF_STARTING
from ..model.model import Model
from ..model.records.step import Place
from ..model.state import State
from .energy_budget import EnergyLedger
from .stage_inputs import Surroundings

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
        Largest speed of a last correction [m/s].
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
    stimulus : Array
        Value of each channel over the last step.
    used : Method
        The method of the last attempt, which after a jump is not `method`.
    surroundings : Surroundings
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
        self.newton_tolerance, self._max_iterations = newton_tolerance, max_iterations
        self.surroundings = Surroundings(model)
        self._arrays = {used: used.arrays() for used in {method, SELF_STARTING}}
        stages = max(len(used.nodes) for used in self._arrays)
        self.engine = Engine(model, method.history is not None, stages)
        self.stimulus = np.zeros(len(model.scene.stimuli))
        self.ledger: EnergyLedger | None = None

    @property
    def end(self) -> Place:
        """The configuration of the state after the last step or look."""
        return self.engine.end

    def rest(self, state: State) -> None:
        """Evaluate the potential at a state as it stands, for energies and contact forces before the first step."""
        time = float(state.time[0])
        stimulus = self.surroundings.stimulus_at(state, time)
        rest = self.surroundings.rest_strains_of(state.transduction)
        load_factor = self.surroundings.load_factor(time)
        self.engine.set_drive(rest, load_factor)
        self.do_once(state, LOOK)
        self.engine.touched[:] = self.engine.touching
        self.stimulus = stimulus

    def do_once(self, state: State, mode: int, length: float = 0.0, tolerance: float = math.inf) -> MarchReport:
        """What another mode of the compiled step than steps does (`engine.modes`), with what acts set before."""
        times = [float(state.time[0])]
        return self._loop(state, self.method, times, self.dt, mode=mode, length=length, tolerance=tolerance)

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

    def march(self, state: State, steps: int, until: float = math.inf, due: float = math.inf) -> MarchReport | None:
        """As many of the next fixed steps as a compiled loop makes without help, at most `steps`, wherever they end,
        each taken into the tally. None if it made none: the next step is one for `advance`.
        """
        count = float(state.step[0])
        if self.ledger is not None or state.halvings[0] or state.time[0] != count * self.dt:
            return None
        times = [(count + done) * self.dt for done in range(1, steps + 1)]
        found = self._loop(state, self.method, times, self.dt, changes=self.method.history is not None, counts=True)
        if found.done == 0:
            return None
        state.time[0], state.step[0] = times[found.done - 1], count + found.done
        self.used = self.method
        if not found.finished:
            self.rest(state)  # what the last attempt left is not what the state is
        return found

    def _attempt(self, state: State, h: float, time: float) -> NewtonReport:
        """Try one part of length `h` [s] that ends at `time` [s]; `state` changes only if it converged."""
        method = self.used = self._method_at(state, time - h, h)
        found = self._loop(state, method, [time], h)
        report = found.newton
        if not report.converged:
            return replace(report, detail=self.engine.who_blocks(found.pair)) if found.pair >= 0 else report
        if self.ledger is not None:
            rest = self.surroundings.rest_strains_of(state.transduction)
            self.ledger.record(state, rest, self.surroundings.load_factor(time, h), h)
        return report

    def _loop(
        self,
        state: State,
        method: Method,
        times: list[float],
        h: float,
        *,
        mode: int = STEP,
        length: float = 0.0,
        tolerance: float | None = None,
        changes: bool = False,
        counts: bool = False,
    ) -> MarchReport:
        """Steps that end at the given times, as many as succeed, in a compiled loop, or what another mode does."""
        tolerance = self.newton_tolerance if tolerance is None else tolerance
        settings = Settings(tolerance, self._max_iterations, mode, length, changes, counts)
        course = self.surroundings.course(state, method, times, h)
        while True:
            found = self.engine.march(state, self._arrays[method], course, h, settings)
            if not self.engine.make_room(found.status) or found.done > 0:
                break
        if found.done > 0:
            self.stimulus = course.stimulus[found.done - 1, -1].copy()
        return found

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

    def _explain(self, report: NewtonReport, time: float, h: float) -> str:
        text = f"{report.status.value} in the step to t = {time:.6g} s, tried down to {h:.3g} s"
        if np.isfinite(report.residual):
            text += f" (correction left {report.residual:.3g} m/s, allowed {self.newton_tolerance:.3g} m/s, "
            text += f"{report.iterations} iterations)"
        return text + (f": {report.detail}" if report.detail else "")
