"""Steps as long as their error allows.

A step is attempted, its error estimated (`error_estimate`), and it is made again, shorter, where that exceeds the
tolerance or Newton fails (`step_control`). It ends exactly where a stimulus, a load or a prescribed path has a corner
or jumps (`breakpoints`) and where the caller asks; after a jump steps begin again with the first step's length. All
that this remembers is in the state.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import InputError, SimulationError
from ..model.model import Model
from ..model.state import State
from .breakpoints import Breakpoints
from .error_estimate import ErrorEstimate
from .method import Method
from .step_control import STRETCH, StepControl
from .stepper import Stepper, StepReport

Array = np.ndarray

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
    newton_tolerance, max_iterations, max_halvings
        As for `Stepper`; the shortest step is ``first/2**max_halvings``.
    tolerance : float
        Largest local error of a step: displacement over the length of the longest rod (`ErrorEstimate`).
    largest : float
        Length of the longest step [s].

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
        max_halvings: int,
        tolerance: float,
        largest: float,
    ):
        if method.estimate is None:
            raise InputError(
                f"tolerance: {tolerance:g} is not allowed with the integrator {method.name}, which has no estimate of "
                "its error; leave it out, or take another integrator"
            )
        super().__init__(model, method, first, newton_tolerance, max_iterations, max_halvings)
        self.tolerance = tolerance
        self._first = min(first, largest)
        self._shortest = self._first / 2**max_halvings
        self._control = StepControl(method.order, largest)
        self._estimate = ErrorEstimate(model)
        self._breakpoints = Breakpoints(model.scene)
        self._kept: tuple[State, Array] | None = None

    def compile(self, state: State) -> None:
        """Make a step for its kernels, estimate its error and count it; `state` stays as it is."""
        super().compile(state)
        self._estimate.deviation(state, state, self._first)
        highest = float(self.engine.figures[0])
        self.engine.count_in(state, math.inf)
        self.engine.start_over(highest)

    def advance(self, state: State, until: float = math.inf) -> StepReport:
        """One step, in place, that ends at `until` [s] at the latest.

        Raises
        ------
        SimulationError
            If the shortest step does not converge or is not accurate enough; nothing is changed then.
        """
        begin = float(state.time[0])
        stop, breaks = self._next_stop(state, until)
        planned = float(state.next_step[0]) or self._first
        kept, touched = self._keep(state)
        if self.ledger is not None:
            self.ledger.mark()
        h, rejected, inaccurate, iterations, factorisations = planned, 0, 0, 0, 0
        while True:
            h = self._control.fit(h, stop - begin)
            time = stop if h == stop - begin else begin + h
            h = time - begin
            report = self._attempt(state, h, time)
            iterations += report.iterations
            factorisations += report.factorisations
            error = math.inf
            if report.converged:
                error = self.used.estimate * self._estimate.deviation(kept, state, h) / self.tolerance
                if error <= 1.0:
                    break
                state.take(kept)
                self._touched[:] = touched
                if self.ledger is not None:
                    self.ledger.roll_back()
            if h <= STRETCH * self._shortest:
                why = self._explain(report, time, h) if not report.converged else self._too_inaccurate(error, time, h)
                raise SimulationError(why, begin)
            rejected += 1
            inaccurate += report.converged
            shorter = self._control.after_rejection(h, error) if report.converged else self._control.after_failure(h)
            h = max(shorter, self._shortest)
        self._plan(state, kept, h, planned, error, report.iterations / len(self.used.nodes), rejected > 0)
        state.time[0] = time
        state.step += 1.0
        if breaks and time == stop and self._jumps(state, time, h):
            self.restart(state)
        return StepReport(time, h, 1, rejected, iterations, factorisations, report.residual, inaccurate)

    def _keep(self, state: State) -> tuple[State, Array]:
        """A copy of a state, and of what touches there, until the next one."""
        if self._kept is None:
            self._kept = state.copy(), self._touched.copy()
        kept, touched = self._kept
        kept.take(state)
        touched[:] = self._touched
        return kept, touched

    def march(self, state: State, steps: int) -> None:
        """None: how long a step is depends on the one before."""

    def restart(self, state: State) -> None:
        """Begin again with short steps: something has jumped."""
        state.next_step[0] = min(float(state.next_step[0]), self._first)
        state.last_error[0] = 0.0

    def _plan(
        self, state: State, kept: State, h: float, planned: float, error: float, iterations: float, shortened: bool
    ) -> None:
        """Write the length of the next step into the state; one cut short by what it had to end at says little."""
        following = self._control.after_success(h, error, float(kept.last_error[0]), iterations, shortened)
        if h < (1.0 - TIME_ROUNDING) * planned and not shortened:
            state.next_step[0] = max(following, min(planned, self._control.largest))
        else:
            state.next_step[0], state.last_error[0] = following, error

    def _next_stop(self, state: State, until: float) -> tuple[float, bool]:
        """Where the step has to end at the latest [s], and whether something has a corner or jumps there."""
        rounding = TIME_ROUNDING * self._first
        time = float(state.time[0])
        if until <= time + rounding:
            raise InputError(f"until: {until} is not allowed; it must be later than the present time, {time} s")
        corner = self._breakpoints.after(time + rounding, state.override)
        return (until, corner <= until + rounding) if corner >= until - rounding else (corner, True)

    def _jumps(self, state: State, time: float, h: float) -> bool:
        """Whether a stimulus or a load jumps at the end of a step of length `h` [s]."""
        return self.surroundings.stimuli_jump(state, time, h) or self.surroundings.loads_jump(time, h)

    def _too_inaccurate(self, error: float, time: float, h: float) -> str:
        allowed = self.tolerance
        return (
            f"the error of the step to t = {time:.6g} s, tried down to {h:.3g} s, stays above the tolerance "
            f"({error * allowed:.3g} of the longest rod, allowed {allowed:.3g})"
        )
