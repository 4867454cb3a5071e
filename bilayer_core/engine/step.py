"""One step, all its stages, in one compiled function."""

from __future__ import annotations

import math

from ..jit import call, kernel, piece, record_at
from ..kinematics.copying import copy
from ..model.records.outcome import (
    BACKTRACKS,
    CONFIGURATION,
    FACTORISATIONS,
    GAP,
    ITERATIONS,
    PAIR,
    RESIDUAL,
    SWAPPED,
)
from ..model.records.problem import Problem
from ..model.records.status import BEYOND, BLOCKED, CONVERGED, MAX_ITERATIONS, READY
from ..model.records.step import Configuration, Method, StageInputs, StateArrays, Work
from ..scene.transduction import eigenstrain_of, lagged
from .ends import write_twist
from .modes import COUNT, EVALUATE_STATE, EVALUATION_TIME, MINIMUM, NEGATIVE, SETTLE, STEP, VALUE, WITHOUT_INERTIA

configuration_at = record_at(Configuration)


@kernel
def grow(drives, law_strain, rest_edge_out, rest_joint_out):
    """Rest strains of edges and joints from the eigenstrain of laws."""
    copy(drives.rest_strain, rest_edge_out)
    for k in range(drives.driven_edge.shape[0]):
        rest_edge_out[drives.driven_edge[k]] += drives.driven_weight[k] * law_strain[drives.driven_law[k]]
    copy(drives.joint_rest, rest_joint_out)
    for k in range(drives.driven_joint.shape[0]):
        bent = drives.driven_joint_weight[k] * law_strain[drives.driven_joint_law[k]]
        rest_joint_out[drives.driven_joint[k], 0] += bent


@kernel
def _compare_touched(sums, touched):
    """Note which contact points something pushes; whether they are those of before."""
    same = True
    for i in range(touched.shape[0]):
        pushed = sums.contact_point[i, 0] != 0.0 or sums.contact_point[i, 1] != 0.0 or sums.contact_point[i, 2] != 0.0
        same &= pushed == touched[i]
        touched[i] = pushed
    return same


@piece(int, Problem, StateArrays, StageInputs, int, Work)
def drive_stage(p, state, inputs, n, work):
    """What acts from outside at stage n of a step."""
    drives, stage, transduction, strain = p.drives, work.stage, work.transduction, work.strain
    for i in range(drives.law_channel.shape[0]):
        channel = drives.law_channel[i]
        first, last = inputs.first[channel], inputs.stimulus[n, channel]
        lags = drives.law_rising[i], drives.law_falling[i]
        transduction[i] = lagged(state.transduction[i], first, last, lags[0], lags[1], inputs.elapsed[n])
        law = drives.law_gain[i], drives.law_reference[i], drives.law_saturation[i]
        strain[i] = eigenstrain_of(transduction[i], law[0], law[1], law[2])
    grow(drives, strain, stage.rest_edge, stage.rest_joint)
    for i in range(stage.load_factor.shape[0]):
        stage.load_factor[i] = inputs.load_factor[n, i]
    return READY


@kernel
def _total(energy):
    total = 0.0
    for k in range(energy.shape[0]):
        total += energy[k]
    return total


@piece(int, Problem, StateArrays, StateArrays, Method, bool, int, StageInputs, Work, float, float, int)
def make_step(p, state, start_state, method, with_history, mode, inputs, work, h, tolerance, max_iterations):
    """Advance a state by a step of length h [s]; it changes only if every stage converged and its end can be reached.

    Everything happens in passes through one loop, because the compiler would make a copy of all that is called in two
    places. A pass solves a stage. Where a step ends beyond its last stage (`Method.couplings`), one more pass moves
    there, and the last looks at the potential as it is there. In other modes there is one pass, from the state at rest,
    or as it stands; rest strains and factors of loads in `work.stage` are those to use then.

    Parameters
    ----------
    p : Problem
    state : StateArrays
        In the mode `SETTLE` it takes the shape found, if one was, or if the potential has at least fallen as far as the
        iterations went.
    kept : StateArrays
        The same at the start of the step; in other modes not used.
    method : Method
        For this step.
    keeps : bool
        Whether the integrator of the run keeps stage derivatives.
    mode : int
        From `modes`.
    inputs : StageInputs
    work : Work
    h : float
        In the mode `SETTLE` the length over which inertia acts; not used by `EVALUATE_STATE` and `COUNT`.
    tolerance : float
        [m/s]
    max_iterations : int

    Returns
    -------
    status : int
        In `Outcome`: the blocking pair, −1 if none, the place in `work.places` of the last configuration, numbers of
        iterations, factorisations and backtracks, the residual and the gap.
    """
    first, origin, end, stage = work.first, work.origin, work.end, work.stage
    counts, figures = p.outcome.counts, p.outcome.figures
    s, e, t = 0, 1, 2
    call(p.calls.take_state, (p, state, configuration_at(work.configurations[s])))
    points, stages = method.couplings.shape
    passes = 1
    if mode == STEP:
        passes = stages if points == stages else points + 1
        call(p.calls.start_step_point, (p, state, configuration_at(work.configurations[s]), first))
        stage.lengths[0], stage.lengths[1] = method.diagonal * h, method.momentum_diagonal * h
        work.start_angle[:] = 0.0
    else:
        stage.lengths[:] = EVALUATION_TIME if mode == EVALUATE_STATE else h if mode == SETTLE else WITHOUT_INERTIA
    iterations = factorisations = backtracks = 0
    worst, residual, gap = 0.0, 0.0, math.inf
    status, pair = READY, -1
    previous = first
    for n in range(passes):
        point = min(n, points - 1)
        beyond = mode == STEP and n == stages
        stays = mode != STEP or n == points
        position, rotation = inputs.position[point], inputs.rotation[point]
        start = configuration_at(work.configurations[s])
        if stays:
            call(p.calls.stand_still_stage, (p, state, start, mode == SETTLE or mode == COUNT, stage))
            position, rotation = state.body_position, state.body_rotation
        else:
            call(p.calls.set_origin, (work, method, n))
            call(p.calls.drive_stage, (p, state, inputs, n, work))
            if beyond:
                call(p.calls.predict_end, (p, state, work, inputs, n, previous, start))
            else:
                if with_history and method.history:
                    call(p.calls.add_history_to_origin, (p, state, work, method, n, h))
                call(p.calls.predict_stage, (p, state, work, inputs, n, previous, start))
        status = READY
        if not beyond:
            status = call(p.calls.start_stage, (p, start, stage))
        if status == READY and (not stays or mode == SETTLE):
            guess = configuration_at(work.configurations[e])
            status = call(p.calls.first_guess_of, (p, start, position, rotation, stage, guess, beyond))
            if status != READY:
                pair, residual = counts[PAIR], math.inf
                if beyond and status == BLOCKED:
                    status, pair = BEYOND, -1
                break
        elif status == READY:
            e = s
        residual = 0.0
        if status == READY and not beyond:
            wanted = NEGATIVE if mode == COUNT else VALUE if stays and mode != SETTLE else MINIMUM
            guess, scratch = configuration_at(work.configurations[e]), configuration_at(work.configurations[t])
            status = call(p.calls.minimise_potential, (p, guess, scratch, stage, tolerance, max_iterations, wanted))
            if counts[SWAPPED]:
                e, t = t, e
            iterations += counts[ITERATIONS]
            factorisations += counts[FACTORISATIONS]
            backtracks += counts[BACKTRACKS]
            residual, gap = figures[RESIDUAL], figures[GAP]
        if mode == SETTLE and (status == CONVERGED or status == MAX_ITERATIONS):
            work.moved[0] = call(p.calls.distance, (p, start, configuration_at(work.configurations[e])))
            call(p.calls.write_shape, (p, configuration_at(work.configurations[e]), state))
        if stays and mode == STEP and (status != CONVERGED or not math.isfinite(_total(p.sums.energy))):
            copy(start_state.values, state.values)
            status, residual = BEYOND if status == CONVERGED else status, math.inf
        if mode != STEP or not (beyond or status == CONVERGED):
            break
        if stays:
            write_twist(configuration_at(work.configurations[e]), state)
            continue
        worst = max(worst, residual)
        last = origin
        if not beyond:
            last = end
            call(p.calls.end_stage, (p, state, work, inputs, n, configuration_at(work.configurations[e])))
        if n + 1 == points:
            call(p.calls.write_end, (p, state, last, configuration_at(work.configurations[e]), inputs, n))
            for i in range(state.transduction.shape[0]):
                state.transduction[i] = work.transduction[i]
            if with_history:  # for the step after, which can take them if nothing touches anew
                call(p.calls.keep_stage_derivatives, (state, origin, last, stage.lengths[1], method.carry))
                state.has_history[0] = _compare_touched(p.sums, work.touched)
        if n + 1 < passes:
            if not beyond:
                previous = end
            copy(last.angle, work.start_angle)
            s, e = e, s
            configuration_at(work.configurations[s]).total_angle[:] = 0.0
        if beyond:
            stage.lengths[:] = EVALUATION_TIME
    else:
        status, residual = CONVERGED, worst
        ended = call(p.calls.end_forces, (p, configuration_at(work.configurations[e]), stage))
        copy(p.memory, state.memory)
        if ended != READY:
            copy(start_state.values, state.values)
            status = ended
    counts[PAIR], counts[CONFIGURATION], counts[ITERATIONS] = pair, e, iterations
    counts[FACTORISATIONS], counts[BACKTRACKS] = factorisations, backtracks
    figures[RESIDUAL], figures[GAP] = residual, gap
    return status
