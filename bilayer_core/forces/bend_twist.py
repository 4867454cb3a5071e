"""Bending and twisting between two edges a and b.

    B = ½ k₁ (κ₁ − κ̄₁)² + ½ k₂ (κ₂ − κ̄₂)² + ½ k₃ (ψ − ψ̄)²        (paper, eqs. 10 to 13)

At an inner node k₁ = EI₁/Δl, k₂ = EI₂/Δl, k₃ = GJ/Δl and κ₁ = χ Δl, κ₂ = ξ Δl, ψ = τ Δl with the Voronoi length Δl.
The elements of bonds, which come last, are the same with other stiffnesses (`bond`): they tie the frames of two bonded
layers together.

Strains. With unit tangents a, b, directors mα of either edge, and c = 1 + a·b, the curvature binormal 2 a×b/c projected
on the mean of the directors is

    κ_α = (b·mα_a − a·mα_b)/c,   α = 1, 2,

because (a×b)·m2_a = b·m1_a and so on (κ₁ belongs to bending through the thickness, χ = m1·t′). ψ is the angle about b
from the parallel-transported m1_a to m1_b.

Derivatives. An increment (ε, θ) of an edge of length l moves its frame by parallel transport and turns it by θ; to
second order, with ε⊥ = P ε, P = I − a aᵀ, and m′ = ∂m/∂θ (m1′ = m2, m2′ = −m1):

    a → a + ε⊥/l − (a·ε) ε⊥/l² − ½ |ε⊥|² a/l²
    m → m − a (m·ε)/l + θ m′ + a (m·ε)(a·ε)/l² − ½ (m·ε) ε⊥/l² − θ a (m′·ε)/l − ½ θ² m

Only ε⊥ and θ change the strains, so all derivatives live in the plane of the two directors: below, vectors of edge a
have two components along m1_a, m2_a, those of edge b along m1_b, m2_b, and stand for derivatives with respect to
ε/l. With

    p_i = b·mi_a,   q_i = a·mi_b,   R_ij = mi_a·mj_b,   s = a·b,   Gα = kα (κα − κ̄α),   M = (G₁, G₂),   M′ = (−G₂, G₁)

insert both into f = Σ Gα κα for fixed Gα, and collect:

    ∂κα/∂a = −(s eα + R eα + κα p)/c,       ∂κα/∂b = (s eα + Rᵀ eα − κα q)/c,       eα the unit vectors
    ∂κ₁/∂θ_a = p₂/c,  ∂κ₂/∂θ_a = −p₁/c,     ∂κ₁/∂θ_b = −q₂/c,  ∂κ₂/∂θ_b = q₁/c
    ∂²f/∂a²  = −[p (∂f/∂a + ½ M)ᵀ + (∂f/∂a + ½ M) pᵀ − (q·M + f s) I]/c
    ∂²f/∂b²  = −[q (∂f/∂b − ½ M)ᵀ + (∂f/∂b − ½ M) qᵀ + (p·M − f s) I]/c
    ∂²f/∂a∂b = −[(∂f/∂a + M) qᵀ + p (∂f/∂b − M)ᵀ + f R]/c
    ∂²f/∂a∂θ_a = −[s M′ + f_a p]/c,         ∂²f/∂b∂θ_a = [Rᵀ M′ − f_a q]/c,         f_a = ∂f/∂θ_a
    ∂²f/∂b∂θ_b =  [s M′ − f_b q]/c,         ∂²f/∂a∂θ_b = −[R M′ + f_b p]/c,         f_b = ∂f/∂θ_b
    ∂²f/∂θ_a² = −p·M/c,    ∂²f/∂θ_b² = q·M/c,    ∂²f/∂θ_a∂θ_b = 0

The second derivatives of bending are Σ kα ∂κα ∂καᵀ + ∂²f. For the twist (Bergou et al. 2010; Panetta et al. 2019),
with J a quarter turn, J (x, y) = (−y, x):

    ∂ψ/∂a = J p/c = h,   ∂ψ/∂b = −J q/c = j,   ∂ψ/∂θ_b = −∂ψ/∂θ_a = 1
    ∂²ψ/∂a² = −(h pᵀ + p hᵀ)/(2 c),   ∂²ψ/∂b² = −(j qᵀ + q jᵀ)/(2 c),   ∂²ψ/∂a∂b = (J R − h qᵀ)/c

The tangent comes in only where ε turns the plane: with g = ∂B/∂a, ∂²B/∂ε_a² has −(a gᵀ + g aᵀ)/l_a² beside the above.

All is exact where θ = 0, that is at the configuration whose own frames are given.

Stretching that bends. Where a curve is off the neutral axis of its section, a joint's natural curvature follows the
strains of its two edges (`model.laminate`): with r = κ₁ − κ̄₁ and

    κ̄₁ = κ̄₁(rest) + b_a ε_a + b_b ε_b,   ε = |e|/|ē| − 1,

the energy is ½ k₁ r². Beside the derivatives through κ₁, above, there are, with t the tangent of an edge and
P = I − t tᵀ,

    ∂/∂e_i      −k₁ r b_i t_i/|ē_i|
    ∂²/∂e_i²    k₁ b_i² t_i t_iᵀ/|ē_i|² − k₁ r b_i P_i/(|ē_i| |e_i|) − k₁ (∂κ₁/∂e_i t_iᵀ + t_i ∂κ₁/∂e_iᵀ) b_i/|ē_i|
    ∂²/∂e_a∂e_b k₁ b_a b_b t_a t_bᵀ/(|ē_a| |ē_b|) − k₁ b_a t_a ∂κ₁/∂e_bᵀ/|ē_a| − k₁ b_b ∂κ₁/∂e_a t_bᵀ/|ē_b|

and the products of t_i with ∂κ₁/∂θ.

Strips. Beside these squares a strip has F(κ₁, ψ), `forces.flattening`. Its first derivatives are added to G₁ and to the
moment of twist, its second ones to k₁ and k₃, and there is k₁₃ (∂κ₁ ∂ψᵀ + ∂ψ ∂κ₁ᵀ). The piece for scenes with strips is
made from the same source as that for rods alone, which costs no more for it.
"""

from __future__ import annotations

import math

from bilayer_core.forces.elements import acts_viscously
from bilayer_core.forces.flattening import strip_law, viscous_coupling
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.piece import Piece
from bilayer_core.kinematics.vector import (
    add_column,
    add_outer,
    add_outer_sum,
    add_row,
    add_upper_outer,
    add_upper_outer_sum,
    add_upper_projector,
    add_upper_symmetric,
    angle,
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

BENDING, TWISTING, FLATTENING, BOND = map(slot_of, ("bending", "twisting", "flattening", "bond"))
TWO_PI = 2.0 * math.pi


@kernel
def bending_strain(at, a, b):
    """Return κ₁ between edges a and b of a configuration as it is: that in `joint_strain` is from before Newton's last
    correction.
    """
    tangent_a, tangent_b = row(at.tangent, a), row(at.tangent, b)
    bend = dot(tangent_b, row(at.director1, a)) - dot(tangent_a, row(at.director1, b))
    return bend / (1.0 + dot(tangent_a, tangent_b))


@kernel
def bend_by_strains(off_axis, strands, at, neutral):
    """Write κ̄₁ κ̄₂ ψ̄ of joints at the present strains of edges [rad], from those without any, into `OffAxis.rest`."""
    joint, slope, rest = off_axis.joint, off_axis.slope, off_axis.rest
    length, rest_length = at.length, strands.rest_length
    for k in range(rest.shape[0]):
        for c in range(3):
            rest[k, c] = neutral[k, c]
    for i in range(joint.shape[0]):
        k = joint[i]
        a, b = strands.joint_a[k], strands.joint_b[k]
        shift = 0.0
        if slope[i, 0] != 0.0:  # a clamp edge has none, and no rest length
            shift += slope[i, 0] * (length[a] - rest_length[a])
        if slope[i, 1] != 0.0:
            shift += slope[i, 1] * (length[b] - rest_length[b])
        rest[k, 0] += shift


@kernel
def stretch_bend(off_axis, strands, stage, at, sums, with_hessian):
    """Add the derivatives of bending through κ̄₁, which `bend_by_strains` has left, to those of edges."""
    joint, slope, rest = off_axis.joint, off_axis.slope, off_axis.rest
    edge_a, edge_b, stiffness, strain = strands.joint_a, strands.joint_b, stage.joint_stiffness, at.joint_strain
    length, tangent = at.length, at.tangent
    director1, director2, gradient_out = at.director1, at.director2, sums.edge
    hessian_out, cross_out = sums.edge_hessian, sums.cross_hessian
    for i in range(joint.shape[0]):
        k = joint[i]
        ka, kb = edge_a[k], edge_b[k]
        sa, sb = slope[i, 0], slope[i, 1]  # ∂κ̄₁/∂e = s t
        k1 = stiffness[k, 0]
        moment = k1 * (strain[k, 0] - rest[k, 0])
        a, b = row(tangent, ka), row(tangent, kb)
        add_row(gradient_out, ka, -moment * sa, a)
        add_row(gradient_out, kb, -moment * sb, b)
        if not with_hessian:
            continue
        m1a, m2a = row(director1, ka), row(director2, ka)
        m1b, m2b = row(director1, kb), row(director2, kb)
        ab = dot(a, b)
        ic = 1.0 / (1.0 + ab)
        kappa = strain[k, 0]
        ua = combine3(ab, m1a, 1.0, combine(1.0, m1b, -dot(a, m1b), a), kappa, combine(1.0, b, -ab, a))
        wb = combine3(ab, m1b, 1.0, combine(1.0, m1a, -dot(b, m1a), b), -kappa, combine(1.0, a, -ab, b))
        da, db = scaled(-ic / length[ka], ua), scaled(ic / length[kb], wb)  # ∂κ₁/∂e
        ta, tb = dot(b, m2a) * ic, -dot(a, m2b) * ic  # ∂κ₁/∂θ
        add_upper_outer(hessian_out, ka, k1 * sa * sa, a)
        add_upper_outer(hessian_out, kb, k1 * sb * sb, b)
        add_upper_projector(hessian_out, ka, -moment * sa / length[ka], a)
        add_upper_projector(hessian_out, kb, -moment * sb / length[kb], b)
        add_upper_symmetric(hessian_out, ka, -k1 * sa, a, da)
        add_upper_symmetric(hessian_out, kb, -k1 * sb, b, db)
        add_column(hessian_out, ka, 3, -k1 * sa * ta, a)
        add_column(hessian_out, kb, 3, -k1 * sb * tb, b)
        add_outer(cross_out, k, -k1 * sa, a, combine(1.0, db, -sb, b))
        add_outer(cross_out, k, -k1 * sb, da, b)
        add_column(cross_out, k, 3, -k1 * sa * tb, a)
        for n in range(3):
            cross_out[k, 3, n] -= k1 * sb * ta * b[n]


def _add_bending(strips: bool) -> Piece:
    """Return the piece for rods with strips among them, or without."""

    def add_bending(_, p, at, stage, with_hessian):
        """Add bending and twisting, and bonds as far as they are of this kind, with their derivatives by edges.

        ψ is unwrapped from the twist at the start of the stage.
        """
        strands, sums, off_axis, rest = p.strands, p.sums, p.off_axis, stage.neutral_joint
        edge_a, edge_b, stiffness, previous_twist = strands.joint_a, strands.joint_b, stage.joint_stiffness, stage.twist
        length, tangent, director1, director2 = at.length, at.tangent, at.director1, at.director2
        strain_out, gradient_out, hessian_out, cross_out = (
            at.joint_strain,
            sums.edge,
            sums.edge_hessian,
            sums.cross_hessian,
        )
        viscous, bend_count = acts_viscously(p), strands.bend_count
        bends, ties = sums.selected[BENDING] or sums.selected[TWISTING] or viscous, sums.selected[BOND] or viscous
        if strips:
            flattening, strip, flattened = p.flattening, 0, 0.0
            flattens = sums.selected[FLATTENING]
            bends |= flattens
        first, last = 0 if bends else bend_count, edge_a.shape[0] if ties else bend_count
        if off_axis.exists and bends:
            bend_by_strains(off_axis, strands, at, rest)
            rest = off_axis.rest
        bending = twisting = bond = 0.0
        for k in range(first, last):
            ka, kb = edge_a[k], edge_b[k]
            a, b = row(tangent, ka), row(tangent, kb)
            m1a, m2a = row(director1, ka), row(director2, ka)
            m1b, m2b = row(director1, kb), row(director2, kb)
            ila, ilb = 1.0 / length[ka], 1.0 / length[kb]
            s = dot(a, b)
            ic = 1.0 / (1.0 + s)
            p1, p2, q1, q2 = dot(b, m1a), dot(b, m2a), dot(a, m1b), dot(a, m2b)
            r11, r12, r21, r22 = dot(m1a, m1b), dot(m1a, m2b), dot(m2a, m1b), dot(m2a, m2b)

            kappa1, kappa2 = (p1 - q1) * ic, (p2 - q2) * ic
            psi = angle(r11 - p1 * q1 * ic, r21 - p2 * q1 * ic)
            psi += TWO_PI * math.floor((previous_twist[k] - psi) / TWO_PI + 0.5)
            strain_out[k, 0] = kappa1
            strain_out[k, 1] = kappa2
            strain_out[k, 2] = psi

            k1, k2, k3 = stiffness[k, 0], stiffness[k, 1], stiffness[k, 2]
            d1, d2, d3 = kappa1 - rest[k, 0], kappa2 - rest[k, 1], psi - rest[k, 2]
            g1, g2, g3 = k1 * d1, k2 * d2, k3 * d3
            if k < bend_count:
                bending += 0.5 * (g1 * d1 + g2 * d2)
                twisting += 0.5 * g3 * d3
            else:
                bond += 0.5 * (g1 * d1 + g2 * d2 + g3 * d3)
            if strips:
                k13 = 0.0
                if strip < flattening.joint.shape[0] and flattening.joint[strip] == k:
                    if flattens:
                        energy, f1, f3, k11, k13, k33, _, _ = strip_law(
                            flattening, stage.rest_joint, strip, k, kappa1, psi
                        )
                        flattened, g1, g3 = flattened + energy, g1 + f1, g3 + f3
                        k1, k3 = k1 + k11, k3 + k33
                    if viscous:
                        lag, kappa0, psi0 = viscous_coupling(p, stage, strip)
                        g1, g3, k13 = g1 + lag * (psi - psi0), g3 + lag * (kappa1 - kappa0), k13 + lag
                    strip += 1

            # of κ₁, κ₂ and ψ, components 1 and 2: u, v, h with respect to a, w, z, j to b
            u1, u2 = -(s + r11 + kappa1 * p1) * ic, -(r21 + kappa1 * p2) * ic
            v1, v2 = -(r12 + kappa2 * p1) * ic, -(s + r22 + kappa2 * p2) * ic
            w1, w2 = (s + r11 - kappa1 * q1) * ic, (r12 - kappa1 * q2) * ic
            z1, z2 = (r21 - kappa2 * q1) * ic, (s + r22 - kappa2 * q2) * ic
            h1, h2, j1, j2 = -p2 * ic, p1 * ic, q2 * ic, -q1 * ic
            fa1, fa2 = g1 * u1 + g2 * v1, g1 * u2 + g2 * v2
            fb1, fb2 = g1 * w1 + g2 * z1, g1 * w2 + g2 * z2
            ga1, ga2, gb1, gb2 = fa1 + g3 * h1, fa2 + g3 * h2, fb1 + g3 * j1, fb2 + g3 * j2
            fa = -g1 * h1 - g2 * h2  # ∂κ/∂θ_a = −h
            fb = -g1 * j1 - g2 * j2  # ∂κ/∂θ_b = −j
            gradient_a, gradient_b = combine(ga1, m1a, ga2, m2a), combine(gb1, m1b, gb2, m2b)
            add_row(gradient_out, ka, ila, gradient_a)
            add_row(gradient_out, kb, ilb, gradient_b)
            gradient_out[ka, 3] += fa - g3
            gradient_out[kb, 3] += fb + g3
            if not with_hessian:
                continue

            f = g1 * kappa1 + g2 * kappa2
            pm, qm = (p1 * g1 + p2 * g2) * ic, (q1 * g1 + q2 * g2) * ic

            # edge a with itself
            x1, x2 = -ic * (fa1 + 0.5 * (g1 + g3 * h1)), -ic * (fa2 + 0.5 * (g2 + g3 * h2))
            own = qm + f * s * ic
            s11 = own + 2.0 * p1 * x1 + k1 * u1 * u1 + k2 * v1 * v1 + k3 * h1 * h1
            s12 = p1 * x2 + p2 * x1 + k1 * u1 * u2 + k2 * v1 * v2 + k3 * h1 * h2
            s22 = own + 2.0 * p2 * x2 + k1 * u2 * u2 + k2 * v2 * v2 + k3 * h2 * h2
            rows = combine3(s11, m1a, s12, m2a, -ga1, a), combine3(s12, m1a, s22, m2a, -ga2, a)
            add_upper_outer_sum(hessian_out, ka, ila * ila, m1a, rows[0], m2a, rows[1], scaled(-1.0, a), gradient_a)
            t1 = -k1 * h1 * u1 - k2 * h2 * v1 - k3 * h1 + ic * (s * g2 - fa * p1)
            t2 = -k1 * h1 * u2 - k2 * h2 * v2 - k3 * h2 - ic * (s * g1 + fa * p2)
            add_column(hessian_out, ka, 3, ila, combine(t1, m1a, t2, m2a))
            hessian_out[ka, 3, 3] += k1 * h1 * h1 + k2 * h2 * h2 + k3 - pm

            # edge b with itself
            x1, x2 = -ic * (fb1 - 0.5 * (g1 - g3 * j1)), -ic * (fb2 - 0.5 * (g2 - g3 * j2))
            own = f * s * ic - pm
            s11 = own + 2.0 * q1 * x1 + k1 * w1 * w1 + k2 * z1 * z1 + k3 * j1 * j1
            s12 = q1 * x2 + q2 * x1 + k1 * w1 * w2 + k2 * z1 * z2 + k3 * j1 * j2
            s22 = own + 2.0 * q2 * x2 + k1 * w2 * w2 + k2 * z2 * z2 + k3 * j2 * j2
            rows = combine3(s11, m1b, s12, m2b, -gb1, b), combine3(s12, m1b, s22, m2b, -gb2, b)
            add_upper_outer_sum(hessian_out, kb, ilb * ilb, m1b, rows[0], m2b, rows[1], scaled(-1.0, b), gradient_b)
            t1 = -k1 * j1 * w1 - k2 * j2 * z1 + k3 * j1 - ic * (s * g2 + fb * q1)
            t2 = -k1 * j1 * w2 - k2 * j2 * z2 + k3 * j2 + ic * (s * g1 - fb * q2)
            add_column(hessian_out, kb, 3, ilb, combine(t1, m1b, t2, m2b))
            hessian_out[kb, 3, 3] += k1 * j1 * j1 + k2 * j2 * j2 + k3 + qm

            # rows of a, columns of b
            x1, x2 = -ic * (fa1 + g1 + g3 * h1), -ic * (fa2 + g2 + g3 * h2)
            y1, y2 = -ic * (fb1 - g1), -ic * (fb2 - g2)
            fc, gc = f * ic, g3 * ic
            s11 = x1 * q1 + p1 * y1 - fc * r11 - gc * r21 + k1 * u1 * w1 + k2 * v1 * z1 + k3 * h1 * j1
            s12 = x1 * q2 + p1 * y2 - fc * r12 - gc * r22 + k1 * u1 * w2 + k2 * v1 * z2 + k3 * h1 * j2
            s21 = x2 * q1 + p2 * y1 - fc * r21 + gc * r11 + k1 * u2 * w1 + k2 * v2 * z1 + k3 * h2 * j1
            s22 = x2 * q2 + p2 * y2 - fc * r22 + gc * r12 + k1 * u2 * w2 + k2 * v2 * z2 + k3 * h2 * j2
            rows = combine(s11, m1b, s12, m2b), combine(s21, m1b, s22, m2b)
            add_outer_sum(cross_out, k, ila * ilb, m1a, rows[0], m2a, rows[1])
            t1 = -k1 * j1 * u1 - k2 * j2 * v1 + k3 * h1 - ic * (g1 * r12 - g2 * r11 + fb * p1)
            t2 = -k1 * j1 * u2 - k2 * j2 * v2 + k3 * h2 - ic * (g1 * r22 - g2 * r21 + fb * p2)
            add_column(cross_out, k, 3, ila, combine(t1, m1a, t2, m2a))
            t1 = -k1 * h1 * w1 - k2 * h2 * z1 - k3 * j1 + ic * (g1 * r21 - g2 * r11 - fa * q1)
            t2 = -k1 * h1 * w2 - k2 * h2 * z2 - k3 * j2 + ic * (g1 * r22 - g2 * r12 - fa * q2)
            theta_row = combine(t1, m1b, t2, m2b)
            cross_out[k, 3, 0] += ilb * theta_row[0]
            cross_out[k, 3, 1] += ilb * theta_row[1]
            cross_out[k, 3, 2] += ilb * theta_row[2]
            cross_out[k, 3, 3] += k1 * h1 * j1 + k2 * h2 * j2 - k3
            if strips and k13 != 0.0:
                # k₁₃ (∂κ₁ ∂ψᵀ + ∂ψ ∂κ₁ᵀ)
                bend_a, bend_b = combine(ila * u1, m1a, ila * u2, m2a), combine(ilb * w1, m1b, ilb * w2, m2b)
                twist_a, twist_b = combine(ila * h1, m1a, ila * h2, m2a), combine(ilb * j1, m1b, ilb * j2, m2b)
                add_upper_symmetric(hessian_out, ka, k13, bend_a, twist_a)
                add_upper_symmetric(hessian_out, kb, k13, bend_b, twist_b)
                add_column(hessian_out, ka, 3, -k13, combine(1.0, bend_a, h1, twist_a))
                add_column(hessian_out, kb, 3, k13, combine(1.0, bend_b, -j1, twist_b))
                hessian_out[ka, 3, 3] += 2.0 * k13 * h1
                hessian_out[kb, 3, 3] -= 2.0 * k13 * j1
                add_outer_sum(cross_out, k, k13, bend_a, twist_b, twist_a, bend_b)
                add_column(cross_out, k, 3, k13, combine(1.0, bend_a, -j1, twist_a))
                theta_row = combine(-k13, bend_b, -k13 * h1, twist_b)
                cross_out[k, 3, 0] += theta_row[0]
                cross_out[k, 3, 1] += theta_row[1]
                cross_out[k, 3, 2] += theta_row[2]
                cross_out[k, 3, 3] += k13 * (j1 - h1)
        if off_axis.exists and bends:
            stretch_bend(off_axis, strands, stage, at, sums, with_hessian)
        sums.energy[BENDING], sums.energy[TWISTING] = bending, twisting
        sums.energy[BOND] += bond
        if strips:
            sums.energy[FLATTENING] = flattened
        return math.inf

    add_bending.__name__ = "add_bending_of_strips" if strips else "add_bending"
    return piece(float, Space, Problem, Configuration, Stage, bool)(add_bending)


add_bending, add_bending_of_strips = _add_bending(False), _add_bending(True)
