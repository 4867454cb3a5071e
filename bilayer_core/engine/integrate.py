"""Time integration: fixed or adaptive steps, many in one compiled function.

An adaptive step is made again, shorter, where its error exceeds the tolerance or Newton's method fails. It ends exactly
at corners and jumps of what acts from outside; after a jump steps begin again with the first step's length. No step
ends because somebody looks: frames within one are interpolated (`simulation.step_span`). A fixed step is made in as few
equal parts as Newton's method needs, and in two where something jumps within it. All that this remembers is in the
state.

A step may pause, for the interpreter to ask whether to go on: before an attempt at it or, where that takes very long,
within one, which is then made anew. What the attempts before it have shown is in `Attempt`.
"""

from __future__ import annotations

import math

from bilayer_core.engine.actuation import (
    Actuation,
    corner_after,
    drive_step,
    jumps_at,
    stimulus_has_jumped,
    take_first_stimuli,
)
from bilayer_core.engine.energy_account import LARGEST, NONE, SOME
from bilayer_core.engine.error_norm import ErrorNorm, fastest, step_defect
from bilayer_core.engine.run_extrema import count_end
from bilayer_core.engine.step import make_step
from bilayer_core.engine.step_size import (
    FAILURE_FACTOR,
    GROWTH_LIMIT,
    NUMBER_ROUNDING,
    after_rejection,
    after_success,
    fit,
    reach,
    tolerance_in,
)
from bilayer_core.jit import kernel, piece, record_at
from bilayer_core.jit.record import CHANGES, Vector, record
from bilayer_core.kinematics.copying import copy
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import (
    CONVERGED,
    GAINS_ENERGY,
    INPUTS_END,
    MAX_ITERATIONS,
    PAUSED,
    READY,
    TOO_INACCURATE,
)
from bilayer_core.model.records.step import Configuration, Method, RunExtrema, StageInputs, StateArrays, Work

configuration_at = record_at(Configuration)
TIME_ROUNDING = 1e-9
"""Part of a step by which two times are the same."""
CONTACT_SHARE = 2.0
"""Part of the energy of the run by which the energy of contacts may err in a step, over the tolerance: by default an
impact ends with its speed right to 1 %.
"""


@record
class Clock:
    """Where in time a state is, and how its steps go on; arrays of `model.state.State`, shape (1,) each."""

    time: Vector
    step: Vector
    next_step: Vector
    last_error: Vector


@record
class StepControl:
    """Settings that decide on the lengths of steps."""

    dt: float  # length of fixed steps; 0 for adaptive ones [s]
    order: int  # of the integrator
    tolerance: float  # largest local error of an adaptive step
    first: float  # length of the first step, and of the first after a jump [s]
    shortest: float  # [s]
    least_travel: float  # of the fastest point in the shortest step, where that is shorter so [m]
    longest: float  # [s]
    same: float  # two times that differ by less are the same [s]


@record
class Counts:
    """Counts and figures of steps, added up until they are cleared; see `engine.step_outcome.IntegrationReport`."""

    iterations: int = CHANGES
    factorisations: int = CHANGES
    settlings: int = CHANGES
    rejected: int = CHANGES
    inaccurate: int = CHANGES
    gaining: int = CHANGES
    unresolved: int = CHANGES
    restarts: int = CHANGES
    regularised: int = CHANGES
    shortest: float = CHANGES
    longest: float = CHANGES
    length: float = CHANGES
    residual: float = CHANGES
    largest_residual: float = CHANGES


@record
class Failure:
    """Figures of the last attempt at a step that failed; see `engine.step_outcome.IntegrationReport`."""

    length: float = CHANGES
    residual: float = CHANGES
    error: float = CHANGES
    iterations: int = CHANGES


@record
class Attempt:
    """Attempts at a step that paused which were rejected, if any were, and what is next."""

    rejected: int = CHANGES
    length: float = CHANGES  # of the next one [s]
    shortest: float = CHANGES  # [s]
    starts: bool = CHANGES  # whether the starter makes it


@record
class Integration:
    """All that steps read and write."""

    problem: Problem
    state: StateArrays
    clock: Clock
    method: Method
    starter: Method  # stands in for a method with history where that cannot start: there it has none of its own
    inputs: StageInputs
    actuation: Actuation
    control: StepControl
    error_norm: ErrorNorm
    work: Work
    start_state: StateArrays  # at the start of the step
    extrema: RunExtrema
    counts: Counts
    failure: Failure
    attempt: Attempt


@kernel
def _end_of_fixed(control, clock):
    """Return the end of the present fixed step, of which parts may be done: on the grid of multiples of dt if its start
    is.
    """
    begin, end = clock.time[0], (clock.step[0] + 1.0) * control.dt
    on_grid = end - control.dt <= begin + control.same and begin < end - control.same
    return end if on_grid else begin + control.dt


@kernel
def _jump_before(run, end):
    """Return the next jump of an outside influence if it is before the end of a fixed step, otherwise that end.

    The schedules are known up to there. The work of a jump within a step would depend on where stages happen to lie
    (`engine.energy_account`).
    """
    same, time = run.control.same, run.clock.time[0]
    while True:
        time = corner_after(run.actuation, time, same)
        if time >= end - same:
            return end
        if jumps_at(run.actuation, time, same):
            return time


@kernel
def _end_of_adaptive(run, until):
    """Return the next time at which a step has to end: a corner, or `until`."""
    control = run.control
    corner = corner_after(run.actuation, run.clock.time[0], control.same)
    return corner if corner < until - control.same else until


@kernel
def _planned(control, clock):
    """Return the length that the next step is to have, apart from what it has to end at [s]."""
    return min(clock.next_step[0], control.longest) if clock.next_step[0] > 0.0 else control.first


@kernel
def _begin_again_after_jump(run):
    """Begin again where something jumps: with the first step's length, without a history that a load's jump ends."""
    control, clock = run.control, run.clock
    jumped = jumps_at(run.actuation, clock.time[0], control.same)
    if jumped > 0:
        clock.next_step[0], clock.last_error[0] = min(clock.next_step[0], control.first), 0.0
    if jumped > 1 and run.method.history:
        run.state.has_history[0] = 0.0


@kernel
def _has_to_start(run, h):
    """Return whether the method needs stage derivatives of the step before, and there are none that hold."""
    if not run.method.history:
        return False
    no_history, drives = run.state.has_history[0] == 0.0, run.problem.drives
    return no_history or stimulus_has_jumped(drives, run.state, run.inputs.first, run.actuation.ranges, h)


@kernel
def _shortest(run, begin):
    """Return the length of the shortest step from `begin` [s], the less the faster something was or the last attempt
    made it.
    """
    control, norm = run.control, run.error_norm
    speed = max(fastest(norm, run.start_state), fastest(norm, run.state))
    if control.least_travel >= control.shortest * speed:
        return control.shortest
    resolved = max(control.same, NUMBER_ROUNDING * abs(begin))
    return min(control.shortest, max(control.least_travel / speed, resolved))


@kernel
def _plan(control, clock, h, planned, error, iterations, shortened):
    """Write the length of the next step; one cut short by what it had to end at says little."""
    following = 2.0 * h
    if control.dt == 0.0:
        following = after_success(control.order, h, error, clock.last_error[0], iterations, shortened)
    following = min(following, control.longest)
    if h < (1.0 - TIME_ROUNDING) * planned and not shortened:
        clock.next_step[0] = max(following, min(planned, control.longest))
    else:
        clock.next_step[0], clock.last_error[0] = following, error


@kernel
def _leave(run, done, status, pair, end, gap):
    """Note how steps ended."""
    outcome = run.problem.outcome
    outcome.status, outcome.pair, outcome.configuration = status, pair, end
    outcome.gap = gap
    return done


@kernel
def _pause(run, done, status, pair, end, gap, rejected, length, shortest, starts):
    """Note how far a step came before which something else is to be done."""
    attempt = run.attempt
    attempt.rejected, attempt.length, attempt.shortest, attempt.starts = rejected, length, shortest, starts
    return _leave(run, done, status, pair, end, gap)


@piece(int, Integration, float, float, int, int, int, bool, float, int)
def integrate(run, until, due, most, passes, patience, goes_on, newton_tolerance, max_iterations):
    """Advance a state in time, by at most so many steps, as far as each succeeds, and take them into the extrema.

    Parameters
    ----------
    run : Integration
    until : float
        Where the last adaptive step ends exactly, later than now [s]; fixed ones end within half a step of it.
    due : float
        The last step is the first that ends there or later, or one after which the next might; each is as long as it
        would have been [s].
    most : int
        A part of a fixed step counts as one.
    passes, patience : int
        See `Outcome`.
    goes_on : bool
        Whether a step that paused goes on.
    newton_tolerance : float
        In steps that are not long [m/s].
    max_iterations : int

    Returns
    -------
    done : int
        Number of steps made; what they took is in `Counts`.
        In `Outcome`: why there are no more, the blocking pair of the last attempt, its configuration, and the gap.
        `INPUTS_END`: the actuation is to be continued from the present time. `PAUSED`: all `passes` are made.
    """
    p, state, work, clock, control, counts = run.problem, run.state, run.work, run.clock, run.control, run.counts
    attempt = run.attempt
    start_state, inputs, outcome, fixed = run.start_state, run.inputs, p.outcome, run.control.dt > 0.0
    status, pair, end, gap = READY, -1, 1, math.inf
    outcome.passes, outcome.patience = passes, patience
    if not goes_on:
        attempt.rejected = 0
    for k in range(most):
        begin = clock.time[0]
        grid = _end_of_fixed(control, clock) if fixed else math.inf
        goal = grid if fixed else _end_of_adaptive(run, until)
        if run.actuation.horizon[0] < goal - control.same or run.actuation.horizon[0] <= begin + control.same:
            return _leave(run, k, INPUTS_END, -1, end, gap)
        if fixed:
            goal = _jump_before(run, grid)
        _begin_again_after_jump(run)
        planned = _planned(control, clock)
        take_first_stimuli(run.actuation, begin, control.same, inputs)
        method = run.method
        starts = _has_to_start(run, planned)
        copy(state.values, start_state.values)
        h, time, error, shortest = planned, begin, math.inf, control.shortest
        iterations, residual, rejected = 0, 0.0, attempt.rejected
        if rejected > 0:  # it goes on with a step that paused
            h, shortest, starts, attempt.rejected = attempt.length, attempt.shortest, attempt.starts, 0
        if starts:
            method = run.starter
        while True:
            wanted = h
            if outcome.passes <= 0:
                return _pause(run, k, PAUSED, -1, end, gap, rejected, wanted, shortest, starts)
            h = fit(h, goal - begin)
            time = goal if h == goal - begin else begin + h
            h = time - begin
            drive_step(run.actuation, method.nodes, begin, h, control.same, inputs)
            most_left = tolerance_in(h, newton_tolerance)
            status = make_step(
                p, state, start_state, method, run.method.history, inputs, work, h, most_left, max_iterations
            )
            pair, end, iterations = outcome.pair, outcome.configuration, outcome.iterations
            residual, gap = outcome.residual, outcome.gap
            if status != CONVERGED and status < MAX_ITERATIONS:
                return _pause(run, k, status, pair, end, gap, rejected, wanted, shortest, starts)
            counts.iterations += iterations
            counts.factorisations += outcome.factorisations
            counts.settlings += outcome.settlings
            counts.regularised += outcome.regularised
            error, of_contact = math.inf, 0.0
            if status == CONVERGED:
                error = 0.0
                if not fixed:
                    defect = step_defect(run.error_norm, start_state, state, h)
                    error = max(method.estimate * defect, outcome.light_error) / control.tolerance
                    of_contact = outcome.contact_error / (CONTACT_SHARE * state.account[LARGEST] * control.tolerance)
                gains = outcome.gains
                if gains == SOME and h <= GROWTH_LIMIT * shortest:
                    shortest = _shortest(run, begin)
                    gains = NONE if h <= GROWTH_LIMIT * shortest else SOME  # rounding, or what Newton left
                if error <= 1.0 and gains == NONE and (of_contact <= 1.0 or h <= GROWTH_LIMIT * control.shortest):
                    counts.unresolved += of_contact > 1.0
                    break
                status = GAINS_ENERGY if error <= 1.0 and gains != NONE else TOO_INACCURATE
                error = outcome.gained if status == GAINS_ENERGY else max(error, of_contact)
            if h <= GROWTH_LIMIT * shortest:
                shortest = _shortest(run, begin)
            if status >= TOO_INACCURATE:
                copy(start_state.values, state.values)
            if h <= GROWTH_LIMIT * shortest:
                failure = run.failure
                failure.length, failure.residual, failure.error, failure.iterations = h, residual, error, iterations
                return _leave(run, k, status, pair, end, gap)
            rejected += 1
            counts.rejected += 1
            if status == GAINS_ENERGY:
                counts.gaining += 1
                if run.method.history:  # what it remembers does not get better with shorter steps
                    method, starts = run.starter, True
            if status == TOO_INACCURATE:
                counts.inaccurate += 1
                h = after_rejection(control.order, h, error)
            else:
                h = FAILURE_FACTOR * h
            h = max(h, shortest)
        counts.restarts += starts
        counts.shortest, counts.longest, counts.length = min(counts.shortest, h), max(counts.longest, h), h
        counts.residual, counts.largest_residual = residual, max(counts.largest_residual, residual)
        _plan(control, clock, h, planned, error, iterations / method.couplings.shape[1], rejected > 0)
        for c in range(inputs.applied.shape[0]):
            inputs.applied[c] = inputs.stimulus[method.nodes.shape[0] - 1, c]
        clock.time[0] = time
        whole = not fixed or time == grid
        clock.step[0] += whole
        count_end(p, state, configuration_at(work.configurations[end]), work, gap, time, run.extrema)
        last = time == until or fixed and whole and time > until - 0.5 * control.dt
        if last or time + reach(_planned(control, clock)) >= due:
            return _leave(run, k + 1, CONVERGED, -1, end, gap)
    return _leave(run, most, status, pair, end, gap)
