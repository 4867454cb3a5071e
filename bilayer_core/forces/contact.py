"""Barrier contact of carriers with surfaces.

    C = K_c b(d) Δl,   force −K_c b′(d) Δl n, repulsive along the outward normal n        (paper, eq. 24; bracket's
    sign put right)

The surface of a body at X, R has the signed distance φ in its own frame. For a carrier at x with radius r, ρ = x − X:

    p = Rᵀ ρ,   d = φ(p) − r,   n = R ∇φ,   H = R ∇²φ Rᵀ
    ∂d/∂x = n,   ∂d/∂X = −n,   ∂d/∂φ = −ρ × n                                (chart R → exp([φ]×) R)

To second order p moves with y = ρ + δ − φ × (ρ + δ) + ½ φ × (φ × ρ), δ = δx − δX, so that with w = δ − φ × ρ

    d → d + n·w + ½ wᵀ H w − δ·(n × φ) + ½ ((n·φ)(ρ·φ) − (n·ρ) φ·φ)

and, with g = K_c Δl b′ n and M = K_c Δl (b″ n nᵀ + b′ H), C has the gradient (g, −g, −ρ × g) and a second derivative
whose blocks `forces.coupled` hands to nodes and bodies.
"""

from __future__ import annotations

import math

from ..contact.barrier import barrier, barrier_gradient, barrier_hessian
from ..contact.near import gap_normal
from ..contact.shapes import shape_curvature
from ..jit import kernel
from ..jit.stack import stack_matrix, stack_vector
from .coupled import add_coupled, add_force


@kernel
def surface_contact(
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
    free_index,
    carrier_gradient_out,
    contact_out,
    near_gap_out,
    node_hessian_out,
    body_hessian_out,
    links,
    link_node_out,
    link_body_out,
    link_hessian_out,
    with_hessian,
):
    """Add the barrier between every carrier and every surface near it.

    Parameters
    ----------
    d_hat : float
        Barrier distance [m].
    stiffness : float
        K_c [Pa].
    count, near_carrier, near_surface
        From `contact.near.list_near`.
    carrier, radius, weight, carrier_body : Array
        Of carriers: position [m], radius [m], Δl [m], body that carries it (−1: a node with unknowns of its own).
    kind, size, rounding, place, turn, surface_body : Array
        Of surfaces: see `contact.near.gap_normal`; and the body of each.
    body_position, free_index : Array
        Of all bodies and of the world: position [m], shape (n_body + 1, 3), and place among the free ones or −1,
        which is None if none is free.
    carrier_gradient_out, contact_out : Array
        Of carriers [N], shape (n_carrier, 3), and of (X, φ) of bodies, shape (n_body + 1, 6); added to.
    near_gap_out : Array
        Written: gaps in the order of the list [m].
    node_hessian_out, body_hessian_out, links, link_node_out, link_body_out, link_hessian_out
        See `forces.coupled`.
    with_hessian : bool

    Returns
    -------
    energy : float
        [J]; infinite if a carrier is behind a surface.
    min_gap : float
        [m]; infinite if none is near.
    links : int
        How many links are listed now.
    """
    energy = 0.0
    min_gap = math.inf
    m = stack_matrix(3, 3)
    g, arm, lever = stack_vector(3), stack_vector(3), stack_vector(3)
    arm[0] = arm[1] = arm[2] = 0.0
    for k in range(count):
        i, s = near_carrier[k], near_surface[k]
        x0, x1, x2 = carrier[i, 0], carrier[i, 1], carrier[i, 2]
        d, n0, n1, n2, p0, p1, p2 = gap_normal(kind, size, rounding, radius[i], place, turn, s, x0, x1, x2)
        near_gap_out[k] = d
        min_gap = min(min_gap, d)
        if d >= d_hat:
            continue
        if d <= 0.0:
            return math.inf, min_gap, links
        a, b = carrier_body[i], surface_body[s]
        c = stiffness * weight[i]
        energy += c * barrier(d, d_hat)
        slope = c * barrier_gradient(d, d_hat)
        g[0], g[1], g[2] = slope * n0, slope * n1, slope * n2
        lever[0], lever[1], lever[2] = x0 - body_position[b, 0], x1 - body_position[b, 1], x2 - body_position[b, 2]
        for j in range(3):
            carrier_gradient_out[i, j] += g[j]
        if a >= 0:
            arm[0], arm[1], arm[2] = x0 - body_position[a, 0], x1 - body_position[a, 1], x2 - body_position[a, 2]
            add_force(contact_out, a, 1.0, arm, g)
        add_force(contact_out, b, -1.0, lever, g)
        if not with_hessian:
            continue
        curve = c * barrier_hessian(d, d_hat)
        h = shape_curvature(kind[s], size[s, 0], size[s, 1], size[s, 2], p0, p1, p2)
        _in_world(turn, s, slope, h, m)
        m[0, 0] += curve * n0 * n0
        m[0, 1] += curve * n0 * n1
        m[0, 2] += curve * n0 * n2
        m[1, 1] += curve * n1 * n1
        m[1, 2] += curve * n1 * n2
        m[2, 2] += curve * n2 * n2
        links = add_coupled(
            m,
            g,
            arm,
            lever,
            1.0,
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
    return energy, min_gap, links


@kernel
def _in_world(turn, s, factor, h, m_out):
    """Upper triangle of factor R h Rᵀ, h a symmetric matrix as (h₀₀, h₀₁, h₀₂, h₁₁, h₁₂, h₂₂)."""
    for i in range(3):
        r0, r1, r2 = factor * turn[s, i, 0], factor * turn[s, i, 1], factor * turn[s, i, 2]
        v0 = r0 * h[0] + r1 * h[1] + r2 * h[2]
        v1 = r0 * h[1] + r1 * h[3] + r2 * h[4]
        v2 = r0 * h[2] + r1 * h[4] + r2 * h[5]
        for j in range(i, 3):
            m_out[i, j] = v0 * turn[s, j, 0] + v1 * turn[s, j, 1] + v2 * turn[s, j, 2]
