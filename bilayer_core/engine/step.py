"""One step, all its stages, in one compiled function."""

from __future__ import annotations

import math

from ..jit import call, kernel, piece, record_at
from ..jit.record import Vector
from ..kinematics.copying import copy
from ..model.records.outcome import (
    BACKTRACKS,
    DONE,
    FACTORISATIONS,
    GAP,
    ITERATIONS,
    LARGEST_RESIDUAL,
    PAIR,
    PLACE,
    RESIDUAL,
    STATUS,
    SWAPPED,
)
from ..model.records.problem import Problem
from ..model.records.status import BEYOND, BLOCKED, CONVERGED, JUMPED, MAX_ITERATIONS, READY
from ..model.records.step import Course, Method, Place, Stage, StateArrays, Tally, Work
from ..scene.transduction import grown, lagged
from .loop import Counted, Loop
from .modes import COUNT, LOOK, MINIMUM, MOMENT, NEGATIVE, SETTLE, STEP, VALUE, WITHOUT_INERTIA
from .stages import write_twist

place_at = record_at(Place)


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
    """Note which carriers something pushes; whether they are those of before."""
    same = True
    for i in range(touched.shape[0]):
        pushed = sums.carrier[i, 0] != 0.0 or sums.carrier[i, 1] != 0.0 or sums.carrier[i, 2] != 0.0
        same &= pushed == touched[i]
        touched[i] = pushed
    return same


@kernel
def has_jumped(keeps, drives, state, first, range_of_channel, h):
    """Whether a stimulus has jumped that some layer follows at once, or a step before did not leave its slopes."""
    if not keeps:
        return False
    if state.kept[0] == 0.0:
        return True
    for k in range(drives.law_channel.shape[0]):
        channel = drives.law_channel[k]
        way = first[channel] - state.transduction[k]
        lag = drives.law_rising[k] if way > 0.0 else drives.law_falling[k]
        if abs(way) > NO_JUMP * range_of_channel[channel] and lag < AT_ONCE * h:
            return True
    return False


AT_ONCE = 1e-2
"""Part of a step below which the lag of a layer makes no difference to a jump of its stimulus."""
NO_JUMP = 1e-9
"""Part of a channel's range below which a change at once is rounding."""


@piece(int, Problem, StateArrays, Course, int, int, Work)
def drive_stage(p, state, course, k, n, work):
    """What acts from outside at stage n of step k."""
    drives, stage, transduction, strain = p.drives, work.stage, work.transduction, work.strain
    for i in range(drives.law_channel.shape[0]):
        channel = drives.law_channel[i]
        first, last = course.first[k, channel], course.stimulus[k, n, channel]
        lags = drives.law_rising[i], drives.law_falling[i]
        transduction[i] = lagged(state.transduction[i], first, last, lags[0], lags[1], course.elapsed[n])
        strain[i] = grown(transduction[i], drives.law_gain[i], drives.law_reference[i], drives.law_saturation[i])
    grow(drives, strain, stage.rest_edge, stage.rest_joint)
    for i in range(stage.load_factor.shape[0]):
        stage.load_factor[i] = course.load_factor[k, n, i]
    return READY


@kernel
def _total(energy):
    total = 0.0
    for k in range(energy.shape[0]):
        total += energy[k]
    return total


@piece(int, Problem, StateArrays, Method, bool, int, Course, int, Work, Vector, float, float, int)
def make_step(p, state, method, keeps, mode, course, k, work, before, h, tolerance, max_iterations):
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
    method : Method
        For this step.
    keeps : bool
        Whether the integrator of the run keeps slopes.
    mode : int
        From `modes`.
    course : Course
    k : int
        Which step of the course.
    work : Work
    before : Array
        Room for the values of the state at the start of a step that has to look at its end.
    h : float
        In the mode `SETTLE` the length over which inertia acts; not used by `LOOK` and `COUNT`.
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
    call(p.calls.take_state, (p, state, place_at(work.places[s])))
    points, stages = method.couplings.shape
    passes = 1
    if mode == STEP:
        passes = stages if points == stages else points + 1
        call(p.calls.start_step_point, (p, state, place_at(work.places[s]), first))
        stage.lengths[0], stage.lengths[1] = method.diagonal * h, method.momentum_diagonal * h
        work.turned[:] = 0.0
    else:
        stage.lengths[:] = MOMENT if mode == LOOK else h if mode == SETTLE else WITHOUT_INERTIA
    iterations = factorisations = backtracks = 0
    worst, residual, gap = 0.0, 0.0, math.inf
    status, pair = READY, -1
    previous = first
    place = min(k, course.position.shape[0] - 1)
    for n in range(passes):
        point = min(n, points - 1)
        beyond = mode == STEP and n == stages
        stays = mode != STEP or n == points
        position, rotation = course.position[place, point], course.rotation[place, point]
        start = place_at(work.places[s])
        if stays:
            call(p.calls.stand_still_stage, (p, state, start, mode == SETTLE or mode == COUNT, stage))
            position, rotation = state.body_position, state.body_rotation
        else:
            call(p.calls.place_origin, (work, method, n))
            call(p.calls.drive_stage, (p, state, course, k, n, work))
            if beyond:
                call(
                    p.calls.predict_end,
                    (p, state, origin, previous, start, work.turned, position, rotation, stage),
                )
            else:
                if keeps and method.history:
                    call(p.calls.move_along, (p, state, work, method, n, h))
                rates = course.rates[place, n]
                call(
                    p.calls.predict_stage,
                    (p, state, origin, previous, start, work.turned, position, rotation, rates, stage),
                )
        status = READY
        if not beyond:
            status = call(p.calls.start_stage, (p, start, stage))
        if status == READY and (not stays or mode == SETTLE):
            guess = place_at(work.places[e])
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
            guess, scratch = place_at(work.places[e]), place_at(work.places[t])
            status = call(p.calls.minimise_potential, (p, guess, scratch, stage, tolerance, max_iterations, wanted))
            if counts[SWAPPED]:
                e, t = t, e
            iterations += counts[ITERATIONS]
            factorisations += counts[FACTORISATIONS]
            backtracks += counts[BACKTRACKS]
            residual, gap = figures[RESIDUAL], figures[GAP]
        if mode == SETTLE and (status == CONVERGED or status == MAX_ITERATIONS):
            work.moved[0] = call(p.calls.distance, (p, start, place_at(work.places[e])))
            call(p.calls.write_shape, (p, place_at(work.places[e]), state))
        if stays and mode == STEP and (status != CONVERGED or not math.isfinite(_total(p.sums.energy))):
            copy(before, state.values)
            status, residual = BEYOND if status == CONVERGED else status, math.inf
        if mode != STEP or not (beyond or status == CONVERGED):
            break
        if stays:
            write_twist(place_at(work.places[e]), state)
            continue
        worst = max(worst, residual)
        last = origin
        if not beyond:
            last = end
            reached = place_at(work.places[e])
            call(p.calls.end_stage, (p, state, stage, origin, work.turned, reached, position, rotation, end))
        if n + 1 == points:
            if beyond:
                copy(state.values, before)
            rates = course.rates[place, n]
            call(p.calls.write_end, (p, state, last, place_at(work.places[e]), position, rates))
            for i in range(state.transduction.shape[0]):
                state.transduction[i] = work.transduction[i]
            if keeps:  # for the step after, which can take them if nothing touches anew
                call(p.calls.keep_slopes, (state, origin, last, stage.lengths[1], method.carry))
                state.kept[0] = _compare_touched(p.sums, work.touched)
        if n + 1 < passes:
            if not beyond:
                previous = end
            copy(last.turn, work.turned)
            s, e = e, s
            place_at(work.places[s]).turn[:] = 0.0
        if beyond:
            stage.lengths[:] = MOMENT
    else:
        status, residual = CONVERGED, worst
    counts[PAIR], counts[PLACE], counts[ITERATIONS] = pair, e, iterations
    counts[FACTORISATIONS], counts[BACKTRACKS] = factorisations, backtracks
    figures[RESIDUAL], figures[GAP] = residual, gap
    return status


@kernel
def count_in(surfaces, strands, sums, state, gap, time, tally):
    """Take the end of a step into the extremes of a run."""
    figures, nodes = tally.figures, strands.node_mass.shape[0]
    height = 0.0
    for i in range(nodes):
        height += strands.node_mass[i] * state.position[i, 2]
    for k in range(tally.mass_moment.shape[0]):
        height += tally.mass_moment[k] * state.director1[k, 2]
    figures[0] = max(figures[0], height / tally.mass)
    figures[1] = min(figures[1], gap)
    largest = 0.0
    for i in range(nodes):
        force = sums.carrier[i, 0] ** 2 + sums.carrier[i, 1] ** 2 + sums.carrier[i, 2] ** 2
        largest = max(largest, force)
    figures[2] = max(figures[2], math.sqrt(largest))
    _count_contacts(surfaces, nodes, time, tally)


@piece(int, Problem, StateArrays, Place, Stage, float, float, Tally)
def count_end(p, state, place, stage, gap, time, tally):
    """Take the end of a step, and its shape, into the extremes of a run."""
    count_in(p.surfaces, p.strands, p.sums, state, gap, time, tally)
    strands, rest_edge, figures, voronoi = p.strands, stage.rest_edge, tally.figures, tally.voronoi_length
    sharpest = 0.0
    for j in range(voronoi.shape[0]):
        a, b = strands.joint_a[j], strands.joint_b[j]
        bend, cosine = 0.0, 1.0
        for c in range(3):  # κ₁ of `forces.bend_twist`; that in `joint_strain` is from before Newton's last correction
            bend += place.tangent[b, c] * place.director1[a, c] - place.tangent[a, c] * place.director1[b, c]
            cosine += place.tangent[a, c] * place.tangent[b, c]
        sharpest = max(sharpest, abs(bend) / (cosine * voronoi[j]))
    largest = 0.0
    for e in range(strands.edge_count):
        largest = max(largest, abs(place.length[e] / strands.rest_length[e] - 1.0 - rest_edge[e]))
    figures[3], figures[4] = max(figures[3], sharpest), max(figures[4], largest)
    for b in range(tally.body_top.shape[0]):
        tally.body_top[b] = max(tally.body_top[b], state.body_position[b, 2])
    return READY


@kernel
def _count_contacts(surfaces, nodes, time, tally):
    if not surfaces.exists:
        return
    count = tally.nodes
    count[:] = 0
    for c in range(surfaces.near_count[0]):
        if surfaces.near_gap[c] < surfaces.d_hat and surfaces.near_carrier[c] < nodes:
            count[surfaces.near_surface[c]] += 1
    for s in range(count.shape[0]):
        tally.most_nodes[s] = max(tally.most_nodes[s], count[s])
        if count[s] > 0 and math.isnan(tally.first_contact[s]):
            tally.first_contact[s] = time


@piece(int, Loop, bool, int, bool, bool, float, float, int)
def take_steps(loop, keeps, mode, changes, counts, h, tolerance, max_iterations):
    """Advance a state by the steps of a course, as far as each succeeds, or do once what another mode says; parameters
    beside those of `make_step`:

    Parameters
    ----------
    loop : Loop
    changes : bool
        Whether `method` begins with slopes that the step before must have left: a jump ends the loop then.
    counts : bool
        Whether to take the steps into the tally.

    Returns
    -------
    done : int
        Number of steps made. In `Outcome`: status, pair and place of the last attempt, Newton's work for all of them,
        and the residuals and the gap.
    """
    p, state, course, work = loop.problem, loop.state, loop.course, loop.work
    found, figures = p.outcome.counts, p.outcome.figures
    iterations = factorisations = backtracks = done = 0
    worst = last = 0.0
    gap, place = math.inf, 1
    status, pair, end, residual = READY, -1, 1, 0.0
    for k in range(course.time.shape[0]):
        if changes and (course.jumps[k] or has_jumped(keeps, p.drives, state, course.first[k], loop.ranges, h)):
            status, pair, end, residual = JUMPED, -1, place, last
            break
        status = call(
            p.calls.make_step,
            (p, state, loop.method, keeps, mode, course, k, work, loop.before, h, tolerance, max_iterations),
        )
        pair, end, residual = found[PAIR], found[PLACE], figures[RESIDUAL]
        if mode != STEP or status == CONVERGED or status >= MAX_ITERATIONS:  # what begins again does not count
            iterations += found[ITERATIONS]
            factorisations += found[FACTORISATIONS]
            backtracks += found[BACKTRACKS]
        gap = figures[GAP]
        if mode != STEP or status != CONVERGED:
            break
        done, place, last = done + 1, end, residual
        worst = max(worst, residual)
        if counts:
            at = place_at(work.places[end])
            call(p.calls.count_end, (p, state, at, work.stage, gap, course.time[k], loop.tally))
    found[STATUS], found[PAIR], found[PLACE], found[DONE] = status, pair, end, done
    found[ITERATIONS], found[FACTORISATIONS], found[BACKTRACKS] = iterations, factorisations, backtracks
    figures[RESIDUAL], figures[LARGEST_RESIDUAL], figures[GAP] = residual, worst, gap
    return done


@piece(int, Counted, float, float)
def count_step(counted, gap, time):
    """Take the end of a step that no loop has made into the extremes of a run."""
    count_in(counted.surfaces, counted.strands, counted.sums, counted.state, gap, time, counted.tally)
    return READY
