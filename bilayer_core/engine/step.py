"""One step with all its stages, and what is asked of a state at rest."""

from __future__ import annotations

import math

from bilayer_core.contact.crossing import crossing, note_start
from bilayer_core.engine.configuration import take_state
from bilayer_core.engine.energy_account import begin_step_account, close_step_account
from bilayer_core.engine.laws import grow, lagged, write_strains_of_laws
from bilayer_core.engine.light_over_step import begin_light, end_light, see_light
from bilayer_core.engine.newton import first_guess_of, minimise_potential
from bilayer_core.engine.potential import end_forces, start_stage
from bilayer_core.engine.powers import add_powers
from bilayer_core.engine.request_modes import (
    COUNT,
    EVALUATE_STATE,
    EVALUATION_TIME,
    MINIMUM,
    NEGATIVE,
    SETTLE,
    VALUE,
    WITHOUT_INERTIA,
)
from bilayer_core.engine.stages import (
    add_history_to_origin,
    predict_end,
    predict_stage,
    set_origin,
    stand_still_stage,
    start_step_point,
)
from bilayer_core.engine.step_ends import (
    distance,
    end_stage,
    keep_stage_derivatives,
    write_end,
    write_shape,
    write_twist,
)
from bilayer_core.engine.varied_diffusion import diffuse
from bilayer_core.jit import kernel, piece, record_at
from bilayer_core.kinematics.copying import copy
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import BEYOND, BLOCKED, COLLAPSED, CONVERGED, CROSSED, MAX_ITERATIONS, READY
from bilayer_core.model.records.step import (
    AT_REST,
    LOOKED_AT,
    Configuration,
    Method,
    StageInputs,
    StateArrays,
    Work,
)

configuration_at = record_at(Configuration)
LEAST_LENGTH = 0.01
"""Part of its natural length that an edge must have: one that has hardly any turns by what Newton's method leaves, and
with it the faces of its rod.
"""


@kernel
def _compare_touched(sums, touched):
    """Note which contact points something pushes; whether they are those of before."""
    same = True
    for i in range(touched.shape[0]):
        pushed = 0.0
        if sums.contact_point[i, 0] != 0.0 or sums.contact_point[i, 1] != 0.0 or sums.contact_point[i, 2] != 0.0:
            pushed = 1.0
        same &= pushed == touched[i]
        touched[i] = pushed
    return same


@piece(int, Problem, StateArrays, StageInputs, int, Work)
def drive_stage(p, state, inputs, n, work):
    """Write the drive from outside at stage n of a step to `work`: strains of laws, rest strains and load factors."""
    drives, stage, transduction, strain = p.drives, work.stage, work.transduction, work.strain
    if p.light.exists:
        see_light(p.light, state, inputs.elapsed[n])
    for f in range(drives.field_channel.shape[0]):
        channel = drives.field_channel[f]
        first, last = inputs.first[channel], inputs.stimulus[n, channel]
        if p.light.exists:
            first, last = first * p.light.seen[f, 0], last * p.light.seen[f, 1]
        if p.varied_fields.exists and p.varied_fields.number[f] >= 0:
            diffuse(p.varied_fields, drives, f, state.transduction, first, last, inputs.elapsed[n], transduction)
            continue
        for m in range(drives.field_first[f], drives.field_first[f + 1]):
            lags = drives.mode_rising[m], drives.mode_falling[m]
            transduction[m] = lagged(state.transduction[m], first, last, lags[0], lags[1], inputs.elapsed[n])
    write_strains_of_laws(drives, transduction, strain)
    grow(drives, strain, stage.rest_edge, stage.rest_joint)
    for i in range(stage.load_factor.shape[0]):
        stage.load_factor[i] = inputs.load_factor[n, i]
    return READY


@piece(int, Problem, StateArrays, Work)
def write_rest_strains(p, state, work):
    """Write the eigenstrain of laws and the rest strains of a state to `work`, from what its materials have reached."""
    write_strains_of_laws(p.drives, state.transduction, work.strain)
    grow(p.drives, work.strain, work.stage.rest_edge, work.stage.rest_joint)
    return READY


@kernel
def _clear(outcome):
    """Begin to count what Newton's method needs."""
    outcome.iterations = outcome.factorisations = outcome.settlings = outcome.regularised = 0
    outcome.residual, outcome.gap = 0.0, math.inf


@kernel
def _solve(p, work, at, scratch, tolerance, max_iterations, wanted):
    """Let Newton's method do what is `wanted` from configuration number `at` on; its status, and the numbers of the
    configuration where it ended and of the other one. What it needed is added to `Outcome`.
    """
    outcome = p.outcome
    before = outcome.iterations, outcome.factorisations, outcome.settlings
    first, second = configuration_at(work.configurations[at]), configuration_at(work.configurations[scratch])
    arguments = p, first, second, work.stage, tolerance, max_iterations, wanted
    status = minimise_potential(*arguments)
    outcome.iterations += before[0]
    outcome.factorisations += before[1]
    outcome.settlings += before[2]
    if outcome.swapped:
        return status, scratch, at
    return status, at, scratch


@kernel
def _leave(p, status, pair, end):
    """Note the near pair that blocks motion, −1 without one, and the number of the last configuration."""
    p.outcome.pair, p.outcome.configuration = pair, end
    return status


@piece(int, Problem, StateArrays, StateArrays, Method, bool, StageInputs, Work, float, float, int)
def make_step(p, state, start_state, method, with_history, inputs, work, h, tolerance, max_iterations):
    """Advance a state by a step of length h [s]; it changes only if every stage converged and its end can be reached.

    Where a step ends beyond its last stage (`Method.couplings`), it moves there, and evaluates the potential there.

    Parameters
    ----------
    p : Problem
    state : StateArrays
    start_state : StateArrays
        The same.
    method : Method
        For this step.
    with_history : bool
        Whether the integrator of the run keeps stage derivatives.
    inputs : StageInputs
    work : Work
    h : float
    tolerance : float
        [m/s]
    max_iterations : int

    Returns
    -------
    status : int
        In `Outcome`: the blocking pair, the collapsed edge or the edge that crosses a surface, −1 if none, the number
        in `work.configurations` of the last configuration, numbers of iterations, factorisations and settlings, the
        largest residual and the gap.
    """
    stage, previous, outcome = work.stage, work.first, p.outcome
    s, e, t = 0, 1, 2
    ends, stages = method.couplings.shape
    _clear(p.outcome)
    take_state(p, state, configuration_at(work.configurations[s]))
    if p.surfaces.exists:
        note_start(p.surfaces, configuration_at(work.configurations[s]))
    start_step_point(p, state, configuration_at(work.configurations[s]), work.first)
    begin_step_account(p, state, inputs, work, method.works[0] * h)
    if p.light.exists:
        begin_light(p, state)
    stage.length, stage.momentum_length = method.diagonal * h, method.momentum_diagonal * h
    work.start_angle[:] = 0.0
    worst = 0.0
    for n in range(stages):
        start, guess = configuration_at(work.configurations[s]), configuration_at(work.configurations[e])
        set_origin(work, method, n)
        drive_stage(p, state, inputs, n, work)
        if with_history and method.history:
            add_history_to_origin(p, state, work, method, n, h)
        predict_stage(p, state, work, inputs, n, previous, start)
        status = start_stage(p, start, stage)
        if status != READY:
            return _leave(p, status, -1, e)
        status = first_guess_of(p, start, inputs.position[n], inputs.rotation[n], stage, guess, False)
        if status != READY:
            outcome.residual = math.inf
            return _leave(p, status, p.outcome.pair, e)
        status, e, t = _solve(p, work, e, t, tolerance, max_iterations, MINIMUM)
        if status != CONVERGED:
            return _leave(p, status, -1, e)
        worst = max(worst, outcome.residual)
        if work.spread.shape[1] > 0:
            _keep_spread(p.sliding.spread, work.spread, n)
        solved = configuration_at(work.configurations[e])
        end_stage(p, state, work, inputs, n, solved)
        add_powers(p, work, inputs, n, method.works[1 + n] * h, solved)
        if n + 1 < ends:
            previous = work.end
            copy(work.end.angle, work.start_angle)
            s, e = e, s
            configuration_at(work.configurations[s]).total_angle[:] = 0.0
    if ends > stages:
        status, e = _end_beyond(p, state, start_state, method, inputs, work, s, e)
        if status != READY:
            outcome.residual = math.inf
            return _leave(p, status, -1, e)
    else:
        end = configuration_at(work.configurations[e])
        write_end(p, state, work.end, end, inputs, stages - 1)
        if with_history:  # for the step after, which can take them if nothing touches anew
            keep_stage_derivatives(state, work.origin, work.end, stage.momentum_length, method.carry)
            if not method.history:  # a first step may begin with velocities, but with no rates of strains
                _forget_rates(p.raised, state.strain_acceleration)
            state.has_history[0] = _compare_touched(p.sums, state.touched)
    copy(work.transduction, state.transduction)
    edge = _collapsed(p.strands, configuration_at(work.configurations[e]))
    if edge >= 0:
        copy(start_state.values, state.values)
        outcome.residual = math.inf
        return _leave(p, COLLAPSED, edge, e)
    if p.surfaces.exists:
        crossed = crossing(p.strands, p.surfaces, configuration_at(work.configurations[e]))
        if crossed >= 0:
            copy(start_state.values, state.values)
            outcome.residual = math.inf
            return _leave(p, CROSSED, crossed, e)
    status = end_forces(p, configuration_at(work.configurations[e]), stage)
    copy(p.memory, state.memory)
    if status != READY:
        copy(start_state.values, state.values)
        return _leave(p, status, -1, e)
    outcome.residual, outcome.light_error = worst, 0.0
    if p.light.exists:
        outcome.light_error = end_light(p, state, inputs, ends - 1, h)
    last = configuration_at(work.configurations[e])
    p.outcome.gains = close_step_account(p, state, work, h, ends > stages, last)
    return _leave(p, CONVERGED, -1, e)


@kernel
def _keep_spread(spread, out, n):
    """Note which contacts friction has spread in stage n: what runs are differentiated through needs to know."""
    nodes = spread.shape[1]
    for s in range(spread.shape[0]):
        for i in range(nodes):
            out[n, s * nodes + i] = spread[s, i]


@kernel
def _forget_rates(raised, acceleration):
    """Clear those of strains, without kept directors, which are positions."""
    for k in range(raised.first if raised.exists else acceleration.shape[0]):
        acceleration[k] = 0.0


@kernel
def _collapsed(strands, at):
    """Return the first edge that has less than `LEAST_LENGTH` of its length left; −1 if there is none."""
    for k in range(strands.edge_count):
        if not at.length[k] >= LEAST_LENGTH * strands.rest_length[k]:
            return k
    return -1


@piece(int, Problem, StateArrays, Method, StageInputs, Work, int, Configuration, Configuration)
def move_beyond(p, state, method, inputs, work, n, start, end):
    """Move from the end of the last stage, the configuration `start`, to the end of a step, its point n; returns a
    status.
    """
    set_origin(work, method, n)
    drive_stage(p, state, inputs, n, work)
    predict_end(p, state, work, inputs, n, work.end, start)
    return first_guess_of(p, start, inputs.position[n], inputs.rotation[n], work.stage, end, True)


@kernel
def _end_beyond(p, state, start_state, method, inputs, work, s, e):
    """Move from the last stage, configuration number `s`, to the end of a step, and evaluate the potential there, in
    number `e`; `BEYOND` if a surface is in the way, or if the potential is not finite there.
    """
    n, stage = method.couplings.shape[1], work.stage
    start, end = configuration_at(work.configurations[s]), configuration_at(work.configurations[e])
    status = move_beyond(p, state, method, inputs, work, n, start, end)
    if status != READY:
        return BEYOND if status == BLOCKED else status, e
    write_end(p, state, work.origin, end, inputs, n)
    end.total_angle[:] = 0.0
    stage.length = stage.momentum_length = EVALUATION_TIME
    status, e = _evaluate_at_rest(p, state, work, e, s, False)
    finite = 0.0
    for k in range(p.sums.energy.shape[0]):
        finite += p.sums.energy[k]
    if status != CONVERGED or not math.isfinite(finite):
        copy(start_state.values, state.values)
        return BEYOND if status == CONVERGED else status, e
    write_twist(configuration_at(work.configurations[e]), state)
    return READY, e


@kernel
def _evaluate_at_rest(p, state, work, at, scratch, counts):
    """Evaluate the potential at configuration number `at`, where inertia asks for nothing, or if it `counts`, find how
    many eigenvalues of its Hessian are negative; the status, and the number of the configuration.
    """
    here = configuration_at(work.configurations[at])
    stand_still_stage(p, state, here, counts, work.stage)
    if counts:
        work.stage.still[0] = AT_REST if work.stage.length >= WITHOUT_INERTIA else LOOKED_AT
    status = start_stage(p, here, work.stage)
    if status != READY:
        return status, at
    status, at, _ = _solve(p, work, at, scratch, 0.0, 1, NEGATIVE if counts else VALUE)
    return status, at


@piece(int, Problem, StateArrays, Work, int, float, float, int)
def treat_state(p, state, work, mode, length, tolerance, max_iterations):
    """Evaluate the potential at a state as it stands, count its unstable directions, or make a round of statics.

    Rest strains and factors of loads in `work.stage` are those to use.

    Parameters
    ----------
    p : Problem
    state : StateArrays
        In the mode `SETTLE` it takes the shape found, if one was, or if the potential has at least fallen as far as the
        iterations went.
    work : Work
    mode : int
        From `modes`.
    length : float
        In the mode `SETTLE` that over which inertia acts [s]; in the mode `COUNT` the time in which a disturbance that
        counts grows e-fold, or 0 for all that grow at rest.
    tolerance : float
        In the mode `SETTLE` [m/s].
    max_iterations : int
        Likewise.

    Returns
    -------
    status : int
        `Outcome` is as for `make_step`.
    """
    s, e, t = 0, 1, 2
    start, guess, stage = configuration_at(work.configurations[s]), configuration_at(work.configurations[e]), work.stage
    _clear(p.outcome)
    take_state(p, state, start)
    if mode != SETTLE:
        if mode == EVALUATE_STATE:
            length = EVALUATION_TIME
        elif length == 0.0:
            length = WITHOUT_INERTIA
        stage.length = stage.momentum_length = length
        status, e = _evaluate_at_rest(p, state, work, s, t, mode == COUNT)
        return _leave(p, status, -1, e)
    if p.surfaces.exists:
        note_start(p.surfaces, start)
    stage.length = stage.momentum_length = length
    stand_still_stage(p, state, start, True, stage)
    stage.still[0] = AT_REST
    status = start_stage(p, start, stage)
    if status != READY:
        return _leave(p, status, -1, e)
    status = first_guess_of(p, start, state.body_position, state.body_rotation, stage, guess, False)
    if status != READY:
        p.outcome.residual = math.inf
        return _leave(p, status, p.outcome.pair, e)
    status, e, t = _solve(p, work, e, t, tolerance, max_iterations, MINIMUM)
    if status == CONVERGED or status == MAX_ITERATIONS:
        end = configuration_at(work.configurations[e])
        crossed = crossing(p.strands, p.surfaces, end) if p.surfaces.exists else -1
        if crossed >= 0:
            p.outcome.residual = math.inf
            return _leave(p, CROSSED, crossed, e)
        work.moved[0] = distance(p, start, end)
        write_shape(p, end, state)
    return _leave(p, status, -1, e)
