"""Newton's method on the incremental potential, with line search and a step bound.

The Hessian is exact. Once factorised it serves several corrections as long as each is less than `KEEP_FACTOR_BELOW`
times the one before;
a new correction of the gradient at hand costs a fraction of a new factorisation. The measure of convergence is the
speed of the fastest material point in the last of them [m/s], which is still taken.
What the potential takes at the configuration (`potential.update_lagged`) moves along with every correction.
"""

from __future__ import annotations

import math

from bilayer_core.engine.configuration import (
    copy_prescribed,
    departure_of_constrained,
    move,
    transport_frames,
    update_attached,
)
from bilayer_core.engine.linear.newton_matrix import factorise, solve
from bilayer_core.engine.potential import evaluate, settle_forces, total_energy, update_lagged
from bilayer_core.engine.request_modes import MINIMUM, NEGATIVE, VALUE
from bilayer_core.forces.friction_limit import limit_by_friction
from bilayer_core.forces.rod_contact import bound_between_rods, find_rod_contacts
from bilayer_core.forces.surface_pairs import bound_at_surfaces
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.record import Matrix, Stack
from bilayer_core.kinematics.copying import copy
from bilayer_core.kinematics.rotating import compose_quaternion, rotate_by, rotation_vector_between
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import (
    BLOCKED,
    CONVERGED,
    LINE_SEARCH,
    MAX_ITERATIONS,
    NOT_FINITE,
    PAUSED,
    READY,
    ROD_CAPACITY_EXCEEDED,
    UNSETTLED,
)
from bilayer_core.model.records.step import Configuration, Stage

ARMIJO = 1e-4  # least fraction of the predicted decrease (Nocedal and Wright 2006, ch. 3)
KEEP_FACTOR_BELOW = 0.2  # ratio of successive corrections
BACKTRACKING = 0.5
MAX_BACKTRACKS = 30
SAFE_PART = 0.5  # of the smallest gap, which a correction may close without a look at each pair
MAX_SETTLINGS = 8
SETTLED_WITHIN = 10.0  # times the tolerance: the first correction after forces were settled, which then is the last one
ROUNDING = 1e-13  # of the sum of the terms' magnitudes: differences of the potential below it mean nothing


@kernel
def largest_move(step, node_unknown, edge_unknown, half_width):
    """Return the largest displacement of a node, or of an edge's border by its turn [m]; NaN if any is."""
    largest, total = 0.0, 0.0
    for i in range(node_unknown.shape[0]):
        d = node_unknown[i]
        square = step[d] * step[d] + step[d + 1] * step[d + 1] + step[d + 2] * step[d + 2]
        total += square
        largest = max(largest, square)
    largest = math.sqrt(largest)
    for k in range(edge_unknown.shape[0]):
        size = abs(step[edge_unknown[k]]) * half_width[k]
        total += size
        largest = max(largest, size)
    return total if math.isnan(total) else largest


@kernel
def correction_speed(strands, bodies, system, length):
    """Return the largest displacement of a material point in the present step over a length of time [m/s]; NaN if any
    is.
    """
    largest = largest_move(system.step, strands.node_unknown, strands.edge_unknown, strands.half_width)
    for f in range(bodies.mass.shape[0]):
        shift, turn = 0.0, 0.0
        for c in range(3):
            shift += system.body_step[f, c] * system.body_step[f, c]
            turn += system.body_step[f, 3 + c] * system.body_step[f, 3 + c]
        size = math.sqrt(shift) + bodies.bounding_radius[bodies.body_of_free[f]] * math.sqrt(turn)
        if math.isnan(size):
            return size
        largest = max(largest, size)
    return largest / length


@kernel
def rounding_speed(at, length):
    """Return the speed of a correction that moves the node farthest out by a few of its last digits over a length of
    time [m/s].

    Elasticity sees positions no better than that, so Newton cannot do better where it outweighs inertia.
    """
    farthest = 0.0
    for i in range(at.position.shape[0]):
        for c in range(3):
            farthest = max(farthest, abs(at.position[i, c]))
    return LAST_DIGITS * farthest / length


LAST_DIGITS = 4.0 * 2.0**-52
"""Relative error of a coordinate by four units of its last digit."""


@piece(float, Problem, Configuration)
def bound(p, at):
    """Return the largest fraction of `System.node_step`, `System.angle_step` and `System.motion` that keeps all gaps
    open; the near pair that sets it (−1: none), and whether that could be found, are left in `Outcome`.
    """
    _move_constrained(p.constrained, p.system, at)
    outcome = p.outcome
    outcome.pair, outcome.status = -1, READY
    fraction = 1.0
    if p.surfaces.exists:
        fraction = bound_at_surfaces(p, at)
    if outcome.status != READY or not p.rod_contact.exists:
        return fraction
    between = bound_between_rods(p, at)
    if between < fraction:
        outcome.pair = -1
        return between
    return fraction


@kernel
def _move_constrained(constrained, system, at):
    """Write the displacements of nodes that bodies hold."""
    for k in range(constrained.node.shape[0]):
        i, b = constrained.node[k], constrained.body[k]
        r0, r1, r2 = system.motion[b, 3], system.motion[b, 4], system.motion[b, 5]
        system.node_step[i, 0] = system.motion[b, 0] + r1 * at.arm[k, 2] - r2 * at.arm[k, 1]
        system.node_step[i, 1] = system.motion[b, 1] + r2 * at.arm[k, 0] - r0 * at.arm[k, 2]
        system.node_step[i, 2] = system.motion[b, 2] + r0 * at.arm[k, 1] - r1 * at.arm[k, 0]


@kernel
def _move_prescribed(bodies, start, position, rotation, motion):
    """Write displacements and rotation vectors of prescribed bodies from a configuration to given poses."""
    for k in range(bodies.prescribed.shape[0]):
        b = bodies.prescribed[k]
        for c in range(3):
            motion[b, c] = position[b, c] - start.pose_position[b, c]
            motion[b, 3 + c] = 0.0
        if bodies.rotates[b]:
            motion[b, 3], motion[b, 4], motion[b, 5] = rotation_vector_between(start.rotation, b, rotation, b)


@piece(int, Problem, Configuration, Matrix, Stack, Stage, Configuration, bool)
def first_guess_of(p, start, position, rotation, stage, guess, whole):
    """Set `guess` to `start` moved to where inertia takes it, or as far as no gap closes, prescribed bodies to given
    poses.

    Frames are carried over Newton's iterates from here: a first iterate that is off by O(h), such as one whose bodies
    have not turned, would leave a twist of O(h²) in every step.

    Returns a status: `BLOCKED`, with the blocking pair in `Outcome`, if prescribed motion would close a gap, or, where
    the `whole` way is asked for, if it cannot be gone.
    """
    bodies, system = p.bodies, p.system
    free = bodies.mass.shape[0]
    _move_prescribed(bodies, start, position, rotation, system.motion)
    fraction, outcome = 1.0, p.outcome
    for attempt in range(3):
        for f in range(free):
            b = bodies.body_of_free[f]
            for c in range(3):
                system.motion[b, c] = fraction * stage.predicted_body_shift[f, c]
                system.motion[b, 3 + c] = fraction * stage.predicted_body_rotation_vector[f, c]
        for i in range(system.node_step.shape[0]):
            for c in range(3):
                system.node_step[i, c] = fraction * stage.predicted_shift[i, c]
        for k in range(p.strands.edge_count):
            system.angle_step[k] = fraction * stage.predicted_angle[k]
        alpha = bound(p, start)
        if outcome.status != READY:
            outcome.pair = -1
            return outcome.status
        if alpha >= 1.0:
            break
        if attempt == 2 or whole:
            return BLOCKED
        fraction *= (0.5 if attempt == 0 else 0.0) * alpha
    for i in range(system.node_step.shape[0]):
        for c in range(3):
            guess.position[i, c] = start.position[i, c] + fraction * stage.predicted_shift[i, c]
            guess.departure[i, c] = (fraction - 1.0) * stage.predicted_shift[i, c]
    for k in range(p.strands.edge_count):
        guess.total_angle[k] = fraction * stage.predicted_angle[k]
    copy_prescribed(bodies, position, rotation, guess)
    for f in range(free):
        for c in range(3):
            guess.body_position[f, c] = start.body_position[f, c] + fraction * stage.predicted_body_shift[f, c]
            guess.body_departure[f, c] = (fraction - 1.0) * stage.predicted_body_shift[f, c]
            guess.body_departure_quaternion[f, c] = 0.0
        rotate_by(
            fraction * stage.predicted_body_rotation_vector[f, 0],
            fraction * stage.predicted_body_rotation_vector[f, 1],
            fraction * stage.predicted_body_rotation_vector[f, 2],
            start.body_rotation,
            f,
            guess.body_rotation,
            f,
        )
        short = fraction - 1.0
        compose_quaternion(
            short * stage.predicted_body_rotation_vector[f, 0],
            short * stage.predicted_body_rotation_vector[f, 1],
            short * stage.predicted_body_rotation_vector[f, 2],
            guess.body_departure_quaternion,
            guess.body_departure_quaternion,
            f,
        )
    update_attached(p, guess)
    departure_of_constrained(p.constrained, stage, guess)
    copy(guess.total_angle, guess.angle)
    transport_frames(p, start, guess)
    for k in range(stage.twist.shape[0]):
        guess.joint_strain[k, 2] = stage.twist[k]
    outcome.pair = -1
    return READY


FACTORISE, UPDATE_LAGGED, SEARCH = 0, 1, 2
"""What an evaluation is for: a new matrix, a gradient in which only what follows the configuration has changed, a step
of the line search."""


@piece(int, Problem, Configuration, Configuration, Stage, float, int, int)
def minimise_potential(p, at, trial, stage, tolerance, max_iterations, wanted):
    """Move `at` to the minimum of the potential, or only do there what is `wanted` (`modes`); `trial` is scratch.

    All evaluations are at one place, because the compiler would make as many copies of them as there are places. Where
    a new matrix is likely to be needed at the end of a step, it is evaluated with second derivatives at once.

    The correction that is small enough is the last one, and it is taken, as far as gaps stay open: a linear problem is
    solved exactly, however slow the motion. The potential is not evaluated again after it. Energies, forces and gaps
    are those of the configuration before it, which is nearer than the tolerance times the length of the stage.

    Before that, what forces froze at the start of the stage is taken anew from the minimum (`potential.settle_forces`),
    and the potential minimised again from there, with the matrix at hand, until the first correction is small enough.
    `max_iterations` counts anew each time.

    Returns
    -------
    status : int
        In `Outcome`: whether the minimum is `trial` and not `at`, numbers of iterations, factorisations and settlings,
        the speed of the last correction [m/s], and the smallest gap to a surface or another rod [m].
    """
    outcome = p.outcome
    update_lagged(p, at, stage)
    swapped, fresh, short, task = False, True, False, FACTORISE
    settled = False  # whether what is left to do is the last correction
    checked = False  # whether forces were settled at `at`
    found, curved = False, False  # whether contacts of rods, and second derivatives, are those of `at`
    iterations = factorisations = settlings = halvings = begun = 0
    residual = previous = gap = math.inf
    energy = alpha = slope = noise = 0.0
    while True:
        outcome.passes -= 1
        if outcome.passes < -outcome.patience and wanted == MINIMUM:
            status = PAUSED
            break
        if task == SEARCH:
            move(p, at, alpha, stage, trial)
            if settled:
                copy(at.joint_strain, trial.joint_strain)  # twists, by which turns are counted, are near enough
                swapped, status = not swapped, CONVERGED
                break
            found, curved = False, short or factorisations > 1
        if task != FACTORISE or not curved:
            configuration = trial if task == SEARCH else at
            if not found and p.rod_contact.exists and not find_rod_contacts(p, configuration):
                status = ROD_CAPACITY_EXCEEDED
                break
            found, curved = True, curved or task == FACTORISE and wanted != VALUE
            value, new_gap = evaluate(p, configuration, stage, curved, task == UPDATE_LAGGED)
            if wanted == VALUE:
                gap, status = new_gap, CONVERGED
                break
        if task == SEARCH:
            if not value <= energy + ARMIJO * alpha * slope + noise:
                alpha *= BACKTRACKING
                halvings += 1
                if halvings < MAX_BACKTRACKS:
                    continue
                if fresh:
                    status = LINE_SEARCH
                    break
                found, curved, task = False, False, FACTORISE  # a direction of an old matrix: try that of a new one
                continue
            energy, gap = value, new_gap
            iterations += not fresh
            fresh, checked, previous = False, False, residual
            at, trial, swapped = trial, at, not swapped
            if update_lagged(p, at, stage):
                curved, task = False, UPDATE_LAGGED
            else:
                energy = value = total_energy(p.sums)
            if short or halvings > 0:
                task = FACTORISE
            if task != SEARCH:
                continue
        else:
            energy, gap = value, gap if task == UPDATE_LAGGED else new_gap
            if task == FACTORISE:
                if factorisations == 0 and not math.isfinite(energy):
                    status = NOT_FINITE
                    break
                factorisations += 1
                status = factorise(p, at, stage, wanted == NEGATIVE)
                if wanted == NEGATIVE and status == READY:
                    status = CONVERGED
                if status != READY:
                    break
                iterations += 1
                fresh = True
        solve(p)
        residual = correction_speed(p.strands, p.bodies, p.system, stage.length)
        if not math.isfinite(residual):
            status = NOT_FINITE
            break
        enough = SETTLED_WITHIN * tolerance if checked else tolerance
        settled = residual <= enough or residual <= rounding_speed(at, stage.length)
        if settled and not checked:
            checked = True
            if settle_forces(p, at, stage):
                settlings += 1
                if settlings > MAX_SETTLINGS:
                    status = UNSETTLED
                    break
                curved, task, previous, begun = False, UPDATE_LAGGED, math.inf, iterations
                if p.sliding.exists and p.sliding.places[0] > 0 and p.sliding.relaxation[0] == 0.0:
                    task = FACTORISE  # friction acts at other places, of which the old matrix knows nothing
                continue
        if not settled and iterations - begun >= max_iterations:
            status = MAX_ITERATIONS
            break
        if not settled and not fresh and residual > KEEP_FACTOR_BELOW * previous:
            task = FACTORISE
            continue
        open_gap = min(gap, p.rod_contact.d_hat) if p.rod_contact.exists else gap  # of rods that is the most it is
        nearer = 2.0 * residual * stage.length * _reach(p)  # by so much two points may near each other
        safe = nearer <= SAFE_PART * open_gap
        alpha, halvings, task = 1.0, 0, SEARCH
        if settled and safe:
            continue
        slope, noise = predicted_decrease(p.strands, p.bodies, p.sums, p.system)
        if safe and (not p.surfaces.exists or nearer <= p.surfaces.room[0]):
            outcome.pair = -1
            _move_constrained(p.constrained, p.system, at)
            if p.surfaces.exists:
                p.surfaces.room[0] -= nearer
        else:
            alpha = bound(p, at)
            status = outcome.status
            if status != READY:
                break
        if fresh and not settled and p.slips.exists:
            alpha = limit_by_friction(p, at, stage, slope, alpha)
        short = alpha < 1.0
    outcome.swapped, outcome.iterations, outcome.factorisations = swapped, iterations, factorisations
    outcome.settlings, outcome.residual, outcome.gap, outcome.fraction = settlings, residual, gap, alpha
    return status


@kernel
def _reach(p):
    """Return how many times farther than nodes and borders of edges a point that meets others moves at most."""
    reach = p.surfaces.arm_factor if p.surfaces.exists else 1.0
    return max(reach, p.rod_contact.rails.factor) if p.rod_contact.exists and p.rod_contact.rails.exists else reach


@kernel
def predicted_decrease(strands, bodies, sums, system):
    """Return the slope of the potential along the present step, and the difference below which its values mean nothing
    [J]; the motion of nodes and bodies is left for the bound.
    """
    slope, noise = 0.0, 0.0
    for j in range(system.step.shape[0]):
        slope += sums.gradient[j] * system.step[j]
    for f in range(bodies.mass.shape[0]):
        for c in range(6):
            slope += sums.body[f, c] * system.body_step[f, c]
            system.motion[bodies.body_of_free[f], c] = system.body_step[f, c]
    for k in range(sums.energy.shape[0]):
        noise += abs(sums.energy[k])
    for k in range(bodies.prescribed.shape[0]):
        for c in range(6):
            system.motion[bodies.prescribed[k], c] = 0.0
    for i in range(strands.node_unknown.shape[0]):
        for c in range(3):
            system.node_step[i, c] = system.step[strands.node_unknown[i] + c]
    for k in range(strands.edge_unknown.shape[0]):
        system.angle_step[k] = system.step[strands.edge_unknown[k]]
    return slope, ROUNDING * noise
