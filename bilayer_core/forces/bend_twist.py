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

from bilayer_core.forces.elements import acts_viscously, multiple_of_joint
from bilayer_core.forces.flattening import strip_law, viscous_coupling
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import flat, stack_matrix
from bilayer_core.jit.piece import Piece
from bilayer_core.kinematics.vector import (
    POSITIVE,
    add_column,
    add_outer,
    add_outer_sum,
    add_row,
    add_upper_outer,
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


BLOCK = 16
"""Joints that are computed together: in scratch their numbers lie side by side, so the compiler computes four at once.
The last joint fills the last block.
"""


@kernel
def _three(rows, first, i):
    """Return the numbers of joint i of a block in three rows of scratch, as a tuple."""
    return rows[first, i], rows[first + 1, i], rows[first + 2, i]


@kernel
def _put_three(rows, first, i, a):
    """Write the numbers of joint i of a block in three rows of scratch."""
    rows[first, i], rows[first + 1, i], rows[first + 2, i] = a


@kernel
def _frames(frames, i):
    """Return a, m1_a, m2_a, b, m1_b and m2_b of joint i of a block."""
    return (
        _three(frames, 0, i),
        _three(frames, 3, i),
        _three(frames, 6, i),
        _three(frames, 9, i),
        _three(frames, 12, i),
        _three(frames, 15, i),
    )


@kernel
def _gather(strands, at, first, last, frames_out):
    """Write the frames and lengths of the edges of a block of joints."""
    edge_a, edge_b, length, tangent = strands.joint_a, strands.joint_b, at.length, flat(at.tangent)
    director1, director2 = flat(at.director1), flat(at.director2)
    for i in range(BLOCK):
        k = min(first + i, last - 1) & POSITIVE
        ka, kb = edge_a[k] & POSITIVE, edge_b[k] & POSITIVE
        for c in range(3):
            frames_out[c, i], frames_out[9 + c, i] = tangent[3 * ka + c], tangent[3 * kb + c]
            frames_out[3 + c, i], frames_out[12 + c, i] = director1[3 * ka + c], director1[3 * kb + c]
            frames_out[6 + c, i], frames_out[15 + c, i] = director2[3 * ka + c], director2[3 * kb + c]
        frames_out[18, i], frames_out[19, i] = length[ka], length[kb]


@kernel
def _measure(frames, strains_out):
    """Write κ₁, κ₂, the direction of ψ, p, q, R, s and 1/c of a block of joints."""
    for i in range(BLOCK):
        a, m1a, m2a, b, m1b, m2b = _frames(frames, i)
        s = dot(a, b)
        ic = 1.0 / (1.0 + s)
        p1, p2, q1, q2 = dot(b, m1a), dot(b, m2a), dot(a, m1b), dot(a, m2b)
        r11, r12, r21, r22 = dot(m1a, m1b), dot(m1a, m2b), dot(m2a, m1b), dot(m2a, m2b)
        strains_out[0, i], strains_out[1, i] = (p1 - q1) * ic, (p2 - q2) * ic
        strains_out[2, i], strains_out[3, i] = r11 - p1 * q1 * ic, r21 - p2 * q1 * ic
        strains_out[4, i], strains_out[5, i], strains_out[6, i], strains_out[7, i] = p1, p2, q1, q2
        strains_out[8, i], strains_out[9, i], strains_out[10, i], strains_out[11, i] = r11, r12, r21, r22
        strains_out[12, i], strains_out[13, i] = s, ic


@kernel
def _slopes(frames, strains, moments, slopes_out, gradient_out):
    """Write first derivatives of a block of joints.

    `slopes_out` takes those of κ₁ and κ₂, u and v with respect to a, w and z to b, and `gradient_out` those of the
    energy: components with respect to a and b, ∂f/∂θ_a and ∂f/∂θ_b, and vectors by ε_a and ε_b.
    """
    for i in range(BLOCK):
        _, m1a, m2a, _, m1b, m2b = _frames(frames, i)
        kappa1, kappa2, s, ic = strains[0, i], strains[1, i], strains[12, i], strains[13, i]
        p1, p2, q1, q2 = strains[4, i], strains[5, i], strains[6, i], strains[7, i]
        r11, r12, r21, r22 = strains[8, i], strains[9, i], strains[10, i], strains[11, i]
        g1, g2, g3 = _three(moments, 0, i)
        u1, u2 = -(s + r11 + kappa1 * p1) * ic, -(r21 + kappa1 * p2) * ic
        v1, v2 = -(r12 + kappa2 * p1) * ic, -(s + r22 + kappa2 * p2) * ic
        w1, w2 = (s + r11 - kappa1 * q1) * ic, (r12 - kappa1 * q2) * ic
        z1, z2 = (r21 - kappa2 * q1) * ic, (s + r22 - kappa2 * q2) * ic
        h1, h2, j1, j2 = -p2 * ic, p1 * ic, q2 * ic, -q1 * ic
        ga1, ga2 = g1 * u1 + g2 * v1 + g3 * h1, g1 * u2 + g2 * v2 + g3 * h2
        gb1, gb2 = g1 * w1 + g2 * z1 + g3 * j1, g1 * w2 + g2 * z2 + g3 * j2
        slopes_out[0, i], slopes_out[1, i], slopes_out[2, i], slopes_out[3, i] = u1, u2, v1, v2
        slopes_out[4, i], slopes_out[5, i], slopes_out[6, i], slopes_out[7, i] = w1, w2, z1, z2
        gradient_out[0, i], gradient_out[1, i], gradient_out[2, i], gradient_out[3, i] = ga1, ga2, gb1, gb2
        gradient_out[4, i] = -g1 * h1 - g2 * h2  # ∂κ/∂θ_a = −h
        gradient_out[5, i] = -g1 * j1 - g2 * j2  # ∂κ/∂θ_b = −j
        _put_three(gradient_out, 6, i, combine(ga1 / frames[18, i], m1a, ga2 / frames[18, i], m2a))
        _put_three(gradient_out, 9, i, combine(gb1 / frames[19, i], m1b, gb2 / frames[19, i], m2b))


@kernel
def _curvatures(frames, strains, moments, slopes, gradient, hessian_out):
    """Write second derivatives of a block of joints: upper triangles by (ε_a, θ_a) and by (ε_b, θ_b), and by both, with
    rows of a and columns of b.
    """
    for i in range(BLOCK):
        a, m1a, m2a, b, m1b, m2b = _frames(frames, i)
        ila, ilb = 1.0 / frames[18, i], 1.0 / frames[19, i]
        kappa1, kappa2, s, ic = strains[0, i], strains[1, i], strains[12, i], strains[13, i]
        p1, p2, q1, q2 = strains[4, i], strains[5, i], strains[6, i], strains[7, i]
        r11, r12, r21, r22 = strains[8, i], strains[9, i], strains[10, i], strains[11, i]
        (g1, g2, g3), (k1, k2, k3) = _three(moments, 0, i), _three(moments, 3, i)
        u1, u2, v1, v2 = slopes[0, i], slopes[1, i], slopes[2, i], slopes[3, i]
        w1, w2, z1, z2 = slopes[4, i], slopes[5, i], slopes[6, i], slopes[7, i]
        h1, h2, j1, j2 = -p2 * ic, p1 * ic, q2 * ic, -q1 * ic
        ga1, ga2, gb1, gb2 = gradient[0, i], gradient[1, i], gradient[2, i], gradient[3, i]
        fa1, fa2, fb1, fb2 = ga1 - g3 * h1, ga2 - g3 * h2, gb1 - g3 * j1, gb2 - g3 * j2
        fa, fb, f = gradient[4, i], gradient[5, i], g1 * kappa1 + g2 * kappa2
        pm, qm = (p1 * g1 + p2 * g2) * ic, (q1 * g1 + q2 * g2) * ic

        # edge a with itself
        x1, x2 = -ic * (fa1 + 0.5 * (g1 + g3 * h1)), -ic * (fa2 + 0.5 * (g2 + g3 * h2))
        own = qm + f * s * ic
        s11 = own + 2.0 * p1 * x1 + k1 * u1 * u1 + k2 * v1 * v1 + k3 * h1 * h1
        s12 = p1 * x2 + p2 * x1 + k1 * u1 * u2 + k2 * v1 * v2 + k3 * h1 * h2
        s22 = own + 2.0 * p2 * x2 + k1 * u2 * u2 + k2 * v2 * v2 + k3 * h2 * h2
        first, second = combine3(s11, m1a, s12, m2a, -ga1, a), combine3(s12, m1a, s22, m2a, -ga2, a)
        third = combine(-ga1, m1a, -ga2, m2a)
        t1 = -k1 * h1 * u1 - k2 * h2 * v1 - k3 * h1 + ic * (s * g2 - fa * p1)
        t2 = -k1 * h1 * u2 - k2 * h2 * v2 - k3 * h2 - ic * (s * g1 + fa * p2)
        _put_own(hessian_out, 0, i, ila, (m1a, m2a, a), (first, second, third), combine(t1, m1a, t2, m2a))
        hessian_out[9, i] = k1 * h1 * h1 + k2 * h2 * h2 + k3 - pm

        # edge b with itself
        x1, x2 = -ic * (fb1 - 0.5 * (g1 - g3 * j1)), -ic * (fb2 - 0.5 * (g2 - g3 * j2))
        own = f * s * ic - pm
        s11 = own + 2.0 * q1 * x1 + k1 * w1 * w1 + k2 * z1 * z1 + k3 * j1 * j1
        s12 = q1 * x2 + q2 * x1 + k1 * w1 * w2 + k2 * z1 * z2 + k3 * j1 * j2
        s22 = own + 2.0 * q2 * x2 + k1 * w2 * w2 + k2 * z2 * z2 + k3 * j2 * j2
        first, second = combine3(s11, m1b, s12, m2b, -gb1, b), combine3(s12, m1b, s22, m2b, -gb2, b)
        third = combine(-gb1, m1b, -gb2, m2b)
        t1 = -k1 * j1 * w1 - k2 * j2 * z1 + k3 * j1 - ic * (s * g2 + fb * q1)
        t2 = -k1 * j1 * w2 - k2 * j2 * z2 + k3 * j2 + ic * (s * g1 - fb * q2)
        _put_own(hessian_out, 10, i, ilb, (m1b, m2b, b), (first, second, third), combine(t1, m1b, t2, m2b))
        hessian_out[19, i] = k1 * j1 * j1 + k2 * j2 * j2 + k3 + qm

        # rows of a, columns of b
        x1, x2 = -ic * (fa1 + g1 + g3 * h1), -ic * (fa2 + g2 + g3 * h2)
        y1, y2 = -ic * (fb1 - g1), -ic * (fb2 - g2)
        fc, gc, both = f * ic, g3 * ic, ila * ilb
        s11 = x1 * q1 + p1 * y1 - fc * r11 - gc * r21 + k1 * u1 * w1 + k2 * v1 * z1 + k3 * h1 * j1
        s12 = x1 * q2 + p1 * y2 - fc * r12 - gc * r22 + k1 * u1 * w2 + k2 * v1 * z2 + k3 * h1 * j2
        s21 = x2 * q1 + p2 * y1 - fc * r21 + gc * r11 + k1 * u2 * w1 + k2 * v2 * z1 + k3 * h2 * j1
        s22 = x2 * q2 + p2 * y2 - fc * r22 + gc * r12 + k1 * u2 * w2 + k2 * v2 * z2 + k3 * h2 * j2
        first, second = combine(s11, m1b, s12, m2b), combine(s21, m1b, s22, m2b)
        _put_three(hessian_out, 20, i, combine(both * m1a[0], first, both * m2a[0], second))
        _put_three(hessian_out, 24, i, combine(both * m1a[1], first, both * m2a[1], second))
        _put_three(hessian_out, 28, i, combine(both * m1a[2], first, both * m2a[2], second))
        t1 = -k1 * j1 * u1 - k2 * j2 * v1 + k3 * h1 - ic * (g1 * r12 - g2 * r11 + fb * p1)
        t2 = -k1 * j1 * u2 - k2 * j2 * v2 + k3 * h2 - ic * (g1 * r22 - g2 * r21 + fb * p2)
        column = combine(ila * t1, m1a, ila * t2, m2a)
        hessian_out[23, i], hessian_out[27, i], hessian_out[31, i] = column
        t1 = -k1 * h1 * w1 - k2 * h2 * z1 - k3 * j1 + ic * (g1 * r21 - g2 * r11 - fa * q1)
        t2 = -k1 * h1 * w2 - k2 * h2 * z2 - k3 * j2 + ic * (g1 * r22 - g2 * r12 - fa * q2)
        _put_three(hessian_out, 32, i, combine(ilb * t1, m1b, ilb * t2, m2b))
        hessian_out[35, i] = k1 * h1 * j1 + k2 * h2 * j2 - k3


@kernel
def _put_own(rows, first, i, inverse_length, left, right, column):
    """Write the upper triangle of (x₀ y₀ᵀ + x₁ y₁ᵀ + x₂ y₂ᵀ)/l² and a column times 1/l beside it, in nine rows."""
    (x, y, z), (u, v, w) = left, right
    square, row = inverse_length * inverse_length, first
    rows[row, i] = square * (x[0] * u[0] + y[0] * v[0] + z[0] * w[0])
    rows[row + 1, i] = square * (x[0] * u[1] + y[0] * v[1] + z[0] * w[1])
    rows[row + 2, i] = square * (x[0] * u[2] + y[0] * v[2] + z[0] * w[2])
    rows[row + 3, i] = inverse_length * column[0]
    rows[row + 4, i] = square * (x[1] * u[1] + y[1] * v[1] + z[1] * w[1])
    rows[row + 5, i] = square * (x[1] * u[2] + y[1] * v[2] + z[1] * w[2])
    rows[row + 6, i] = inverse_length * column[1]
    rows[row + 7, i] = square * (x[2] * u[2] + y[2] * v[2] + z[2] * w[2])
    rows[row + 8, i] = inverse_length * column[2]


@kernel
def _add_gradient(gradient, i, g3, ka, kb, gradient_out):
    """Add the first derivatives of joint i of a block to those of its edges, four numbers an edge."""
    for c in range(3):
        gradient_out[4 * ka + c] += gradient[6 + c, i]
        gradient_out[4 * kb + c] += gradient[9 + c, i]
    gradient_out[4 * ka + 3] += gradient[4, i] - g3
    gradient_out[4 * kb + 3] += gradient[5, i] + g3


@kernel
def _add_hessian(hessian, i, k, ka, kb, hessian_out, cross_out):
    """Add the second derivatives of joint i of a block, joint k of all, to those of its edges, sixteen numbers each."""
    for m in range(4):
        for n in range(m, 4):
            row = m * (7 - m) // 2 + n
            hessian_out[16 * ka + 4 * m + n] += hessian[row, i]
            hessian_out[16 * kb + 4 * m + n] += hessian[10 + row, i]
    for m in range(16):
        cross_out[16 * k + m] += hessian[20 + m, i]


@kernel
def _couple(frames, strains, slopes, k13, i, k, ka, kb, sums):
    """Add k₁₃ (∂κ₁ ∂ψᵀ + ∂ψ ∂κ₁ᵀ) of joint i of a block, joint k of all."""
    hessian_out, cross_out = sums.edge_hessian, sums.cross_hessian
    _, m1a, m2a, _, m1b, m2b = _frames(frames, i)
    ila, ilb, ic = 1.0 / frames[18, i], 1.0 / frames[19, i], strains[13, i]
    p1, p2, q1, q2 = strains[4, i], strains[5, i], strains[6, i], strains[7, i]
    h1, h2, j1, j2 = -p2 * ic, p1 * ic, q2 * ic, -q1 * ic
    bend_a = combine(ila * slopes[0, i], m1a, ila * slopes[1, i], m2a)
    bend_b = combine(ilb * slopes[4, i], m1b, ilb * slopes[5, i], m2b)
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


def _add_bending(strips: bool) -> Piece:
    """Return the piece for rods with strips among them, or without."""

    def add_bending(_, p, at, stage, with_hessian):
        """Add bending and twisting, and bonds as far as they are of this kind, with their derivatives by edges.

        ψ is unwrapped from the twist at the start of the stage.
        """
        strands, sums, off_axis, rest = p.strands, p.sums, p.off_axis, stage.neutral_joint
        edge_a, edge_b, stiffness, previous_twist = strands.joint_a, strands.joint_b, stage.joint_stiffness, stage.twist
        strain_out = at.joint_strain
        viscous, bend_count = acts_viscously(p), strands.bend_count
        bends, ties = sums.selected[BENDING] or sums.selected[TWISTING] or viscous, sums.selected[BOND] or viscous
        if strips:
            flattening, strip, flattened = p.flattening, 0, 0.0
            flattens = sums.selected[FLATTENING]
            bends |= flattens
        begin, end = 0 if bends else bend_count, edge_a.shape[0] if ties else bend_count
        if off_axis.exists and bends:
            bend_by_strains(off_axis, strands, at, rest)
            rest = off_axis.rest
        bending = twisting = bond = 0.0
        frames, strains, moments = stack_matrix(20, BLOCK), stack_matrix(14, BLOCK), stack_matrix(7, BLOCK)
        slopes, gradient, hessian = stack_matrix(8, BLOCK), stack_matrix(12, BLOCK), stack_matrix(36, BLOCK)
        for first in range(begin, end, BLOCK):
            _gather(strands, at, first, end, frames)
            _measure(frames, strains)
            for i in range(BLOCK):
                k = min(first + i, end - 1) & POSITIVE
                kappa1, kappa2, psi = strains[0, i], strains[1, i], angle(strains[2, i], strains[3, i])
                psi += TWO_PI * math.floor((previous_twist[k] - psi) / TWO_PI + 0.5)
                strain_out[k, 0], strain_out[k, 1], strain_out[k, 2] = kappa1, kappa2, psi
                k1, k2, k3 = stiffness[k, 0], stiffness[k, 1], stiffness[k, 2]
                d1, d2, d3 = kappa1 - rest[k, 0], kappa2 - rest[k, 1], psi - rest[k, 2]
                g1, g2, g3 = k1 * d1, k2 * d2, k3 * d3
                if first + i >= end:
                    pass
                elif k < bend_count:
                    bending += 0.5 * (g1 * d1 + g2 * d2)
                    twisting += 0.5 * g3 * d3
                else:
                    bond += 0.5 * (g1 * d1 + g2 * d2 + g3 * d3)
                if strips:
                    moments[6, i] = 0.0
                    if strip < flattening.joint.shape[0] and flattening.joint[strip] == k:
                        if flattens:
                            energy, f1, f3, k11, k13, k33, _, _ = strip_law(
                                flattening,
                                stage.rest_joint,
                                strip,
                                k,
                                kappa1,
                                psi,
                                multiple_of_joint(p, stage, k, 0),
                            )
                            flattened, g1, g3 = flattened + energy, g1 + f1, g3 + f3
                            k1, k3, moments[6, i] = k1 + k11, k3 + k33, k13
                        if viscous:
                            lag, kappa0, psi0 = viscous_coupling(p, stage, strip)
                            g1, g3 = g1 + lag * (psi - psi0), g3 + lag * (kappa1 - kappa0)
                            moments[6, i] += lag
                        strip += 1
                _put_three(moments, 0, i, (g1, g2, g3))
                _put_three(moments, 3, i, (k1, k2, k3))
            _slopes(frames, strains, moments, slopes, gradient)
            if with_hessian:
                _curvatures(frames, strains, moments, slopes, gradient, hessian)
            for i in range(min(BLOCK, end - first)):
                k = (first + i) & POSITIVE
                ka, kb = edge_a[k] & POSITIVE, edge_b[k] & POSITIVE
                _add_gradient(gradient, i, moments[2, i], ka, kb, flat(sums.edge))
                if with_hessian:
                    _add_hessian(hessian, i, k, ka, kb, flat(sums.edge_hessian), flat(sums.cross_hessian))
                    if strips and moments[6, i] != 0.0:
                        _couple(frames, strains, slopes, moments[6, i], i, k, ka, kb, sums)
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
