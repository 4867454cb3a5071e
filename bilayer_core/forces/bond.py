"""Bond between the paired edges of two layers: translation. (Rotation is among the elements of `bend_twist`.)

    C_T = ½ k_T l Σ_α (p·m̄_α − d_α)²,   m̄_α = ½ (m_α^t + m_α^b),   α = 1, 2, 3        (paper, eqs. 17 to 19)

p joins the midpoints of the paired edges, bottom to top; m3 is the tangent; l is the rest length of the station, d_α
the value in the initial shape: (c, 0, 0) for a straight bilayer, c half its thickness. k_T is an energy per unit length
[N/m²], independent of the mesh: k_T = 10 EA_r/c², EA_r = EA₁EA₂/(EA₁ + EA₂). (Printed is h₁ + h₂ instead of c, which
makes the curvature a third too small.)

Rotation: k_b l about m2 with k_b = 10 EA_r, k_τ l about the tangent with k_τ = 10 min(GJ)/c², and about m1 only what
the shear of the bond supplies: k_φ = (GJ_lam − ΣGJ)/c² for ``torsion: laminate``, 0 for ``torsion: layers``. (In a
twisted strip the two centrelines tilt against each other by c τ about m1: a penalty there, as printed, locks twist.)

Derivatives follow from the expansions of a frame to second order (see `bend_twist`) and of the tangent; for one edge
of length l, with V = Σ_{α=1,2} Q_α m_α, V′ = Q₁ m2 − Q₂ m1, Q_α = ½ k_T l (p·m̄_α − d_α), p⊥ = P p:

    ∂/∂ε: −(p·t) V/l + Q₃ p⊥/l                      ∂/∂θ: p·V′
    ∂²/∂ε²: [(p·t)(V tᵀ + t Vᵀ) − ½ (V p⊥ᵀ + p⊥ Vᵀ) − Q₃ (t p⊥ᵀ + p⊥ tᵀ) − Q₃ (p·t) P]/l²
    ∂²/∂θ∂ε: −(p·t) V′/l    ∂²/∂θ²: −p·V    ∂²/∂p∂ε: (−t Vᵀ + Q₃ P)/l    ∂²/∂p∂θ: V′
"""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..kinematics.vector import (
    add_column,
    add_identity,
    add_outer,
    add_row,
    add_upper_outer,
    add_upper_projector,
    add_upper_symmetric,
    combine,
    combine3,
    dot,
    row,
    scaled,
)
from ..model.force_slots import slot_of
from ..model.records.parts import Space
from ..model.records.problem import Problem
from ..model.records.step import Configuration, Stage

BOND = slot_of("bond")


@kernel
def _force_on_frame(edge, p, q1, q2, q3, length, t, m1, m2, edge_gradient_out):
    """First derivatives of Σ Q_α p·m_α with respect to one edge's (e, θ)."""
    inverse = 1.0 / length
    pt = dot(p, t)
    v = combine(q1, m1, q2, m2)
    add_row(edge_gradient_out, edge, inverse, combine3(-pt, v, q3, p, -q3 * pt, t))
    edge_gradient_out[edge, 3] += q1 * dot(p, m2) - q2 * dot(p, m1)


@kernel
def _curvature_on_frame(edge, pair, p, q1, q2, q3, length, t, m1, m2, edge_hessian_out, mixed_hessian_out):
    """Second derivatives of Σ Q_α p·m_α with respect to one edge's (e, θ), and to p and these."""
    inverse = 1.0 / length
    pt = dot(p, t)
    v = combine(q1, m1, q2, m2)
    v_turned = combine(q1, m2, -q2, m1)
    p_perp = combine(1.0, p, -pt, t)
    s = inverse * inverse
    add_upper_symmetric(edge_hessian_out, edge, s, t, combine(pt, v, -q3, p_perp))
    add_upper_symmetric(edge_hessian_out, edge, -0.5 * s, v, p_perp)
    add_upper_projector(edge_hessian_out, edge, -s * q3 * pt, t)
    add_column(edge_hessian_out, edge, 3, -pt * inverse, v_turned)
    edge_hessian_out[edge, 3, 3] -= dot(p, v)
    add_outer(mixed_hessian_out, pair, -inverse, t, combine(1.0, v, q3, t))
    add_identity(mixed_hessian_out, pair, q3 * inverse)
    add_column(mixed_hessian_out, pair, 3, 1.0, v_turned)


@kernel
def _strain_gradients(p, length, t, m1, m2):
    """∂(p·m_α/2)/∂ε for α = 1, 2, 3 and ∂/∂θ for α = 1, 2 of one edge."""
    half = 0.5 / length
    pt = dot(p, t)
    return (
        scaled(-half * pt, m1),
        scaled(-half * pt, m2),
        combine(half, p, -half * pt, t),
        0.5 * dot(p, m2),
        -0.5 * dot(p, m1),
    )


@piece(float, Space, Problem, Configuration, Stage, bool)
def add_bonds(space, p, at, stage, with_hessian):
    """Add the translation of every pair of edges with its derivatives by their vector p and by edges."""
    strands, bonds, sums = p.strands, p.bonds, p.sums
    if not sums.selected[BOND]:
        return math.inf
    position, edge_node, edge_top, edge_bottom = at.position, strands.edge_node, bonds.top, bonds.bottom
    stiffness, rest_offset = bonds.stiffness, bonds.rest
    length, tangent, director1, director2 = at.length, at.tangent, at.director1, at.director2
    edge_gradient_out, edge_hessian_out = sums.edge, sums.edge_hessian
    pair_gradient_out, pair_hessian_out = sums.pair, sums.pair_hessian
    top_hessian_out, bottom_hessian_out = space.top_hessian, space.bottom_hessian
    cross_hessian_out = space.bond_hessian
    energy = 0.0
    for k in range(edge_top.shape[0]):
        kt, kb = edge_top[k], edge_bottom[k]
        i, j = edge_node[kt], edge_node[kb]
        p = (
            0.5 * (position[i, 0] + position[i + 1, 0] - position[j, 0] - position[j + 1, 0]),
            0.5 * (position[i, 1] + position[i + 1, 1] - position[j, 1] - position[j + 1, 1]),
            0.5 * (position[i, 2] + position[i + 1, 2] - position[j, 2] - position[j + 1, 2]),
        )
        tt, m1t, m2t = row(tangent, kt), row(director1, kt), row(director2, kt)
        tb, m1b, m2b = row(tangent, kb), row(director1, kb), row(director2, kb)
        mean1 = combine(0.5, m1t, 0.5, m1b)
        mean2 = combine(0.5, m2t, 0.5, m2b)
        mean3 = combine(0.5, tt, 0.5, tb)
        s1 = dot(p, mean1) - rest_offset[k, 0]
        s2 = dot(p, mean2) - rest_offset[k, 1]
        s3 = dot(p, mean3) - rest_offset[k, 2]
        c = stiffness[k]
        energy += 0.5 * c * (s1 * s1 + s2 * s2 + s3 * s3)
        add_row(pair_gradient_out, k, c, combine3(s1, mean1, s2, mean2, s3, mean3))
        q1, q2, q3 = 0.5 * c * s1, 0.5 * c * s2, 0.5 * c * s3
        _force_on_frame(kt, p, q1, q2, q3, length[kt], tt, m1t, m2t, edge_gradient_out)
        _force_on_frame(kb, p, q1, q2, q3, length[kb], tb, m1b, m2b, edge_gradient_out)
        if not with_hessian:
            continue

        _curvature_on_frame(kt, k, p, q1, q2, q3, length[kt], tt, m1t, m2t, edge_hessian_out, top_hessian_out)
        _curvature_on_frame(kb, k, p, q1, q2, q3, length[kb], tb, m1b, m2b, edge_hessian_out, bottom_hessian_out)

        # k_T l Σ ∇s ∇sᵀ over (p, e_t, θ_t, e_b, θ_b)
        t1, t2, t3, t1_theta, t2_theta = _strain_gradients(p, length[kt], tt, m1t, m2t)
        b1, b2, b3, b1_theta, b2_theta = _strain_gradients(p, length[kb], tb, m1b, m2b)
        add_upper_outer(pair_hessian_out, k, c, mean1)
        add_upper_outer(pair_hessian_out, k, c, mean2)
        add_upper_outer(pair_hessian_out, k, c, mean3)
        add_upper_outer(edge_hessian_out, kt, c, t1)
        add_upper_outer(edge_hessian_out, kt, c, t2)
        add_upper_outer(edge_hessian_out, kt, c, t3)
        add_upper_outer(edge_hessian_out, kb, c, b1)
        add_upper_outer(edge_hessian_out, kb, c, b2)
        add_upper_outer(edge_hessian_out, kb, c, b3)
        add_column(edge_hessian_out, kt, 3, c, combine(t1_theta, t1, t2_theta, t2))
        add_column(edge_hessian_out, kb, 3, c, combine(b1_theta, b1, b2_theta, b2))
        edge_hessian_out[kt, 3, 3] += c * (t1_theta * t1_theta + t2_theta * t2_theta)
        edge_hessian_out[kb, 3, 3] += c * (b1_theta * b1_theta + b2_theta * b2_theta)
        add_outer(top_hessian_out, k, c, mean1, t1)
        add_outer(top_hessian_out, k, c, mean2, t2)
        add_outer(top_hessian_out, k, c, mean3, t3)
        add_column(top_hessian_out, k, 3, c, combine(t1_theta, mean1, t2_theta, mean2))
        add_outer(bottom_hessian_out, k, c, mean1, b1)
        add_outer(bottom_hessian_out, k, c, mean2, b2)
        add_outer(bottom_hessian_out, k, c, mean3, b3)
        add_column(bottom_hessian_out, k, 3, c, combine(b1_theta, mean1, b2_theta, mean2))
        add_outer(cross_hessian_out, k, c, t1, b1)
        add_outer(cross_hessian_out, k, c, t2, b2)
        add_outer(cross_hessian_out, k, c, t3, b3)
        add_column(cross_hessian_out, k, 3, c, combine(b1_theta, t1, b2_theta, t2))
        theta_row = combine(c * t1_theta, b1, c * t2_theta, b2)
        cross_hessian_out[k, 3, 0] += theta_row[0]
        cross_hessian_out[k, 3, 1] += theta_row[1]
        cross_hessian_out[k, 3, 2] += theta_row[2]
        cross_hessian_out[k, 3, 3] += c * (t1_theta * b1_theta + t2_theta * b2_theta)
    sums.energy[BOND] += energy
    return math.inf
