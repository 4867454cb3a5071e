"""Smoothed Coulomb friction, lagged once per step, that may differ with the direction of sliding.

With normal force λ, normal n and contact points taken at the start of the step, the slip u of the contact points over
the step of length h gives a dissipation potential (Li et al. 2020, eq. 14; paper, eqs. 25 and 26, f₁ and u_t put
right). Let a be the forward direction in the tangent plane, s = n × a, and

    ψ(u)² = (μ± u·a)² + (μ_s u·s)²,   μ± = μ₊ where u·a ≥ 0, μ₋ elsewhere,   μ = max(μ₊, μ₋, μ_s),   w = ψ/(μ h)

    D = λ μ h f₀(w),   force −λ f₁(w) q/ψ,   q = μ±² (u·a) a + μ_s² (u·s) s

A slip along +a meets λ μ₊, one along −a λ μ₋; with equal coefficients D = μ λ h f₀(|u_t|/h). D is convex, ψ² once
continuously differentiable:

    ∂D/∂u = λ κ q =: G,   κ = f₁/(w μ h)
    ∂²D/∂u² = λ [κ (μ±² a aᵀ + μ_s² s sᵀ) + (f₁′ − f₁/w)/(w² (μ h)³) q qᵀ] =: F

The contact point of a ball moves with it: y = X + r, where the arm r turns with the ball, δr = δφ×r + ½ δφ×(δφ×r). So u
depends on both carriers' positions and rotations, and the force on one is opposite to that on the other, moment
included. F is positive semidefinite.
"""

from __future__ import annotations

import math

import numpy as np

from ..contact.barrier import barrier_gradient
from ..contact.friction_law import friction_over_speed, friction_potential, friction_slope
from ..jit import kernel


@kernel
def lag_friction(
    d_hat,
    stiffness,
    weight,
    radius,
    position,
    plane_point,
    plane_normal,
    pair_first,
    pair_second,
    first_out,
    second_out,
    pair_out,
    load_out,
    normal_out,
):
    """List the contacts at the start of a step: who, λ [N] and outward normal; return how many.

    Carrier and pair arrays are as in `forces.contact`. Outputs have room for every candidate: `first_out`,
    `second_out` (−1 for a plane),
    `pair_out` (index of the pair, −1 for a plane), `load_out` [N], `normal_out` shape (·, 3) from the second to the
    first.
    """
    count = 0
    for m in range(plane_normal.shape[0]):
        for i in range(radius.shape[0]):
            d = -radius[i]
            for j in range(3):
                d += plane_normal[m, j] * (position[i, j] - plane_point[m, j])
            if 0.0 < d < d_hat:
                first_out[count] = i
                second_out[count] = -1
                pair_out[count] = -1
                load_out[count] = -stiffness * weight[i] * barrier_gradient(d, d_hat)
                for j in range(3):
                    normal_out[count, j] = plane_normal[m, j]
                count += 1
    for k in range(pair_first.shape[0]):
        i, j = pair_first[k], pair_second[k]
        n0, n1, n2 = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1], position[i, 2] - position[j, 2]
        distance = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        d = distance - radius[i] - radius[j]
        if 0.0 < d < d_hat:
            first_out[count] = i
            second_out[count] = j
            pair_out[count] = k
            load_out[count] = -stiffness * weight[i] * barrier_gradient(d, d_hat)
            normal_out[count, 0] = n0 / distance
            normal_out[count, 1] = n1 / distance
            normal_out[count, 2] = n2 / distance
            count += 1
    return count


@kernel
def lag_axes(count, first, normal, node_edges, node_axis, tangent, director1, axis_out):
    """Forward direction of each contact in its tangent plane, unit, shape (·, 3).

    That of the rod at a node (mean of its edges), any direction for a body. A rod whose direction is along the normal
    has no forward direction there: what rounding leaves of the projection decides.
    """
    for k in range(count):
        i = first[k]
        x, y, z = 1.0, 0.0, 0.0
        if i < node_axis.shape[0]:
            p, q = node_edges[i, 0], node_edges[i, 1]
            t0, t1, t2 = tangent[p, 0] + tangent[q, 0], tangent[p, 1] + tangent[q, 1], tangent[p, 2] + tangent[q, 2]
            m0, m1, m2 = (
                director1[p, 0] + director1[q, 0],
                director1[p, 1] + director1[q, 1],
                director1[p, 2] + director1[q, 2],
            )
            x, y, z = t0, t1, t2
            if node_axis[i] == 1:
                x, y, z = m0, m1, m2
            elif node_axis[i] == 2:
                x, y, z = t1 * m2 - t2 * m1, t2 * m0 - t0 * m2, t0 * m1 - t1 * m0
        n0, n1, n2 = normal[k, 0], normal[k, 1], normal[k, 2]
        for _ in range(2):
            along = x * n0 + y * n1 + z * n2
            x, y, z = x - along * n0, y - along * n1, z - along * n2
            size = math.sqrt(x * x + y * y + z * z)
            if size > 0.0:
                x, y, z = x / size, y / size, z / size
            else:
                x, y, z = n1, n2, n0  # parallel to n only if its three components are equal
        axis_out[k, 0], axis_out[k, 1], axis_out[k, 2] = x, y, z


@kernel
def _arm(carrier, body, sign, radius, normal, k, turn, arm_out):
    """Arm from a ball's centre to its contact point, turned since the start of the step; zero for a point."""
    for i in range(3):
        arm_out[i] = 0.0
    if body >= 0:
        for i in range(3):
            for j in range(3):
                arm_out[i] += turn[body, i, j] * sign * radius[carrier] * normal[k, j]


@kernel
def friction(
    count,
    first,
    second,
    pair,
    load,
    normal,
    axis,
    coefficient,
    step_length,
    threshold,
    radius,
    position,
    origin,
    carrier_body,
    turn,
    origin_turn,
    gradient_out,
    body_gradient_out,
    hessian_out,
    pair_hessian_out,
    pair_turn_hessian_out,
    body_hessian_out,
    with_hessian,
):
    """Add the dissipation potential of the lagged contacts and return it [J].

    Parameters
    ----------
    count, first, second, pair, load, normal, axis
        From `lag_friction` and `lag_axes`.
    coefficient : Array
        μ₊, μ₋, μ_s of each carrier, the first of a pair counts, shape (n_carrier, 3).
    step_length : float
        h [s], from the origin.
    threshold : float
        Speed below which friction sticks softly, ε_v [m/s].
    radius, position, origin : Array
        Of carriers; where they are, and were at the origin of the stage [m].
    carrier_body : Array
        Free body whose ball the carrier is, −1 if none, shape (n_carrier,).
    turn, origin_turn : Array
        Rotation of each free body, now and at the origin, from its start of the step: R Rₙᵀ, R̄ Rₙᵀ, (n_free, 3, 3).
    gradient_out, hessian_out : Array
        Of carriers, shapes (n_carrier, 3), (n_carrier, 3, 3) (upper triangle); added to.
    body_gradient_out, body_hessian_out : Array
        Of free bodies' (X, φ), shapes (n_free, 6), (6 n_free, 6 n_free); rotations are added to.
    pair_hessian_out, pair_turn_hessian_out : Array
        ∂²/∂x_first ∂x_second and, where the first is a point, ∂²/∂x_first ∂φ_second, shape (n_pair, 3, 3); added to.
    with_hessian : bool
    """
    energy = 0.0
    arm_i = np.empty(3)
    arm_j = np.empty(3)
    origin_arm = np.empty(3)
    u = np.empty(3)
    g = np.empty(3)
    q = np.empty(3)
    across = np.empty(3)
    f = np.empty((3, 3))
    jacobian = np.empty((3, 12))  # of u with respect to x_i, φ_i, x_j, φ_j
    product = np.empty((3, 12))
    local = np.empty((12, 12))
    for k in range(count):
        i, j = first[k], second[k]
        bi = carrier_body[i]
        bj = carrier_body[j] if j >= 0 else -1
        _arm(i, bi, -1.0, radius, normal, k, turn, arm_i)
        _arm(i, bi, -1.0, radius, normal, k, origin_turn, origin_arm)
        for m in range(3):
            u[m] = position[i, m] - origin[i, m] + (arm_i[m] - origin_arm[m])
        if j >= 0:
            _arm(j, bj, 1.0, radius, normal, k, turn, arm_j)
            _arm(j, bj, 1.0, radius, normal, k, origin_turn, origin_arm)
            for m in range(3):
                u[m] -= position[j, m] - origin[j, m] + (arm_j[m] - origin_arm[m])
        forward = u[0] * axis[k, 0] + u[1] * axis[k, 1] + u[2] * axis[k, 2]
        across[0] = normal[k, 1] * axis[k, 2] - normal[k, 2] * axis[k, 1]
        across[1] = normal[k, 2] * axis[k, 0] - normal[k, 0] * axis[k, 2]
        across[2] = normal[k, 0] * axis[k, 1] - normal[k, 1] * axis[k, 0]
        sideways = u[0] * across[0] + u[1] * across[1] + u[2] * across[2]
        largest = max(coefficient[i, 0], coefficient[i, 1], coefficient[i, 2])
        if largest == 0.0:
            continue
        ca = (coefficient[i, 0] if forward >= 0.0 else coefficient[i, 1]) ** 2
        cs = coefficient[i, 2] ** 2
        scale = largest * step_length
        speed = math.sqrt(ca * forward * forward + cs * sideways * sideways) / scale
        energy += load[k] * scale * friction_potential(speed, threshold)
        ratio = load[k] * friction_over_speed(speed, threshold) / scale
        for m in range(3):
            q[m] = ca * forward * axis[k, m] + cs * sideways * across[m]
            g[m] = ratio * q[m]
            gradient_out[i, m] += g[m]
            if j >= 0:
                gradient_out[j, m] -= g[m]
        if bi >= 0:
            body_gradient_out[bi, 3] += arm_i[1] * g[2] - arm_i[2] * g[1]
            body_gradient_out[bi, 4] += arm_i[2] * g[0] - arm_i[0] * g[2]
            body_gradient_out[bi, 5] += arm_i[0] * g[1] - arm_i[1] * g[0]
        if bj >= 0:
            body_gradient_out[bj, 3] -= arm_j[1] * g[2] - arm_j[2] * g[1]
            body_gradient_out[bj, 4] -= arm_j[2] * g[0] - arm_j[0] * g[2]
            body_gradient_out[bj, 5] -= arm_j[0] * g[1] - arm_j[1] * g[0]
        if not with_hessian:
            continue

        excess = 0.0
        if speed > 0.0:
            bend = friction_slope(speed, threshold) - friction_over_speed(speed, threshold)
            excess = load[k] * bend / (speed * speed * scale**3)
        for m in range(3):
            for n in range(3):
                f[m, n] = excess * q[m] * q[n] + ratio * (ca * axis[k, m] * axis[k, n] + cs * across[m] * across[n])
        if bi < 0 and bj < 0:
            for m in range(3):
                for n in range(m, 3):
                    hessian_out[i, m, n] += f[m, n]
                    if j >= 0:
                        hessian_out[j, m, n] += f[m, n]
                if j >= 0:
                    for n in range(3):
                        pair_hessian_out[pair[k], m, n] -= f[m, n]
            continue

        for m in range(3):
            for n in range(12):
                jacobian[m, n] = 0.0
            jacobian[m, m] = 1.0
            if j >= 0:
                jacobian[m, 6 + m] = -1.0
        if bi >= 0:
            _add_skew(jacobian, 3, -1.0, arm_i)
        if bj >= 0:
            _add_skew(jacobian, 9, 1.0, arm_j)
        for m in range(3):
            for n in range(12):
                product[m, n] = f[m, 0] * jacobian[0, n] + f[m, 1] * jacobian[1, n] + f[m, 2] * jacobian[2, n]
        for m in range(12):
            for n in range(12):
                local[m, n] = (
                    jacobian[0, m] * product[0, n] + jacobian[1, m] * product[1, n] + jacobian[2, m] * product[2, n]
                )
        if bi >= 0:
            _add_turning(local, 3, 1.0, arm_i, g)
        if bj >= 0:
            _add_turning(local, 9, -1.0, arm_j, g)

        for m in range(3):
            for n in range(m, 3):
                hessian_out[i, m, n] += local[m, n]
                if j >= 0:
                    hessian_out[j, m, n] += local[6 + m, 6 + n]
            for n in range(3):
                if j >= 0:
                    pair_hessian_out[pair[k], m, n] += local[m, 6 + n]
                if bj >= 0 and bi < 0:
                    pair_turn_hessian_out[pair[k], m, n] += local[m, 9 + n]
                for side in range(2):
                    b = bi if side == 0 else bj
                    if b < 0:
                        continue
                    row, base = 6 * b, 6 * side
                    body_hessian_out[row + m, row + 3 + n] += local[base + m, base + 3 + n]
                    body_hessian_out[row + 3 + n, row + m] += local[base + m, base + 3 + n]
                    body_hessian_out[row + 3 + m, row + 3 + n] += local[base + 3 + m, base + 3 + n]
                if bi >= 0 and bj >= 0:
                    ri, rj = 6 * bi, 6 * bj
                    body_hessian_out[ri + m, rj + 3 + n] += local[m, 9 + n]
                    body_hessian_out[rj + 3 + n, ri + m] += local[m, 9 + n]
                    body_hessian_out[ri + 3 + m, rj + n] += local[3 + m, 6 + n]
                    body_hessian_out[rj + n, ri + 3 + m] += local[3 + m, 6 + n]
                    body_hessian_out[ri + 3 + m, rj + 3 + n] += local[3 + m, 9 + n]
                    body_hessian_out[rj + 3 + n, ri + 3 + m] += local[3 + m, 9 + n]
    return energy


@kernel
def _add_skew(matrix, column, s, a):
    """matrix[:, column:column+3] += s [a]×"""
    matrix[0, column + 1] -= s * a[2]
    matrix[0, column + 2] += s * a[1]
    matrix[1, column] += s * a[2]
    matrix[1, column + 2] -= s * a[0]
    matrix[2, column] -= s * a[1]
    matrix[2, column + 1] += s * a[0]


@kernel
def _add_turning(local, base, s, arm, g):
    """Second derivative of g·a under δa = ½ δφ×(δφ×a): ½ (a gᵀ + g aᵀ) − (a·g) I, times s."""
    product = arm[0] * g[0] + arm[1] * g[1] + arm[2] * g[2]
    for m in range(3):
        for n in range(3):
            local[base + m, base + n] += 0.5 * s * (arm[m] * g[n] + g[m] * arm[n])
        local[base + m, base + m] -= s * product
