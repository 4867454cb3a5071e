"""Bending and twisting between two edges a and b.

    B = ½ k₁ (κ₁ − κ̄₁)² + ½ k₂ (κ₂ − κ̄₂)² + ½ k₃ (ψ − ψ̄)²        (paper, eqs. 10 to 13)

At an inner node k₁ = EI₁/Δl, k₂ = EI₂/Δl, k₃ = GJ/Δl and κ₁ = χ Δl, κ₂ = ξ Δl, ψ = τ Δl with the Voronoi length Δl.
The same
element with other stiffnesses ties the frames of two bonded layers together (`coupling`).

Strains. With unit tangents a, b, directors mα of either edge, and c = 1 + a·b, the curvature binormal 2 a×b/c projected
on the mean of the directors is

    κ_α = (b·mα_a − a·mα_b)/c,   α = 1, 2,

because (a×b)·m2_a = b·m1_a and so on (κ₁ belongs to bending through the thickness, χ = m1·t′). ψ is the angle about b
from the
parallel-transported m1_a to m1_b.

Derivatives. An increment (ε, θ) of an edge of length l moves its frame by parallel transport and turns it by θ; to
second order, with
ε⊥ = P ε, P = I − a aᵀ, and m′ = ∂m/∂θ (m1′ = m2, m2′ = −m1):

    a → a + ε⊥/l − (a·ε) ε⊥/l² − ½ |ε⊥|² a/l²
    m → m − a (m·ε)/l + θ m′ + a (m·ε)(a·ε)/l² − ½ (m·ε) ε⊥/l² − θ a (m′·ε)/l − ½ θ² m

Insert both into f = (b·M_a − a·M_b)/c for any fixed combination M = G₁ m1 + G₂ m2 (M′ = G₁ m2 − G₂ m1), write a_p =
P_b a,
b_p = P_a b, f = (b·M_a − a·M_b)/c and collect:

    u = (a·b) M_a + P_a M_b + f b_p,        ∂f/∂ε_a = −u/(c l_a)
    w = (a·b) M_b + P_b M_a − f a_p,        ∂f/∂ε_b = +w/(c l_b)
    f_a = b·M′_a/c = ∂f/∂θ_a,               f_b = −a·M′_b/c = ∂f/∂θ_b
    ∂²f/∂ε_a²  = [a uᵀ + u aᵀ + b_p vᵀ + v b_pᵀ + (a·M_b + f a·b) P_a]/(c l_a²),      v = u/c − ½ M_a
    ∂²f/∂ε_b²  = [−b wᵀ − w bᵀ + a_p zᵀ + z a_pᵀ − (b·M_a − f a·b) P_b]/(c l_b²),     z = ½ M_b − w/c
    ∂²f/∂ε_a∂ε_b = [(u/c − M_a) a_pᵀ + b_p (M_b − w/c)ᵀ − f (I − a aᵀ − b bᵀ + (a·b) a bᵀ)]/(c l_a l_b)
    ∂²f/∂θ_a∂ε_a = −[(a·b) M′_a + f_a b_p]/(c l_a),    ∂²f/∂θ_a∂ε_b = [P_b M′_a − f_a a_p]/(c l_b)
    ∂²f/∂θ_b∂ε_b =  [(a·b) M′_b − f_b a_p]/(c l_b),    ∂²f/∂θ_b∂ε_a = −[P_a M′_b + f_b b_p]/(c l_a)
    ∂²f/∂θ_a²    = −b·M_a/c,    ∂²f/∂θ_b² = a·M_b/c,    ∂²f/∂θ_a∂θ_b = 0

With G_α = k_α (κ_α − κ̄_α) this f gives all of Σ G_α ∇²κ_α at once, and u = Σ G_α u_α. For the twist, with the
curvature binormal
k = 2 a×b/c and T = (a + b)/c (Bergou et al. 2010; Panetta et al. 2019):

    ∂ψ/∂ε_a = k/(2 l_a),  ∂ψ/∂ε_b = k/(2 l_b),  ∂ψ/∂θ_b = −∂ψ/∂θ_a = 1
    ∂²ψ/∂ε_a² = −[k (a+T)ᵀ + (a+T) kᵀ]/(4 l_a²),   ∂²ψ/∂ε_b² = −[k (b+T)ᵀ + (b+T) kᵀ]/(4 l_b²)
    ∂²ψ/∂ε_a∂ε_b = (2 [a]×/c − k Tᵀ)/(2 l_a l_b)

All is exact where θ = 0, that is at the configuration whose own frames are given.
"""

from __future__ import annotations

import math

from ..jit import kernel
from ..kinematics.vector import (
    add_column,
    add_identity,
    add_outer,
    add_row,
    add_upper_outer,
    add_upper_projector,
    add_upper_symmetric,
    angle,
    combine,
    combine3,
    cross,
    dot,
    row,
    scaled,
)

TWO_PI = 2.0 * math.pi


@kernel
def bend_twist(
    first,
    last,
    edge_a,
    edge_b,
    stiffness,
    rest,
    length,
    tangent,
    director1,
    director2,
    previous_twist,
    strain_out,
    edge_gradient_out,
    edge_hessian_out,
    cross_hessian_out,
    with_hessian,
):
    """Add elements first … last − 1 to the edge accumulators; return the energies of κ₁ and κ₂, and of ψ [J].

    Parameters
    ----------
    first, last : int
    edge_a, edge_b : Array
        The two edges of each element, shape (n,).
    stiffness, rest : Array
        k₁ k₂ k₃ [N m] and κ̄₁ κ̄₂ ψ̄ [rad], shape (n, 3).
    length, tangent, director1, director2 : Array
        Of every edge [m, unit], shapes (n_edge,), (n_edge, 3).
    previous_twist : Array
        Twist of each element in the configuration before [rad], from which ψ is unwrapped, shape (n,).
    strain_out : Array
        Written: κ₁, κ₂, ψ [rad], shape (n, 3).
    edge_gradient_out, edge_hessian_out : Array
        ∂/∂(e, θ) and upper triangle of ∂²/∂(e, θ)² of each edge, shapes (n_edge, 4), (n_edge, 4, 4); added to.
    cross_hessian_out : Array
        ∂²/∂(e, θ)_a ∂(e, θ)_b of each element, shape (n, 4, 4); added to.
    with_hessian : bool
    """
    energy_bend = 0.0
    energy_twist = 0.0
    for k in range(first, last):
        ka, kb = edge_a[k], edge_b[k]
        a, b = row(tangent, ka), row(tangent, kb)
        m1a, m2a = row(director1, ka), row(director2, ka)
        m1b, m2b = row(director1, kb), row(director2, kb)
        ila, ilb = 1.0 / length[ka], 1.0 / length[kb]
        ab = dot(a, b)
        ic = 1.0 / (1.0 + ab)

        b_m1a, b_m2a = dot(b, m1a), dot(b, m2a)
        a_m1b, a_m2b = dot(a, m1b), dot(a, m2b)
        kappa1 = (b_m1a - a_m1b) * ic
        kappa2 = (b_m2a - a_m2b) * ic
        cosine = dot(m1a, m1b) - b_m1a * a_m1b * ic
        sine = dot(m2a, m1b) - b_m2a * a_m1b * ic
        psi = angle(cosine, sine)
        psi += TWO_PI * math.floor((previous_twist[k] - psi) / TWO_PI + 0.5)
        strain_out[k, 0] = kappa1
        strain_out[k, 1] = kappa2
        strain_out[k, 2] = psi

        k1, k2, k3 = stiffness[k, 0], stiffness[k, 1], stiffness[k, 2]
        d1, d2, d3 = kappa1 - rest[k, 0], kappa2 - rest[k, 1], psi - rest[k, 2]
        g1, g2, g3 = k1 * d1, k2 * d2, k3 * d3
        energy_bend += 0.5 * (g1 * d1 + g2 * d2)
        energy_twist += 0.5 * g3 * d3

        ap = combine(1.0, a, -ab, b)
        bp = combine(1.0, b, -ab, a)
        u1 = combine3(ab, m1a, 1.0, combine(1.0, m1b, -a_m1b, a), kappa1, bp)
        u2 = combine3(ab, m2a, 1.0, combine(1.0, m2b, -a_m2b, a), kappa2, bp)
        w1 = combine3(ab, m1b, 1.0, combine(1.0, m1a, -b_m1a, b), -kappa1, ap)
        w2 = combine3(ab, m2b, 1.0, combine(1.0, m2a, -b_m2a, b), -kappa2, ap)
        u = combine(g1, u1, g2, u2)
        w = combine(g1, w1, g2, w2)
        binormal = scaled(2.0 * ic, cross(a, b))
        ca, cb = ic * ila, ic * ilb
        fa = (g1 * b_m2a - g2 * b_m1a) * ic
        fb = -(g1 * a_m2b - g2 * a_m1b) * ic

        add_row(edge_gradient_out, ka, 1.0, combine(-ca, u, 0.5 * g3 * ila, binormal))
        add_row(edge_gradient_out, kb, 1.0, combine(cb, w, 0.5 * g3 * ilb, binormal))
        edge_gradient_out[ka, 3] += fa - g3
        edge_gradient_out[kb, 3] += fb + g3
        if not with_hessian:
            continue

        # G-weighted second derivatives of the two curvatures
        ma, mb = combine(g1, m1a, g2, m2a), combine(g1, m1b, g2, m2b)
        pa, pb = combine(g1, m2a, -g2, m1a), combine(g1, m2b, -g2, m1b)  # M′
        f = (dot(b, ma) - dot(a, mb)) * ic
        add_upper_symmetric(edge_hessian_out, ka, ca * ila, a, u)
        add_upper_symmetric(edge_hessian_out, ka, ca * ila, bp, combine(ic, u, -0.5, ma))
        add_upper_projector(edge_hessian_out, ka, ca * ila * (dot(a, mb) + f * ab), a)
        add_upper_symmetric(edge_hessian_out, kb, -cb * ilb, b, w)
        add_upper_symmetric(edge_hessian_out, kb, cb * ilb, ap, combine(0.5, mb, -ic, w))
        add_upper_projector(edge_hessian_out, kb, -cb * ilb * (dot(b, ma) - f * ab), b)
        add_column(edge_hessian_out, ka, 3, -ca, combine(ab, pa, fa, bp))
        add_column(edge_hessian_out, kb, 3, cb, combine(ab, pb, -fb, ap))
        edge_hessian_out[ka, 3, 3] += k3 - dot(b, ma) * ic
        edge_hessian_out[kb, 3, 3] += k3 + dot(a, mb) * ic

        # twist: G₃ ∇²ψ and k₃ ∇ψ ∇ψᵀ
        t_sum = combine(ic, a, ic, b)
        ha, hb = scaled(0.5 * ila, binormal), scaled(0.5 * ilb, binormal)  # ∂ψ/∂ε
        add_upper_symmetric(edge_hessian_out, ka, -0.25 * g3 * ila * ila, binormal, combine(1.0, a, 1.0, t_sum))
        add_upper_symmetric(edge_hessian_out, kb, -0.25 * g3 * ilb * ilb, binormal, combine(1.0, b, 1.0, t_sum))
        add_upper_outer(edge_hessian_out, ka, k3, ha)
        add_upper_outer(edge_hessian_out, kb, k3, hb)
        add_column(edge_hessian_out, ka, 3, -k3, ha)
        add_column(edge_hessian_out, kb, 3, k3, hb)

        # k_α ∇κ_α ∇κ_αᵀ
        t1a, t1b = b_m2a * ic, -a_m2b * ic  # ∂κ₁/∂θ
        t2a, t2b = -b_m1a * ic, a_m1b * ic  # ∂κ₂/∂θ
        add_upper_outer(edge_hessian_out, ka, k1 * ca * ca, u1)
        add_upper_outer(edge_hessian_out, ka, k2 * ca * ca, u2)
        add_upper_outer(edge_hessian_out, kb, k1 * cb * cb, w1)
        add_upper_outer(edge_hessian_out, kb, k2 * cb * cb, w2)
        add_column(edge_hessian_out, ka, 3, 1.0, combine(-k1 * ca * t1a, u1, -k2 * ca * t2a, u2))
        add_column(edge_hessian_out, kb, 3, 1.0, combine(k1 * cb * t1b, w1, k2 * cb * t2b, w2))
        edge_hessian_out[ka, 3, 3] += k1 * t1a * t1a + k2 * t2a * t2a
        edge_hessian_out[kb, 3, 3] += k1 * t1b * t1b + k2 * t2b * t2b

        # cross block, rows (e, θ) of a, columns of b
        cab = ic * ila * ilb
        add_outer(cross_hessian_out, k, cab, combine(ic, u, -1.0, ma), ap)
        add_outer(cross_hessian_out, k, cab, bp, combine(1.0, mb, -ic, w))
        add_identity(cross_hessian_out, k, -cab * f)
        add_outer(cross_hessian_out, k, cab * f, a, combine(1.0, a, -ab, b))
        add_outer(cross_hessian_out, k, cab * f, b, b)
        add_outer(cross_hessian_out, k, -k1 * ca * cb, u1, w1)
        add_outer(cross_hessian_out, k, -k2 * ca * cb, u2, w2)
        add_outer(cross_hessian_out, k, 1.0, ha, combine(k3, hb, -g3 * ilb, t_sum))
        s = g3 * cab
        cross_hessian_out[k, 0, 1] -= s * a[2]
        cross_hessian_out[k, 0, 2] += s * a[1]
        cross_hessian_out[k, 1, 0] += s * a[2]
        cross_hessian_out[k, 1, 2] -= s * a[0]
        cross_hessian_out[k, 2, 0] -= s * a[1]
        cross_hessian_out[k, 2, 1] += s * a[0]
        # e of a, θ of b
        add_column(cross_hessian_out, k, 3, -ca, combine(1.0, combine(1.0, pb, -dot(a, pb), a), fb, bp))
        add_column(cross_hessian_out, k, 3, 1.0, combine3(-k1 * ca * t1b, u1, -k2 * ca * t2b, u2, k3, ha))
        # θ of a, e of b
        theta_row = combine3(cb, combine(1.0, pa, -dot(b, pa), b), -cb * fa, ap, -k3, hb)
        theta_row = combine3(1.0, theta_row, k1 * cb * t1a, w1, k2 * cb * t2a, w2)
        cross_hessian_out[k, 3, 0] += theta_row[0]
        cross_hessian_out[k, 3, 1] += theta_row[1]
        cross_hessian_out[k, 3, 2] += theta_row[2]
        cross_hessian_out[k, 3, 3] += k1 * t1a * t1b + k2 * t2a * t2b - k3
    return energy_bend, energy_twist
