"""Forces at points and moments on bodies, as potentials of one step.

A force F that keeps its direction is conservative:

    V = −F·x,    ∂V/∂x = −F,    no Hessian

On a path that lies z over the curve of a laminate the force acts at x + z m̄1 (`forces.raised`), m̄1 the mean of the
edges before and after the node, or that of the last edge.

A moment M that keeps its direction is not: no potential of a rotation has the gradient −M everywhere. Over a step it
has one up to second order. With R̃ the rotation that inertia predicts, Q = R R̃ᵀ the small turn beyond it, and
ax(A) = (A₃₂ − A₂₃, A₁₃ − A₃₁, A₂₁ − A₁₂):

    V = −½ M·ax(Q) = −tr(A),    A = ½ [M]× Qᵀ
    R → exp([φ]×) R:    gradient −ax(A),    Hessian tr(A) 1 − ½ (A + Aᵀ)

(the same form as in `forces.inertia`). For Q = exp([δ]×) the moment that acts is −∂V/∂φ = M − ½ M×δ + O(δ²), and δ is
the angular acceleration times the square of the step: the error is of second order. V is work, not energy.

A load that turns with what it acts on ("follower") takes its direction from the configuration to which Newton moved
last, as drag does, and is then one of these: the step ends with the direction that it has there. At an end of a rod,
half an edge beyond its last one, that is 1.5 times the direction of this less half of that beside it.
"""

from __future__ import annotations

import math

from bilayer_core.forces.drag import mixed_directions
from bilayer_core.forces.raised import director_moved
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.vector import combine3
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Moments, PointForces
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage

MOMENTS = slot_of("moments")


@kernel
def point_force(index, force, position, origin, length, gradient_out):
    """Add −Σ F·x of forces [N], shape (n_force, 3), on nodes or free bodies, shape (n_force,); return it [J] and the
    power [W] over a stage of that length [s] from an origin.
    """
    energy = power = 0.0
    for k in range(index.shape[0]):
        i = index[k]
        for c in range(3):
            gradient_out[i, c] -= force[k, c]
            energy -= force[k, c] * position[i, c]
            power += force[k, c] * (position[i, c] - origin[i, c]) / length
    return energy, power


@kernel
def _pull_of_levers(loads, raised, at, stage, pull_out):
    """Add −Σ F·(z m1) of forces on half edges at the height z; return it [J] and the power of them [W]."""
    energy = power = 0.0
    for j in range(loads.lever.shape[0]):
        k, r, height = loads.lever[j], loads.lever_raised[j], loads.lever_height[j]
        for c in range(3):
            force = height * loads.on_nodes[k, c]
            pull_out[r, c] -= force
            energy -= force * at.director1[raised.edge[r], c]
            power += force * director_moved(raised, at, stage, r, c) / stage.length
    return energy, power


@kernel
def in_axes_of_body(vector, k, factor, rotation, f, vector_out):
    """Write row k in the axes of free body f, times a factor."""
    for c in range(3):
        vector_out[k, c] = 0.0
        for a in range(3):
            vector_out[k, c] += factor * rotation[f, c, a] * vector[k, a]


@piece(float, PointForces, Problem, Configuration, Stage, bool)
def add_point_forces(loads, p, at, stage, with_hessian):
    """Add the potential of forces and its gradient by nodes and free bodies."""
    sums, slot, h = p.sums, loads.energy_slot, stage.length
    if sums.selected[slot]:
        found = point_force(loads.node, loads.on_nodes, at.position, stage.origin_position, h, sums.node)
        origin = stage.origin_body_position
        more = point_force(loads.body, loads.on_bodies, at.body_position, origin, h, sums.body)
        sums.energy[slot], sums.supplied[slot] = found[0] + more[0], found[1] + more[1]
        if loads.lever.shape[0] > 0:
            off_curve = _pull_of_levers(loads, p.raised, at, stage, sums.pull)
            sums.energy[slot] += off_curve[0]
            sums.supplied[slot] += off_curve[1]
    return math.inf


@piece(int, PointForces, Problem, Configuration, Stage)
def start_dead_loads(loads, p, start, stage):
    """Set the forces of fixed direction from their factors at the stage."""
    for k in range(loads.node.shape[0]):
        for c in range(3):
            loads.on_nodes[k, c] = stage.load_factor[loads.node_load[k]] * loads.node_vector[k, c]
    for k in range(loads.body.shape[0]):
        for c in range(3):
            loads.on_bodies[k, c] = stage.load_factor[loads.body_load[k]] * loads.body_vector[k, c]
    return READY


@piece(bool, PointForces, Problem, Configuration, Stage)
def update_followers(loads, p, at, stage):
    """Let followers take their directions from a configuration; returns whether there are any."""
    node, body = loads.node, loads.body
    for k in range(node.shape[0]):
        factor, v = stage.load_factor[loads.node_load[k]], loads.node_vector
        parts = loads.part
        t, m, n = mixed_directions(loads.edge_before[k], parts[k, 0], loads.edge_after[k], parts[k, 1], at)
        force = combine3(factor * v[k, 0], t, factor * v[k, 1], m, factor * v[k, 2], n)
        for c in range(3):
            loads.on_nodes[k, c] = force[c]
    for k in range(body.shape[0]):
        factor = stage.load_factor[loads.body_load[k]]
        in_axes_of_body(loads.body_vector, k, factor, at.body_rotation, body[k], loads.on_bodies)
    return node.shape[0] + body.shape[0] > 0


@kernel
def _power_of_moment(moment, k, rotation, stage, body, b):
    """Return M·ω [W] with [ω]× = (R − R̄) Rᵀ/(γ h), its antisymmetric part."""
    power = 0.0
    for c in range(3):
        i, j = (c + 1) % 3, (c + 2) % 3
        for m in range(3):
            origin = stage.origin_rotation
            power -= (
                0.5 * moment[k, c] * (origin[body, j, m] * rotation[b, i, m] - origin[body, i, m] * rotation[b, j, m])
            )
    return power / stage.length


@piece(float, Moments, Problem, Configuration, Stage, bool)
def add_moments(moments, p, at, stage, with_hessian):
    """Add −½ Σ M·ax(R R̃ᵀ) and its derivatives by the turns φ of free bodies."""
    sums = p.sums
    if not sums.selected[MOMENTS]:
        return math.inf
    body, moment, gradient, hessian = moments.body, moments.present, sums.body, sums.body_hessian
    rotation, predicted_rotation = at.body_rotation, stage.predicted_body_rotation
    energy = power = 0.0
    for k in range(body.shape[0]):
        b = body[k]
        power += _power_of_moment(moment, k, rotation, stage, p.bodies.body_of_free[b], b)
        # row i of [M]× R̃ is that of the cross products of M with the columns of R̃
        a = stack_matrix(3, 3)
        for j in range(3):
            a[0, j] = a[1, j] = a[2, j] = 0.0
            for m in range(3):
                r0, r1, r2 = predicted_rotation[b, 0, m], predicted_rotation[b, 1, m], predicted_rotation[b, 2, m]
                half = 0.5 * rotation[b, j, m]
                a[0, j] += half * (moment[k, 1] * r2 - moment[k, 2] * r1)
                a[1, j] += half * (moment[k, 2] * r0 - moment[k, 0] * r2)
                a[2, j] += half * (moment[k, 0] * r1 - moment[k, 1] * r0)
        trace = a[0, 0] + a[1, 1] + a[2, 2]
        energy -= trace
        gradient[b, 3] -= a[2, 1] - a[1, 2]
        gradient[b, 4] -= a[0, 2] - a[2, 0]
        gradient[b, 5] -= a[1, 0] - a[0, 1]
        if with_hessian:
            base = 6 * b + 3
            for i in range(3):
                hessian[base + i, base + i] += trace
                for j in range(3):
                    hessian[base + i, base + j] -= 0.5 * (a[i, j] + a[j, i])
    sums.energy[MOMENTS], sums.supplied[MOMENTS] = energy, power
    return math.inf


@piece(bool, Moments, Problem, Configuration, Stage)
def update_moments(moments, p, at, stage):
    """Return the moments by their factors, those that follow in the axes of their bodies; whether any does."""
    body, dead = moments.body, moments.dead
    for k in range(body.shape[0]):
        factor = stage.load_factor[moments.load[k]]
        if k < dead:
            for c in range(3):
                moments.present[k, c] = factor * moments.vector[k, c]
        else:
            in_axes_of_body(moments.vector, k, factor, at.body_rotation, body[k], moments.present)
    return body.shape[0] > dead
