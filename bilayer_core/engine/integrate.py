"""Steps as long as their error allows, many in one compiled function."""

from __future__ import annotations

import math

import numpy as np

from ..jit import call, kernel, piece, record_at
from ..jit.record import Flags, Indices, Vector, record
from ..kinematics.copying import copy
from ..model.records.outcome import BACKTRACKS, FACTORISATIONS, GAP, ITERATIONS, PAIR, PLACE, RESIDUAL, STATUS
from ..model.records.status import CONVERGED, JUMPED, MAX_ITERATIONS, READY, TOO_INACCURATE
from ..model.records.step import Place, StateArrays
from .actuation import Acting, look_back
from .error_norm import Yardstick
from .loop import Loop
from .modes import STEP
from .step import has_jumped
from .step_size import FAILURE_FACTOR, STRETCH, after_rejection, after_success, fit

place_at = record_at(Place)
TIME_ROUNDING = 1e-9
"""Part of a step by which one that ended where it had to was as long as planned."""


@record
class Clock:
    """Where in time a state is, and how its steps go on; arrays of `model.state.State`, shape (1,) each."""

    time: Vector
    step: Vector
    next_step: Vector
    last_error: Vector


@record
class Control:
    """What decides on lengths of steps."""

    order: int  # of the integrator
    tolerance: float  # largest local error of a step
    first: float  # length of the first step, and of the first after a jump [s]
    shortest: float  # [s]
    longest: float  # [s]


@record
class Counts:
    """What came of steps, added up until they are cleared."""

    numbers: Indices  # iterations, factorisations, backtracks, attempts refused, and those refused for their error
    lengths: Vector  # shortest, longest, and last step [s]
    residuals: Vector  # of the last step, and the largest [m/s]
    failure: Vector  # length [s], residual [m/s], error, in tolerances, and iterations of the last attempt


@record
class Adaptation:
    """All that adaptive steps read and write."""

    loop: Loop
    clock: Clock
    acting: Acting
    control: Control
    yardstick: Yardstick
    kept: StateArrays
    kept_touched: Flags
    counts: Counts


def room_for_counts() -> Counts:
    """Counts of no steps."""
    return Counts(numbers=np.zeros(5, dtype=np.int64), lengths=np.zeros(3), residuals=np.zeros(2), failure=np.zeros(4))


def clear(counts: Counts) -> None:
    """Begin again to count."""
    for name in Counts.names:
        getattr(counts, name)[:] = 0
    counts.lengths[0] = math.inf


@kernel
def _plan(control, clock, h, planned, error, iterations, shortened):
    """Write the length of the next step; one cut short by what it had to end at says little."""
    following = after_success(control.order, h, error, clock.last_error[0], iterations, shortened)
    following = min(following, control.longest)
    if h < (1.0 - TIME_ROUNDING) * planned and not shortened:
        clock.next_step[0] = max(following, min(planned, control.longest))
    else:
        clock.next_step[0], clock.last_error[0] = following, error


@kernel
def _count(counts, h, iterations, factorisations, backtracks, rejected, inaccurate, residual):
    """Take in a step, with all its attempts."""
    numbers, lengths, residuals = counts.numbers, counts.lengths, counts.residuals
    numbers[0] += iterations
    numbers[1] += factorisations
    numbers[2] += backtracks
    numbers[3] += rejected
    numbers[4] += inaccurate
    lengths[0], lengths[1], lengths[2] = min(lengths[0], h), max(lengths[1], h), h
    residuals[0], residuals[1] = residual, max(residuals[1], residual)


@kernel
def _leave(p, done, status, pair, end, gap):
    """Note how steps ended."""
    p.outcome.counts[STATUS], p.outcome.counts[PAIR], p.outcome.counts[PLACE] = status, pair, end
    p.outcome.figures[GAP] = gap
    return done


@piece(int, Adaptation, bool, int, float, bool, bool, float, float, int, float, int)
def adapt(adaptation, keeps, mode, length, changes, counts, until, due, most, newton_tolerance, max_iterations):
    """Advance a state to `until` [s], by at most so many steps, as far as each succeeds, or do once what another mode
    says.

    Each is made again, shorter, where its error exceeds the tolerance or Newton fails.

    Parameters
    ----------
    adaptation : Adaptation
    keeps : bool
        Whether the integrator of the run keeps slopes.
    mode : int
        From `modes`.
    length : float
        For other modes than steps, as for `step.make_step` [s].
    changes : bool
        Whether the method begins with slopes that the step before must have left: a jump ends the loop then.
    counts : bool
        Whether to take the steps into the tally.
    until : float
        Where the last step ends exactly, later than now and before any corner [s].
    due : float
        The first step that ends there or later is the last one, and as long as it would have been [s].
    most : int
    newton_tolerance : float
        [m/s]
    max_iterations : int

    Returns
    -------
    done : int
        Number of steps made; what they took is in `Counts`.
        In `Outcome`: why there are no more, the blocking pair of the last attempt, its configuration, and the gap.
    """
    loop, clock, control, counted = adaptation.loop, adaptation.clock, adaptation.control, adaptation.counts
    p, state, course, work, method = loop.problem, loop.state, loop.course, loop.work, loop.method
    kept, kept_touched = adaptation.kept, adaptation.kept_touched
    found, figures = p.outcome.counts, p.outcome.figures
    status, pair, end, gap = READY, -1, 1, math.inf
    for k in range(most):
        begin = clock.time[0]
        planned = clock.next_step[0] if clock.next_step[0] > 0.0 else control.first
        look_back(adaptation.acting, begin, course)
        if changes and has_jumped(keeps, p.drives, state, course.first[0], loop.ranges, planned):
            return _leave(p, k, JUMPED, -1, end, gap)
        copy(state.values, kept.values)
        copy(work.touched, kept_touched)
        h, time, error = planned, begin, math.inf
        rejected = inaccurate = iterations = factorisations = backtracks = 0
        residual = 0.0
        last_iterations = 0
        while True:
            h = fit(h, until - begin)
            time = until if h == until - begin else begin + h
            h = time - begin
            call(p.calls.drive_step, (adaptation.acting, method.nodes, begin, h, course))
            span = h if mode == STEP else length
            status = call(
                p.calls.make_step,
                (p, state, method, keeps, mode, course, 0, work, loop.before, span, newton_tolerance, max_iterations),
            )
            pair, end, last_iterations = found[PAIR], found[PLACE], found[ITERATIONS]
            factors, halvings = found[FACTORISATIONS], found[BACKTRACKS]
            residual, gap = figures[RESIDUAL], figures[GAP]
            if mode != STEP:
                _count(counted, span, last_iterations, factors, halvings, 0, 0, residual)
                return _leave(p, k, status, pair, end, gap)
            if status != CONVERGED and status < MAX_ITERATIONS:
                return _leave(p, k, status, pair, end, gap)
            iterations += last_iterations
            factorisations += factors
            backtracks += halvings
            error = math.inf
            if status == CONVERGED:
                defect = call(p.calls.deviation, (adaptation.yardstick, kept, state, h))
                error = method.estimate * defect / control.tolerance
                if error <= 1.0:
                    break
                copy(kept.values, state.values)
                copy(kept_touched, work.touched)
                status = TOO_INACCURATE
            if h <= STRETCH * control.shortest:
                counted.failure[0], counted.failure[1], counted.failure[2] = h, residual, error
                counted.failure[3] = last_iterations
                return _leave(p, k, status, pair, end, gap)
            rejected += 1
            if status == TOO_INACCURATE:
                inaccurate += 1
                h = after_rejection(control.order, h, error)
            else:
                h = FAILURE_FACTOR * h
            h = max(h, control.shortest)
        _count(counted, h, iterations, factorisations, backtracks, rejected, inaccurate, residual)
        _plan(control, clock, h, planned, error, last_iterations / method.couplings.shape[1], rejected > 0)
        clock.time[0] = time
        clock.step[0] += 1.0
        if counts:
            call(p.calls.count_end, (p, state, place_at(work.places[end]), work.stage, gap, time, loop.tally))
        if time == until or time >= due:
            return _leave(p, k + 1, CONVERGED, -1, end, gap)
    return _leave(p, most, status, pair, end, gap)
