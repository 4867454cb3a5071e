"""Inertia, mass damping and gravity: potentials that are at most quadratic in positions and angles.

Over a step of length h from qₙ with velocity vₙ:

    inertia (implicit Euler, paper, eq. 29)   ½ M/h² |q − q̃|²,   q̃ = qₙ + h vₙ,   v = (q − qₙ)/h
    mass damping, force −α M v               ½ α M/h |q − qₙ|²
    gravity                                  −M g·x

M is diagonal: a node carries half the mass of each of its edges, from reference lengths (growth keeps mass); the
angle of an edge carries ρ w h (w² + h²)/12 per length. The Hessians are multiples of M and are added where the matrix
is assembled. Inertia knows q − q̃ as a part of a step, and not as a difference of positions, so it has all its digits:
a step of 1e-8 s asks for (1e-8 s)² g ~ 1e-15 m, where the last digit of a position of 1 m stands for 1e-16 m.

A free rigid body is the continuum of its mass points y = X + R r. Their squared distance from where inertia alone
would take them is

    m/(2h²) |X − X̃|² + tr((R − R̃) J (R − R̃)ᵀ)/(2h²),    J = ∫ r rᵀ dm = ½ tr(I) 1 − I

(Ferguson et al. 2021, eq. 6; X̃ and R̃ come from the integrator). With R → exp([φ]×) R, A = R̃ J Rᵀ and ax(A) = (A₃₂
− A₂₃, A₁₃ − A₃₁, A₂₁ − A₁₂):

    gradient −ax(A)/h²,    Hessian (tr(A) 1 − ½ (A + Aᵀ))/h²

With R = E R̃, N = E − 1 and S = R̃ J R̃ᵀ, which is symmetric, A = S + S Nᵀ, ax(A) = ax(S Nᵀ), and the energy of turning is
tr(N S Nᵀ)/(2h²). N = 2 w [q]× + 2 [q]×² with the quaternion (w, q) of E: short steps and slow turns keep their digits.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.rotating import real_part
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

INERTIA, DAMPING, GRAVITY = map(slot_of, ("inertia", "damping", "gravity"))


@kernel
def angle_spring(inertia, factor, angle, reference, edge_gradient_out):
    """Add ½ factor Σ J (θ − θ_ref)² of edges, by their turns since the start of the step [rad], and return it [J]."""
    energy = 0.0
    for k in range(inertia.shape[0]):
        difference = angle[k] - reference[k]
        force = factor * inertia[k] * difference
        edge_gradient_out[k, 3] += force
        energy += 0.5 * force * difference
    return energy


@kernel
def gravity(mass, acceleration, position, gradient_out):
    """Add −Σ m g·x of nodes or of bodies and return it [J]; `acceleration` is g [m/s²], shape (3,)."""
    energy = 0.0
    for i in range(mass.shape[0]):
        for j in range(3):
            weight = mass[i] * acceleration[j]
            gradient_out[i, j] -= weight
            energy -= weight * position[i, j]
    return energy


@kernel
def second_moment_beyond(second_moment, f, reference_rotation, turned, s_out, n_out, a_out):
    """Write S, N and S Nᵀ of free body f, shapes (3, 3), for E with the vector part `turned[f]` of its quaternion."""
    for i in range(3):
        for j in range(3):
            s_out[i, j] = 0.0
            for k in range(3):
                for m in range(3):
                    s_out[i, j] += reference_rotation[f, i, k] * second_moment[f, k, m] * reference_rotation[f, j, m]
    q0, q1, q2, w = turned[f, 0], turned[f, 1], turned[f, 2], real_part(turned, f)
    n_out[0, 0], n_out[1, 1] = -2.0 * (q1 * q1 + q2 * q2), -2.0 * (q0 * q0 + q2 * q2)
    n_out[2, 2] = -2.0 * (q0 * q0 + q1 * q1)
    n_out[0, 1], n_out[1, 0] = 2.0 * (q0 * q1 - w * q2), 2.0 * (q0 * q1 + w * q2)
    n_out[0, 2], n_out[2, 0] = 2.0 * (q0 * q2 + w * q1), 2.0 * (q0 * q2 - w * q1)
    n_out[1, 2], n_out[2, 1] = 2.0 * (q1 * q2 - w * q0), 2.0 * (q1 * q2 + w * q0)
    for i in range(3):
        for j in range(3):
            a_out[i, j] = s_out[i, 0] * n_out[j, 0] + s_out[i, 1] * n_out[j, 1] + s_out[i, 2] * n_out[j, 2]


@kernel
def moment_of_rotation(second_moment, f, reference_rotation, turned):
    """Return ax(A) [kg m²] of free body f, as a tuple; parameters as for `second_moment_beyond`."""
    s, n, a = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    second_moment_beyond(second_moment, f, reference_rotation, turned, s, n, a)
    return a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]


@kernel
def body_inertia(bodies, factor, at, stage, sums, with_hessian):
    """Add the inertia of free bodies and its derivatives by (X, φ); return it [J]."""
    mass, departure, turned = bodies.mass, at.body_departure, at.body_departure_quaternion
    reference = stage.predicted_body_rotation
    gradient, hessian = sums.body, sums.body_hessian
    energy = 0.0
    s, n, a = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    for b in range(mass.shape[0]):
        weight = factor * mass[b]
        second_moment_beyond(bodies.second_moment, b, reference, turned, s, n, a)
        for i in range(3):
            energy += 0.5 * weight * departure[b, i] * departure[b, i]
            gradient[b, i] += weight * departure[b, i]
            for j in range(3):
                energy += 0.5 * factor * n[i, j] * a[j, i]
        gradient[b, 3] -= factor * (a[2, 1] - a[1, 2])
        gradient[b, 4] -= factor * (a[0, 2] - a[2, 0])
        gradient[b, 5] -= factor * (a[1, 0] - a[0, 1])
        if with_hessian:
            trace = a[0, 0] + a[1, 1] + a[2, 2] + s[0, 0] + s[1, 1] + s[2, 2]
            base = 6 * b
            for i in range(3):
                hessian[base + i, base + i] += weight
                hessian[base + 3 + i, base + 3 + i] += factor * trace
                for j in range(3):
                    hessian[base + 3 + i, base + 3 + j] -= factor * (0.5 * (a[i, j] + a[j, i]) + s[i, j])
    return energy


@piece(float, int, Problem, Configuration, Stage, bool)
def add_inertial_forces(_, p, at, stage, with_hessian):
    """Add inertia, mass damping and gravity with their gradients by nodes, edges and free bodies."""
    strands, bodies, sums, h = p.strands, p.bodies, p.sums, stage.length
    mass, spin_inertia, gradient = strands.node_mass, strands.spin_inertia, sums.node
    position, origin, departure = at.position, stage.origin_position, at.departure
    if sums.selected[INERTIA]:
        factor = 1.0 / (h * stage.momentum_length)
        energy = 0.0
        for i in range(mass.shape[0]):
            weight = factor * mass[i]
            for c in range(3):
                gradient[i, c] += weight * departure[i, c]
                energy += 0.5 * weight * departure[i, c] * departure[i, c]
        energy += angle_spring(spin_inertia, factor, at.total_angle, stage.predicted_angle, sums.edge)
        sums.energy[INERTIA] = energy + body_inertia(bodies, factor, at, stage, sums, with_hessian)
    if p.damping > 0.0 and sums.selected[DAMPING]:
        factor = p.damping / h
        energy = 0.0
        for i in range(mass.shape[0]):
            weight = factor * mass[i]
            for c in range(3):
                moved = position[i, c] - origin[i, c]
                gradient[i, c] += weight * moved
                energy += 0.5 * weight * moved * moved
        energy += angle_spring(spin_inertia, factor, at.total_angle, stage.origin_angle, sums.edge)
        sums.energy[DAMPING], sums.lost[DAMPING] = energy, 2.0 * energy / h
    g = p.gravity
    if (g[0] != 0.0 or g[1] != 0.0 or g[2] != 0.0) and sums.selected[GRAVITY]:
        energy = gravity(mass, g, position, gradient)
        sums.energy[GRAVITY] = energy + gravity(bodies.mass, g, at.body_position, sums.body)
    return math.inf
