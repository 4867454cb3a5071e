"""Barrier contact of contact points with surfaces.

    C = K_c b(d) Δl,   force −K_c b′(d) Δl n, repulsive along the outward normal n        (paper, eq. 24; bracket's
    sign put right)

The surface of a body at X, R has the signed distance φ in its own frame. For a contact point at x with radius r,
ρ = x − X:

    p = Rᵀ ρ,   d = φ(p) − r,   n = R ∇φ,   H = R ∇²φ Rᵀ
    ∂d/∂x = n,   ∂d/∂X = −n,   ∂d/∂φ = −ρ × n                                (chart R → exp([φ]×) R)

To second order p moves with y = ρ + δ − φ × (ρ + δ) + ½ φ × (φ × ρ), δ = δx − δX, so that with w = δ − φ × ρ

    d → d + n·w + ½ wᵀ H w − δ·(n × φ) + ½ ((n·φ)(ρ·φ) − (n·ρ) φ·φ)

and, with g = K_c Δl b′ n and M = K_c Δl (b″ n nᵀ + b′ H), C has the gradient (g, −g, −ρ × g) and a second derivative
whose blocks `forces.contact_on_bodies` hands to nodes and bodies, `forces.rod_arms` to what holds a contact point off
its node.
"""

from __future__ import annotations

import math

from bilayer_core.contact.barrier import barrier, barrier_gradient, barrier_hessian
from bilayer_core.contact.gap import gap_normal, place_of, stands_aside
from bilayer_core.contact.shapes import shape_curvature
from bilayer_core.forces.contact_on_bodies import add_force, add_second_derivative
from bilayer_core.forces.restitution import RESTITUTION, damping_at
from bilayer_core.forces.rod_arms import add_to_edges, new_arm, write_curvature, write_material_rate
from bilayer_core.forces.surface_pairs import list_surface_pairs
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.contacts import Surfaces
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

BARRIER = slot_of("barrier")


@kernel
def _in_world(axes, s, factor, h, m_out):
    """Write the upper triangle of factor R h Rᵀ, h a symmetric matrix as (h₀₀, h₀₁, h₀₂, h₁₁, h₁₂, h₂₂)."""
    for i in range(3):
        r0, r1, r2 = factor * axes[s, i, 0], factor * axes[s, i, 1], factor * axes[s, i, 2]
        v0 = r0 * h[0] + r1 * h[1] + r2 * h[2]
        v1 = r0 * h[1] + r1 * h[3] + r2 * h[4]
        v2 = r0 * h[2] + r1 * h[4] + r2 * h[5]
        for j in range(i, 3):
            m_out[i, j] = v0 * axes[s, j, 0] + v1 * axes[s, j, 1] + v2 * axes[s, j, 2]


@piece(float, Surfaces, Problem, Configuration, Stage, bool)
def add_surface_barrier(surfaces, p, at, stage, with_hessian):
    """Add the barrier between every contact point and every surface near it; returns the smallest gap [m].

    The energy is infinite if a contact point is behind a surface. The gaps of the list of near pairs are written.
    """
    sums, min_gap = p.sums, math.inf
    damped = p.restitution.exists and sums.selected[RESTITUTION]
    if not (sums.selected[BARRIER] or damped):
        return min_gap
    d_hat, size, elastic = surfaces.d_hat, surfaces.size, 1.0 * sums.selected[BARRIER]
    energy = of_damping = lost = part = beta = 0.0
    m = stack_matrix(3, 3)
    g, n, arm, lever = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    arm[0] = arm[1] = arm[2] = 0.0
    for k in range(surfaces.near_count[0]):
        i, s = surfaces.near_contact_point[k], surfaces.near_surface[k]
        x = place_of(surfaces, at, k)
        d, n[0], n[1], n[2], p0, p1, p2 = gap_normal(surfaces, at, surfaces.near_radius[k], s, x[0], x[1], x[2])
        surfaces.near_gap[k], surfaces.near_force[k] = d, 0.0
        if d < d_hat and stands_aside(surfaces, k):
            continue
        min_gap = min(min_gap, d)
        if d >= d_hat:
            continue
        if d <= 0.0:
            energy = math.inf
            break
        if surfaces.near_weight[k] == 0.0:
            continue
        a, b = surfaces.contact_point_body[i], surfaces.body[s]
        stiffness = surfaces.stiffness * surfaces.near_weight[k]
        energy += elastic * stiffness * barrier(d, d_hat)
        slope = stiffness * barrier_gradient(d, d_hat)
        if damped:
            part, beta, damping = damping_at(p, stage, i, s, d)
            of_damping += stiffness * damping
            if part != 0.0:
                origin = stage.origin_strain[p.restitution.first + p.restitution.row[i, s]]
                lost -= slope * part * (d - origin) / stage.length
        curvature = stiffness * barrier_hessian(d, d_hat) * (elastic - part) - beta * slope
        slope *= elastic - part
        surfaces.near_force[k] = -slope
        node = surfaces.near_node[k]
        for c in range(3):
            g[c] = slope * n[c]
            lever[c] = x[c] - at.pose_position[b, c]
            sums.contact_point[node, c] += g[c]
        r = -1
        if surfaces.near_arm[k]:
            r = sums.arms[0]
            write_material_rate(surfaces, at, k, r, sums.arm_rate)
            add_to_edges(surfaces, node, g, r, sums.arm_rate, sums.edge)
        if a >= 0:
            for c in range(3):
                arm[c] = x[c] - at.pose_position[a, c]
            add_force(sums.contact, a, 1.0, arm, g)
        add_force(sums.contact, b, -1.0, lever, g)
        if with_hessian:
            h = shape_curvature(surfaces.kind[s], size[s, 0], size[s, 1], size[s, 2], p0, p1, p2)
            _in_world(at.surface_rotation, s, slope, h, m)
            for c in range(3):
                for e in range(c, 3):
                    m[c, e] += curvature * n[c] * n[e]
            if r >= 0:
                r = new_arm(sums, node)
                write_curvature(surfaces, at, k, g, r, sums)
            add_second_derivative(p, m, g, arm, lever, 1.0, node, r, a, b)
    sums.energy[BARRIER] = energy
    if damped:
        sums.energy[RESTITUTION], sums.lost[RESTITUTION] = of_damping, lost
    return min_gap


@piece(int, Surfaces, Problem, Configuration, Stage)
def start_surface_barrier(surfaces, p, start, stage):
    """List the pairs that are near at the start of a stage; returns a status."""
    if surfaces.divides:
        surfaces.margin[0] = -1.0  # weights are those at the start
        return list_surface_pairs(surfaces, start, surfaces.d_hat)
    return list_surface_pairs(surfaces, start, 0.0)
