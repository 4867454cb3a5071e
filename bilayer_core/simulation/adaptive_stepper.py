"""Steps as long as their error allows.

A step is attempted, its error estimated (`engine.error_norm`), and it is made again, shorter, where that exceeds the
tolerance or Newton fails (`engine.step_size`), all in one compiled loop (`engine.integrate`). It ends exactly where a
stimulus, a load or a prescribed path has a corner or jumps (`stretch`) and where the caller asks; after a jump steps
begin again with the first step's length. All that this remembers is in the state.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..engine.adaptive import Adapter
from ..engine.engine import MarchReport, Settings
from ..engine.integrate import Control
from ..engine.modes import STEP
from ..errors import InputError, SimulationError
from ..integrators.method import Method
from ..integrators.sdirk2 import METHOD as SELF_STARTING
from ..model.model import Model
from ..model.records.status import JUMPED, TOO_INACCURATE
from ..model.records.step import Course
from ..model.state import State
from .smooth_interval import Stretch
from .stepper import Stepper, StepReport

TIME_ROUNDING = 1e-9
"""Part of the first step by which two times are the same."""


class AdaptiveStepper(Stepper):
    """Advances a `State` by steps whose error is at most a tolerance.

    Parameters
    ----------
    model : Model
    method : Method
        With an estimate of its error.
    first : float
        Length of the first step, and of the first after a jump [s].
    newton_tolerance, max_iterations
        As for `Stepper`.
    tolerance : float
        Largest local error of a step: displacement over the length of the longest rod (`engine.error_norm`).
    shortest, largest : float
        Lengths of the shortest and the longest step [s].

    Raises
    ------
    InputError
        If the method has no estimate.
    """

    def __init__(
        self,
        model: Model,
        method: Method,
        first: float,
        newton_tolerance: float,
        max_iterations: int,
        tolerance: float,
        shortest: float,
        largest: float,
    ):
        if method.estimate is None:
            raise InputError(
                f"tolerance: {tolerance:g} is not allowed with the integrator {method.name}, which has no estimate of "
                "its error; leave it out, or take another integrator"
            )
        super().__init__(model, method, first, newton_tolerance, max_iterations, max_halvings=0)
        self.tolerance = tolerance
        self._first = min(first, largest)
        self._stretch = Stretch(model)
        control = Control(
            order=method.order, tolerance=tolerance, first=self._first, shortest=shortest, longest=largest
        )
        self._adapter = Adapter(model, self.engine, control, self._stretch.acting)
        self._rooms: dict[Method, Course] = {}

    def compile(self, state: State) -> None:
        """Make a step for its kernels; `state` stays as it is."""
        copy = state.copy()
        self._go(copy, 1, self._next_stop(copy, math.inf)[0], math.inf, counts=False)

    def advance(self, state: State, until: float = math.inf) -> StepReport:
        """One step, in place, that ends at `until` [s] at the latest.

        Raises
        ------
        SimulationError
            If the shortest step does not converge or is not accurate enough; nothing is changed then.
        """
        found = self._march(state, 1, until, math.inf, counts=False)
        if not found.done:
            raise SimulationError(self._why(found, float(state.time[0])), float(state.time[0]))
        report = StepReport.of(found, float(state.time[0]))
        if self.ledger is not None:
            rest = self.surroundings.rest_strains_of(state.transduction)
            self.ledger.record(state, rest, self.surroundings.load_factor(report.time, report.length), report.length)
        return report

    def march(self, state: State, steps: int, until: float = math.inf, due: float = math.inf) -> MarchReport | None:
        """At most so many steps, none of which passes `until` or begins at `due` or later [s], taken into the tally.
        None if it made none: the next step is one for `advance`, which says why it cannot be made.
        """
        if self.ledger is not None:
            return None
        found = self._march(state, steps, until, due, counts=True)
        return found if found.done else None

    def _march(self, state: State, steps: int, until: float, due: float, *, counts: bool) -> MarchReport:
        """As many steps as succeed, from one corner to the next."""
        found: MarchReport | None = None
        while found is None or (not found.failed and found.done < steps and state.time[0] < min(until, due)):
            stop, breaks = self._next_stop(state, until)
            more = self._go(state, steps - (found.done if found else 0), stop, due, counts=counts)
            if breaks and more.done and state.time[0] == stop:
                self._begin_again_if_jumped(state)
            found = more if found is None else found.followed_by(more)
        if found.done and found.failed:
            self.rest(state)  # what the last attempt left is not what the state is
        return found

    def do_once(self, state: State, mode: int, length: float = 0.0, tolerance: float = math.inf) -> MarchReport:
        return self._go(state, 1, math.inf, math.inf, counts=False, mode=mode, length=length, tolerance=tolerance)

    def _go(
        self,
        state: State,
        most: int,
        stop: float,
        due: float,
        *,
        counts: bool,
        mode: int = STEP,
        length: float = 0.0,
        tolerance: float | None = None,
    ) -> MarchReport:
        """At most so many steps up to `stop` [s], before which nothing has a corner, or what another mode does."""
        tolerance = self.newton_tolerance if tolerance is None else tolerance
        method, changes = self.method, self.method.history is not None and mode == STEP
        while True:
            settings = Settings(tolerance, self._max_iterations, mode, length, changes, counts)
            course = self._room_of(state, method)
            found = self._adapter.adapt(state, self._arrays[method], course, stop, due, most, settings)
            if found.status == JUMPED and not found.done:
                method, most, changes = SELF_STARTING, 1, False
            elif not self.engine.make_room(found.status) or found.done:
                break
        self.used = method
        self.stimulus = course.stimulus[0, -1].copy()
        return found

    def _room_of(self, state: State, method: Method) -> Course:
        """For what acts during a step of a method."""
        if method not in self._rooms:
            self._rooms[method] = self.surroundings.new_course(state, method, [float(state.time[0])], 0.0)
        return self._rooms[method]

    def restart(self, state: State) -> None:
        """Begin again with short steps: something has jumped."""
        state.next_step[0] = min(float(state.next_step[0]), self._first)
        state.last_error[0] = 0.0

    def _begin_again_if_jumped(self, state: State) -> None:
        """At the end of a stretch."""
        stimulus, load = self._stretch.jumps_at(self._after(state))
        if stimulus or load:
            self.restart(state)
        if load and self.method.history is not None:
            state.kept[0] = 0.0  # slopes from before are none of the step to come

    def _after(self, state: State) -> float:
        """The time of a state, or a little later, which makes no difference but at a corner [s]."""
        return float(state.time[0]) + TIME_ROUNDING * self._first

    def _next_stop(self, state: State, until: float) -> tuple[float, bool]:
        """Where steps have to end at the latest [s], and whether something has a corner or jumps there."""
        rounding, after = TIME_ROUNDING * self._first, self._after(state)
        if until <= after:
            raise InputError(
                f"until: {until} is not allowed; it must be later than the present time, {state.time[0]} s"
            )
        self._stretch.cover(after, state.override)
        corner = self._stretch.until
        return (until, corner <= until + rounding) if corner >= until - rounding else (corner, True)

    def _why(self, found: MarchReport, begin: float) -> str:
        """Why a step could not be made."""
        time, h = begin + found.length, found.length
        if found.status != TOO_INACCURATE:
            report = found.newton
            if found.pair >= 0:
                report = replace(report, detail=self.engine.who_blocks(found.pair))
            return self._explain(report, time, h)
        return (
            f"the error of the step to t = {time:.6g} s, tried down to {h:.3g} s, stays above the tolerance "
            f"({found.error * self.tolerance:.3g} of the longest rod, allowed {self.tolerance:.3g})"
        )
