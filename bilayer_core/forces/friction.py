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

A contact point on a body moves with it: y = X + a, where the arm a from the body's position turns with the body,
δa = δφ × a + ½ δφ × (δφ × a). So u, the motion of the carrier's contact point relative to that of the surface, depends
on the motion of both (`forces.coupled`), and the force on one side is opposite to that on the other. Between two bodies
the contact point is one, on the carrier's face, x − r n, and so the moments cancel as well. A node carries no moment:
it slips with its centreline over the point of the surface below it. F is positive semidefinite.
"""

from __future__ import annotations

import math

from ..contact.barrier import barrier_gradient
from ..contact.friction_law import friction_over_speed, friction_potential, friction_slope
from ..contact.near import gap_normal
from ..jit import kernel
from ..jit.stack import stack_matrix, stack_vector
from .coupled import add_coupled, add_force


@kernel
def lag_friction(
    d_hat,
    stiffness,
    count,
    near_carrier,
    near_surface,
    carrier,
    radius,
    weight,
    carrier_body,
    kind,
    size,
    rounding,
    place,
    turn,
    surface_body,
    body_position,
    first_out,
    surface_out,
    load_out,
    normal_out,
    arm_out,
    lever_out,
):
    """List the contacts at the start of a step; return how many.

    Inputs are as for `contact.surface_contact`. Outputs have room for every pair of the list: `first_out` the carrier,
    `surface_out` the surface, `load_out` λ [N], `normal_out` the outward normal of the surface, `arm_out` and
    `lever_out` the arms [m] of the contact point on the carrier's body (zero for a node) and on that of the surface,
    shapes (·, 3).
    """
    contacts = 0
    for k in range(count):
        i, s = near_carrier[k], near_surface[k]
        x0, x1, x2 = carrier[i, 0], carrier[i, 1], carrier[i, 2]
        d, n0, n1, n2, _, _, _ = gap_normal(kind, size, rounding, radius[i], place, turn, s, x0, x1, x2)
        if not 0.0 < d < d_hat:
            continue
        a, b = carrier_body[i], surface_body[s]
        below = radius[i] if a >= 0 else radius[i] + d
        y0, y1, y2 = x0 - below * n0, x1 - below * n1, x2 - below * n2
        first_out[contacts] = i
        surface_out[contacts] = s
        load_out[contacts] = -stiffness * weight[i] * barrier_gradient(d, d_hat)
        normal_out[contacts, 0], normal_out[contacts, 1], normal_out[contacts, 2] = n0, n1, n2
        lever_out[contacts, 0] = y0 - body_position[b, 0]
        lever_out[contacts, 1] = y1 - body_position[b, 1]
        lever_out[contacts, 2] = y2 - body_position[b, 2]
        arm_out[contacts, 0] = y0 - body_position[a, 0] if a >= 0 else 0.0
        arm_out[contacts, 1] = y1 - body_position[a, 1] if a >= 0 else 0.0
        arm_out[contacts, 2] = y2 - body_position[a, 2] if a >= 0 else 0.0
        contacts += 1
    return contacts


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
def _slip(body, turn, origin_turn, place, origin_place, arm, k, sign, arm_now, slip):
    """Add ± the displacement of a point of a body since the origin, and write its arm now."""
    for i in range(3):
        now, before = 0.0, 0.0
        for j in range(3):
            now += turn[body, i, j] * arm[k, j]
            before += origin_turn[body, i, j] * arm[k, j]
        arm_now[i] = now
        slip[i] += sign * (place[body, i] - origin_place[body, i] + (now - before))


@kernel
def _slip_rate(body, body_motion, arm, sign, rate):
    """Add ± the displacement of a point of a body in a step of its position and rotation vector."""
    p0, p1, p2 = body_motion[body, 3], body_motion[body, 4], body_motion[body, 5]
    rate[0] += sign * (body_motion[body, 0] + p1 * arm[2] - p2 * arm[1])
    rate[1] += sign * (body_motion[body, 1] + p2 * arm[0] - p0 * arm[2])
    rate[2] += sign * (body_motion[body, 2] + p0 * arm[1] - p1 * arm[0])


@kernel
def slip_along(
    count,
    first,
    surface,
    load,
    normal,
    axis,
    arm,
    lever,
    coefficient,
    step_length,
    position,
    origin_position,
    carrier_body,
    surface_body,
    place,
    origin_place,
    body_turn,
    origin_turn,
    node_step,
    body_motion,
    way_out,
):
    """Write the way of every lagged contact in a Newton step, see `forces.slip`.

    Parameters
    ----------
    count … origin_turn
        As for `friction`.
    node_step, body_motion : Array
        Displacement of nodes [m], and displacement [m] and rotation vector [rad] of bodies and of the world, shapes
        (n_node, 3), (n_body + 1, 6).
    way_out : Array
        Written: shape (≥ count, `slip.WAY`).
    """
    arm_a, arm_b, u, rate = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    for k in range(count):
        i = first[k]
        a, b = carrier_body[i], surface_body[surface[k]]
        for m in range(3):
            u[m] = rate[m] = 0.0
        if a >= 0:
            _slip(a, body_turn, origin_turn, place, origin_place, arm, k, 1.0, arm_a, u)
            _slip_rate(a, body_motion, arm_a, 1.0, rate)
        else:
            for m in range(3):
                u[m], rate[m] = position[i, m] - origin_position[i, m], node_step[i, m]
        _slip(b, body_turn, origin_turn, place, origin_place, lever, k, -1.0, arm_b, u)
        _slip_rate(b, body_motion, arm_b, -1.0, rate)
        a0, a1, a2 = axis[k, 0], axis[k, 1], axis[k, 2]
        s0 = normal[k, 1] * a2 - normal[k, 2] * a1
        s1 = normal[k, 2] * a0 - normal[k, 0] * a2
        s2 = normal[k, 0] * a1 - normal[k, 1] * a0
        way_out[k, 0], way_out[k, 1] = u[0] * a0 + u[1] * a1 + u[2] * a2, rate[0] * a0 + rate[1] * a1 + rate[2] * a2
        way_out[k, 2], way_out[k, 3] = u[0] * s0 + u[1] * s1 + u[2] * s2, rate[0] * s0 + rate[1] * s1 + rate[2] * s2
        largest = 0.0
        for m in range(3):
            way_out[k, 4 + m] = coefficient[i, m] ** 2
            largest = max(largest, coefficient[i, m])
        way_out[k, 7], way_out[k, 8] = (load[k], largest * step_length) if largest > 0.0 else (0.0, step_length)


@kernel
def friction(
    count,
    first,
    surface,
    load,
    normal,
    axis,
    arm,
    lever,
    coefficient,
    step_length,
    threshold,
    position,
    origin_position,
    carrier_body,
    surface_body,
    place,
    origin_place,
    body_turn,
    origin_turn,
    free_index,
    carrier_gradient_out,
    contact_out,
    node_hessian_out,
    body_hessian_out,
    links,
    link_node_out,
    link_body_out,
    link_hessian_out,
    with_hessian,
):
    """Add the dissipation potential of the lagged contacts.

    Parameters
    ----------
    count, first, surface, load, normal, axis, arm, lever
        From `lag_friction` and `lag_axes`.
    coefficient : Array
        μ₊, μ₋, μ_s of each carrier, shape (n_carrier, 3).
    step_length : float
        h [s], from the origin.
    threshold : float
        Speed below which friction sticks softly, ε_v [m/s].
    position, origin_position : Array
        Of nodes now and at the origin of the stage [m].
    carrier_body, surface_body : Array
        Body of each carrier (−1: a node with unknowns of its own) and of each surface.
    place, origin_place : Array
        Positions of bodies and of the world now and at the origin [m], shape (n_body + 1, 3).
    body_turn, origin_turn : Array
        Their rotations from the start of the step, R Rₙᵀ and R̄ Rₙᵀ, shape (n_body + 1, 3, 3).
    free_index, carrier_gradient_out, contact_out
        As for `contact.surface_contact`.
    node_hessian_out, body_hessian_out, links, link_node_out, link_body_out, link_hessian_out
        See `forces.coupled`.
    with_hessian : bool

    Returns
    -------
    energy : float
        [J].
    links : int
        How many links are listed now.
    """
    energy = 0.0
    arm_a, arm_b, u = stack_vector(3), stack_vector(3), stack_vector(3)
    g, q, across = stack_vector(3), stack_vector(3), stack_vector(3)
    f = stack_matrix(3, 3)
    arm_a[0] = arm_a[1] = arm_a[2] = 0.0
    for k in range(count):
        i = first[k]
        largest = max(coefficient[i, 0], coefficient[i, 1], coefficient[i, 2])
        if largest == 0.0:
            continue
        a, b = carrier_body[i], surface_body[surface[k]]
        u[0] = u[1] = u[2] = 0.0
        if a >= 0:
            _slip(a, body_turn, origin_turn, place, origin_place, arm, k, 1.0, arm_a, u)
        else:
            for m in range(3):
                u[m] = position[i, m] - origin_position[i, m]
        _slip(b, body_turn, origin_turn, place, origin_place, lever, k, -1.0, arm_b, u)
        forward = u[0] * axis[k, 0] + u[1] * axis[k, 1] + u[2] * axis[k, 2]
        across[0] = normal[k, 1] * axis[k, 2] - normal[k, 2] * axis[k, 1]
        across[1] = normal[k, 2] * axis[k, 0] - normal[k, 0] * axis[k, 2]
        across[2] = normal[k, 0] * axis[k, 1] - normal[k, 1] * axis[k, 0]
        sideways = u[0] * across[0] + u[1] * across[1] + u[2] * across[2]
        ca = (coefficient[i, 0] if forward >= 0.0 else coefficient[i, 1]) ** 2
        cs = coefficient[i, 2] ** 2
        scale = largest * step_length
        speed = math.sqrt(ca * forward * forward + cs * sideways * sideways) / scale
        energy += load[k] * scale * friction_potential(speed, threshold)
        ratio = load[k] * friction_over_speed(speed, threshold) / scale
        for m in range(3):
            q[m] = ca * forward * axis[k, m] + cs * sideways * across[m]
            g[m] = ratio * q[m]
            carrier_gradient_out[i, m] += g[m]
        if a >= 0:
            add_force(contact_out, a, 1.0, arm_a, g)
        add_force(contact_out, b, -1.0, arm_b, g)
        if not with_hessian:
            continue
        excess = 0.0
        if speed > 0.0:
            bend = friction_slope(speed, threshold) - friction_over_speed(speed, threshold)
            excess = load[k] * bend / (speed * speed * scale**3)
        for m in range(3):
            for n in range(m, 3):
                f[m, n] = excess * q[m] * q[n] + ratio * (ca * axis[k, m] * axis[k, n] + cs * across[m] * across[n])
        links = add_coupled(
            f,
            g,
            arm_a,
            arm_b,
            -1.0,
            i,
            a,
            b,
            free_index,
            node_hessian_out,
            body_hessian_out,
            links,
            link_node_out,
            link_body_out,
            link_hessian_out,
        )
    return energy, links
