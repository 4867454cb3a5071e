"""Bond between two layers: translation, and bending and twist of the half edges where a layer ends. (The bond's
rotation is among the elements of `bend_twist`.)

    ½ Σ_α k_α (p·m̄_α − d_α)²,   m̄_α = w_a m_α^a + w_b m_α^b,   α = 1, 2, 3

with a vector p from the bottom to the top layer, the frames of two edges a and b (m3 is the tangent), and d_α the value
in the initial shape, to which natural curvature and twist of ends add theirs:

                       p                               edges                  w       k₁       k₂       k₃
    paired edges       between their midpoints         top, bottom            ½, ½    k_T l    k_T l    k_T l
    end of a layer     x_t − x_b at its last station   its last               1       0        K₃/c²    K₁/c²
    where it goes on   likewise                        before and after       1, 1    0        K₃/c²    K₁/c²

Translation (paper, eqs. 17 to 19): l is the rest length of the station, d = (c, 0, 0) for a straight bilayer, c half
its thickness. k_T is an energy per unit length [N/m²], independent of the mesh: k_T = 10 EA_r/c²,
EA_r = EA₁EA₂/(EA₁ + EA₂). (Printed is h₁ + h₂ instead of c, which makes the curvature a third too small.)

Rotation: k_b l about m2 with k_b = 10 EA_r, k_τ l about the tangent with k_τ = 10 min(GJ)/c², and about m1 only what
the shear of the bond supplies: k_φ = (GJ_lam − ΣGJ)/c² for ``torsion: laminate``, 0 for ``torsion: layers``. (In a
twisted strip the two centrelines tilt against each other by c τ about m1: a penalty there, as printed, locks twist.)

Ends. The translation of paired edges makes the mean of the x_t − x_b at either end of an edge c m1, so x_t − x_b is the
section of its station, normal to the strip. From one to the next it turns by (l_b − l_t)/c: the strains of an edge have
a curvature. A joint sees half of that of either edge, so bending has no part in the half edge beyond the last joint.
The strains there follow the eigenstrain as if the layers did not resist bending, the next edge makes up for it, and
so on, with alternating signs that decay by edges, not by lengths; and the bond slides, which loses more, since only it
hands the axial forces on. The section of the end itself is the frame that is missing. Against it, its edge has turned
by

    r = ±p·t/c,   twist ∓p·m2/c,   + where the bonded part begins, − where it ends,

over l/2, with the energy ½ K₁ (r − r̄)² + ½ K₃ (·)², K₁ = EI₁/(l/2), K₃ = GJ/(l/2), r̄ from the natural curvature. On
an arc, with the angle Δ between its edges, r = tan(Δ/2), half of the κ₁ = 2 tan(Δ/2) of joints; and since
∂r/∂p = t/c, the moment EI₁ χ acts on the end nodes with the force EI₁ χ/c, which is the layer's share of the axial
force: nothing slides, and all edges have one curvature. (A clamp holds the section, and has a joint.)

A layer that goes on past the end of the other has a joint there, with K₁ = EI₁/l, but its two halves are no longer
alike: that on the side of the other layer turns by r_b = p·t_b/c with it, the other one by r_a = −p·t_a/c. With
r_a + r_b = κ₁,

    ½ 2K₁ (r_a² + r_b²) = ½ K₁ κ₁² + ½ K₁ (r_b − r_a)²,   r_b − r_a = p·(t_a + t_b)/c,

of which the first is the joint's. The same holds for twist, with m2. These energies count as bending and twisting.

Derivatives follow from the expansions of a frame to second order (see `bend_twist`) and of the tangent; for one edge
of length l, with V = Σ_{α=1,2} Q_α m_α, V′ = Q₁ m2 − Q₂ m1, Q_α = w k_α (p·m̄_α − d_α), p⊥ = P p:

    ∂/∂ε: −(p·t) V/l + Q₃ p⊥/l                      ∂/∂θ: p·V′
    ∂²/∂ε²: [(p·t)(V tᵀ + t Vᵀ) − ½ (V p⊥ᵀ + p⊥ Vᵀ) − Q₃ (t p⊥ᵀ + p⊥ tᵀ) − Q₃ (p·t) P]/l²
    ∂²/∂θ∂ε: −(p·t) V′/l    ∂²/∂θ²: −p·V    ∂²/∂p∂ε: (−t Vᵀ + Q₃ P)/l    ∂²/∂p∂θ: V′
"""

from __future__ import annotations

import math

from bilayer_core.forces.elements import acts_viscously
from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.vector import (
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
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Space
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

BENDING, TWISTING, BOND = map(slot_of, ("bending", "twisting", "bond"))


@kernel
def _force_on_frame(edge, p, q1, q2, q3, length, t, m1, m2, edge_gradient_out):
    """Add the first derivatives of Σ Q_α p·m_α with respect to one edge's (e, θ)."""
    inverse = 1.0 / length
    pt = dot(p, t)
    v = combine(q1, m1, q2, m2)
    add_row(edge_gradient_out, edge, inverse, combine3(-pt, v, q3, p, -q3 * pt, t))
    edge_gradient_out[edge, 3] += q1 * dot(p, m2) - q2 * dot(p, m1)


@kernel
def _curvature_on_frame(edge, pair, p, q1, q2, q3, length, t, m1, m2, edge_hessian_out, mixed_hessian_out):
    """Add the second derivatives of Σ Q_α p·m_α with respect to one edge's (e, θ), and to p and these."""
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
def _strain_gradients(weight, p, length, t, m1, m2):
    """Return ∂(w p·m_α)/∂ε for α = 1, 2, 3 and ∂/∂θ for α = 1, 2 of one edge of weight w."""
    factor = weight / length
    pt = dot(p, t)
    return (
        scaled(-factor * pt, m1),
        scaled(-factor * pt, m2),
        combine(factor, p, -factor * pt, t),
        weight * dot(p, m2),
        -weight * dot(p, m1),
    )


@piece(float, Space, Problem, Configuration, Stage, bool)
def add_bonds(space, p, at, stage, with_hessian):
    """Add the translation of paired edges, and bending and twisting of ends of layers, with their derivatives by p and
    by edges.
    """
    strands, bonds, sums = p.strands, p.bonds, p.sums
    bends, twists = sums.selected[BENDING], sums.selected[TWISTING]
    paired = strands.joint_a.shape[0] - strands.bend_count
    first = 0 if sums.selected[BOND] else paired
    last = bonds.joint.shape[0] if bends or twists or acts_viscously(p) else paired
    position, joint, node, weight = at.position, bonds.joint, bonds.node, bonds.weight
    stiffness, rest_offset = stage.pair_stiffness, stage.neutral_pair
    length, tangent, director1, director2 = at.length, at.tangent, at.director1, at.director2
    edge_gradient_out, edge_hessian_out = sums.edge, sums.edge_hessian
    pair_gradient_out, pair_hessian_out, cross_hessian_out = sums.pair, sums.pair_hessian, sums.cross_hessian
    first_hessian_out, second_hessian_out = space.first_hessian, space.second_hessian
    bond = bending = twisting = 0.0
    for k in range(first, last):
        x = joint[k]
        ka, kb = strands.joint_a[x], strands.joint_b[x]
        i0, i1, j0, j1 = node[k, 0], node[k, 1], node[k, 2], node[k, 3]
        p = (
            0.5 * (position[i0, 0] + position[i1, 0] - position[j0, 0] - position[j1, 0]),
            0.5 * (position[i0, 1] + position[i1, 1] - position[j0, 1] - position[j1, 1]),
            0.5 * (position[i0, 2] + position[i1, 2] - position[j0, 2] - position[j1, 2]),
        )
        ta, m1a, m2a = row(tangent, ka), row(director1, ka), row(director2, ka)
        tb, m1b, m2b = row(tangent, kb), row(director1, kb), row(director2, kb)
        wa, wb = weight[k, 0], weight[k, 1]
        mean1 = combine(wa, m1a, wb, m1b)
        mean2 = combine(wa, m2a, wb, m2b)
        mean3 = combine(wa, ta, wb, tb)
        s1 = dot(p, mean1) - rest_offset[k, 0]
        s2 = dot(p, mean2) - rest_offset[k, 1]
        s3 = dot(p, mean3) - rest_offset[k, 2]
        c1, c2, c3 = stiffness[k, 0], stiffness[k, 1], stiffness[k, 2]
        f1, f2, f3 = c1 * s1, c2 * s2, c3 * s3
        if k < paired:
            bond += 0.5 * (f1 * s1 + f2 * s2 + f3 * s3)
        else:
            twisting += 0.5 * f2 * s2
            bending += 0.5 * f3 * s3
        add_row(pair_gradient_out, k, 1.0, combine3(f1, mean1, f2, mean2, f3, mean3))
        _force_on_frame(ka, p, wa * f1, wa * f2, wa * f3, length[ka], ta, m1a, m2a, edge_gradient_out)
        _force_on_frame(kb, p, wb * f1, wb * f2, wb * f3, length[kb], tb, m1b, m2b, edge_gradient_out)
        if not with_hessian:
            continue

        _curvature_on_frame(
            ka, k, p, wa * f1, wa * f2, wa * f3, length[ka], ta, m1a, m2a, edge_hessian_out, first_hessian_out
        )
        _curvature_on_frame(
            kb, k, p, wb * f1, wb * f2, wb * f3, length[kb], tb, m1b, m2b, edge_hessian_out, second_hessian_out
        )

        # Σ k_α ∇s ∇sᵀ over (p, e_a, θ_a, e_b, θ_b)
        a1, a2, a3, a1_theta, a2_theta = _strain_gradients(wa, p, length[ka], ta, m1a, m2a)
        b1, b2, b3, b1_theta, b2_theta = _strain_gradients(wb, p, length[kb], tb, m1b, m2b)
        add_upper_outer(pair_hessian_out, k, c1, mean1)
        add_upper_outer(pair_hessian_out, k, c2, mean2)
        add_upper_outer(pair_hessian_out, k, c3, mean3)
        add_upper_outer(edge_hessian_out, ka, c1, a1)
        add_upper_outer(edge_hessian_out, ka, c2, a2)
        add_upper_outer(edge_hessian_out, ka, c3, a3)
        add_upper_outer(edge_hessian_out, kb, c1, b1)
        add_upper_outer(edge_hessian_out, kb, c2, b2)
        add_upper_outer(edge_hessian_out, kb, c3, b3)
        a1_turn, a2_turn, b1_turn, b2_turn = c1 * a1_theta, c2 * a2_theta, c1 * b1_theta, c2 * b2_theta
        add_column(edge_hessian_out, ka, 3, 1.0, combine(a1_turn, a1, a2_turn, a2))
        add_column(edge_hessian_out, kb, 3, 1.0, combine(b1_turn, b1, b2_turn, b2))
        edge_hessian_out[ka, 3, 3] += a1_turn * a1_theta + a2_turn * a2_theta
        edge_hessian_out[kb, 3, 3] += b1_turn * b1_theta + b2_turn * b2_theta
        add_outer(first_hessian_out, k, c1, mean1, a1)
        add_outer(first_hessian_out, k, c2, mean2, a2)
        add_outer(first_hessian_out, k, c3, mean3, a3)
        add_column(first_hessian_out, k, 3, 1.0, combine(a1_turn, mean1, a2_turn, mean2))
        add_outer(second_hessian_out, k, c1, mean1, b1)
        add_outer(second_hessian_out, k, c2, mean2, b2)
        add_outer(second_hessian_out, k, c3, mean3, b3)
        add_column(second_hessian_out, k, 3, 1.0, combine(b1_turn, mean1, b2_turn, mean2))
        add_outer(cross_hessian_out, x, c1, a1, b1)
        add_outer(cross_hessian_out, x, c2, a2, b2)
        add_outer(cross_hessian_out, x, c3, a3, b3)
        add_column(cross_hessian_out, x, 3, 1.0, combine(b1_turn, a1, b2_turn, a2))
        theta_row = combine(a1_turn, b1, a2_turn, b2)
        cross_hessian_out[x, 3, 0] += theta_row[0]
        cross_hessian_out[x, 3, 1] += theta_row[1]
        cross_hessian_out[x, 3, 2] += theta_row[2]
        cross_hessian_out[x, 3, 3] += a1_turn * b1_theta + a2_turn * b2_theta
    sums.energy[BOND] += bond
    sums.energy[BENDING] += bending
    sums.energy[TWISTING] += twisting
    return math.inf
