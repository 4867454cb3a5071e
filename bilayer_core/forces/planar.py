"""Elasticity of rods in a plane, as functions of the lengths and angles of edges.

In the plane with unit vectors p, q an edge is e = l t, t = (cos φ, sin φ), and n = ∂t/∂φ = (−sin φ, cos φ). Its
director is m1 = σ n, with one sign σ along a rod. Nothing twists, and the strains of `stretch`, `bend_twist` and
`coupling` become

    ε = l/|ē| − 1,   κ = 2 σ tan(Δ/2), Δ = φ_b − φ_a = atan2(a × b, a·b),   s_α = p·m̄_α − d_α, α = 1, 3

so that all of them depend on l, φ and the vector p between paired edges alone. First derivatives are an axial force
N = ∂E/∂l and a moment T = ∂E/∂φ of each edge; second ones those of l and φ. With m = n/l,

    ∂l/∂e = t,   ∂φ/∂e = m,   ∂²l/∂e² = l m mᵀ,   ∂²φ/∂e² = −(t mᵀ + m tᵀ)/l

take them to edge vectors: the gradient is N t + T m; `engine.linear.planar_assembly` does so with second derivatives.

Bending, with c = 1 + a·b:   κ = 2 σ a×b/c,   ∂κ/∂Δ = 2 σ/c,   ∂²κ/∂Δ² = κ/c. Off the neutral axis κ̄ depends on
lengths, ∂κ̄/∂l_i = s_i (`forces.stretch_bend`): ½ k r² with r = κ − κ̄ has all second derivatives k ∂r ∂r + k r ∂²κ.

Bond, translation: m̄₁ = ½ σ (n_t + n_b), m̄₃ = ½ (t_t + t_b), and for either edge ∂m̄₁/∂φ = −½ σ t, ∂m̄₃/∂φ = ½ n,
∂²m̄₁/∂φ² = −½ σ n, ∂²m̄₃/∂φ² = −½ t. Its rotation is bending between the paired edges, with another stiffness.

The direction of a clamp ("wall") has a length of 1, and its angle is that of its body.
"""

from __future__ import annotations

from ..jit import kernel


@kernel
def in_plane_frames(axes, length, tangent, frame_out):
    """Write t and m = n/l of every edge and wall in the plane, (t_p, t_q, m_p, m_q), shape (n_edge + n_wall, 4).

    `axes` are p and q, shape (2, 3).
    """
    p0, p1, p2 = axes[0, 0], axes[0, 1], axes[0, 2]
    q0, q1, q2 = axes[1, 0], axes[1, 1], axes[1, 2]
    for k in range(length.shape[0]):
        t0, t1, t2 = tangent[k, 0], tangent[k, 1], tangent[k, 2]
        tp, tq = p0 * t0 + p1 * t1 + p2 * t2, q0 * t0 + q1 * t1 + q2 * t2
        inverse = 1.0 / length[k]
        frame_out[k, 0], frame_out[k, 1] = tp, tq
        frame_out[k, 2], frame_out[k, 3] = -tq * inverse, tp * inverse


@kernel
def planar_stretch(
    axial_stiffness, rest_length, eigenstrain, length, polar_gradient_out, polar_hessian_out, with_hessian
):
    """Add ½ EA (ε − η)² |ē| of every edge and return it [J].

    Parameters
    ----------
    axial_stiffness, rest_length, eigenstrain : Array
        EA [N], |ē| [m], η, shape (n_edge,).
    length : Array
        l [m], shape (≥ n_edge,).
    polar_gradient_out, polar_hessian_out : Array
        ∂/∂l [N] and ∂/∂φ [N m]; ∂²/∂l², ∂²/∂l∂φ, ∂²/∂φ² of each edge and wall, shapes (n_edge + n_wall, 2),
        (n_edge + n_wall, 3); added to.
    with_hessian : bool
    """
    energy = 0.0
    for k in range(axial_stiffness.shape[0]):
        strain = length[k] / rest_length[k] - 1.0 - eigenstrain[k]
        force = axial_stiffness[k] * strain
        energy += 0.5 * force * strain * rest_length[k]
        polar_gradient_out[k, 0] += force
        if with_hessian:
            polar_hessian_out[k, 0] += axial_stiffness[k] / rest_length[k]
    return energy


@kernel
def planar_bend(
    first,
    last,
    edge_a,
    edge_b,
    stiffness,
    rest,
    side,
    frame,
    strain_out,
    polar_gradient_out,
    polar_hessian_out,
    cross_hessian_out,
    with_hessian,
):
    """Add ½ k (κ − κ̄)² of joints first … last − 1 and return it [J].

    Parameters
    ----------
    first, last : int
    edge_a, edge_b : Array
        The two edges of each joint, shape (n_joint,).
    stiffness, rest : Array
        k [N m] and κ̄ [rad] in their first columns, shape (n_joint, 3).
    side : Array
        σ of every edge and wall, shape (n_edge + n_wall,).
    frame : Array
        From `in_plane_frames`.
    strain_out : Array
        Written: κ [rad] in the first column, shape (n_joint, 3); the others, which vanish in the plane, are left.
    polar_gradient_out, polar_hessian_out : Array
        As for `planar_stretch`; added to.
    cross_hessian_out : Array
        ∂²/∂l_a∂l_b [N/m], ∂²/∂l_a∂φ_b, ∂²/∂φ_a∂l_b [N] and ∂²/∂φ_a∂φ_b [N m] of each joint, shape (n_joint, 4);
        added to.
    with_hessian : bool
    """
    energy = 0.0
    for k in range(first, last):
        a, b = edge_a[k], edge_b[k]
        ap, aq, bp, bq = frame[a, 0], frame[a, 1], frame[b, 0], frame[b, 1]
        inverse = 1.0 / (1.0 + ap * bp + aq * bq)
        slope = 2.0 * side[a] * inverse
        kappa = slope * (ap * bq - aq * bp)
        strain_out[k, 0] = kappa
        difference = kappa - rest[k, 0]
        force = stiffness[k, 0] * difference
        energy += 0.5 * force * difference
        moment = force * slope
        polar_gradient_out[a, 1] -= moment
        polar_gradient_out[b, 1] += moment
        if with_hessian:
            second = stiffness[k, 0] * slope * slope + force * kappa * inverse
            polar_hessian_out[a, 2] += second
            polar_hessian_out[b, 2] += second
            cross_hessian_out[k, 3] -= second
    return energy


@kernel
def planar_stretch_bend(
    joint,
    slope,
    edge_a,
    edge_b,
    stiffness,
    rest,
    strain,
    side,
    frame,
    polar_gradient_out,
    polar_hessian_out,
    cross_hessian_out,
    with_hessian,
):
    """Add the derivatives of bending through κ̄ where stretching bends.

    Parameters are those of `forces.stretch_bend.stretch_bend`, and as for `planar_bend`.
    """
    for i in range(joint.shape[0]):
        k = joint[i]
        a, b = edge_a[k], edge_b[k]
        sa, sb = slope[i, 0], slope[i, 1]
        k1 = stiffness[k, 0]
        moment = k1 * (strain[k, 0] - rest[k, 0])
        polar_gradient_out[a, 0] -= moment * sa
        polar_gradient_out[b, 0] -= moment * sb
        if with_hessian:
            cosine = frame[a, 0] * frame[b, 0] + frame[a, 1] * frame[b, 1]
            turning = 2.0 * side[a] * k1 / (1.0 + cosine)
            polar_hessian_out[a, 0] += k1 * sa * sa
            polar_hessian_out[b, 0] += k1 * sb * sb
            polar_hessian_out[a, 1] += turning * sa
            polar_hessian_out[b, 1] -= turning * sb
            cross_hessian_out[k, 0] += k1 * sa * sb
            cross_hessian_out[k, 1] -= turning * sa
            cross_hessian_out[k, 2] += turning * sb


@kernel
def planar_bond(
    first_joint,
    axes,
    position,
    edge_node,
    edge_top,
    edge_bottom,
    stiffness,
    rest_offset,
    side,
    frame,
    polar_gradient_out,
    polar_hessian_out,
    cross_hessian_out,
    pair_gradient_out,
    pair_hessian_out,
    mixed_hessian_out,
    with_hessian,
):
    """Add ½ k_T l (s₁² + s₃²) of every pair of edges and return it [J].

    Parameters
    ----------
    first_joint : int
        Joint of the first pair; their top edges are a, their bottom ones b.
    axes : Array
        p and q, shape (2, 3).
    position : Array
        Of nodes [m], shape (n_node, 3).
    edge_node : Array
        First node of each edge, shape (n_edge,).
    edge_top, edge_bottom : Array
        The paired edges, shape (n_pair,).
    stiffness, rest_offset : Array
        k_T l [N/m], shape (n_pair,), and d_α [m], of which the second is zero, shape (n_pair, 3).
    side, frame : Array
        Of edges and walls.
    polar_gradient_out, polar_hessian_out, cross_hessian_out : Array
        As for `planar_bend`; added to.
    pair_gradient_out : Array
        ∂/∂p in space [N], shape (n_pair, 3); added to.
    pair_hessian_out, mixed_hessian_out : Array
        In the plane: ∂²/∂p² by its upper triangle [N/m]; ∂²/∂p∂φ of the top and of the bottom edge [N], shapes
        (n_pair, 3), (n_pair, 4); added to.
    with_hessian : bool
    """
    energy = 0.0
    for k in range(edge_top.shape[0]):
        t, b = edge_top[k], edge_bottom[k]
        i, j = edge_node[t], edge_node[b]
        x0 = 0.5 * (position[i, 0] + position[i + 1, 0] - position[j, 0] - position[j + 1, 0])
        x1 = 0.5 * (position[i, 1] + position[i + 1, 1] - position[j, 1] - position[j + 1, 1])
        x2 = 0.5 * (position[i, 2] + position[i + 1, 2] - position[j, 2] - position[j + 1, 2])
        vp = axes[0, 0] * x0 + axes[0, 1] * x1 + axes[0, 2] * x2
        vq = axes[1, 0] * x0 + axes[1, 1] * x1 + axes[1, 2] * x2
        sigma, c = side[t], stiffness[k]
        tp, tq, bp, bq = frame[t, 0], frame[t, 1], frame[b, 0], frame[b, 1]
        mean3p, mean3q = 0.5 * (tp + bp), 0.5 * (tq + bq)
        mean1p, mean1q = -sigma * mean3q, sigma * mean3p
        s1 = vp * mean1p + vq * mean1q - rest_offset[k, 0]
        s3 = vp * mean3p + vq * mean3q - rest_offset[k, 2]
        energy += 0.5 * c * (s1 * s1 + s3 * s3)
        gp, gq = c * (s1 * mean1p + s3 * mean3p), c * (s1 * mean1q + s3 * mean3q)
        for d in range(3):
            pair_gradient_out[k, d] += gp * axes[0, d] + gq * axes[1, d]
        along_t, along_b = 0.5 * (vp * tp + vq * tq), 0.5 * (vp * bp + vq * bq)
        across_t, across_b = 0.5 * (vq * tp - vp * tq), 0.5 * (vq * bp - vp * bq)
        t1, t3, b1, b3 = -sigma * along_t, across_t, -sigma * along_b, across_b  # ∂s/∂φ
        polar_gradient_out[t, 1] += c * (s1 * t1 + s3 * t3)
        polar_gradient_out[b, 1] += c * (s1 * b1 + s3 * b3)
        if with_hessian:
            polar_hessian_out[t, 2] += c * (t1 * t1 + t3 * t3 - s1 * sigma * across_t - s3 * along_t)
            polar_hessian_out[b, 2] += c * (b1 * b1 + b3 * b3 - s1 * sigma * across_b - s3 * along_b)
            cross_hessian_out[first_joint + k, 3] += c * (t1 * b1 + t3 * b3)
            pair_hessian_out[k, 0] += c * (mean1p * mean1p + mean3p * mean3p)
            pair_hessian_out[k, 1] += c * (mean1p * mean1q + mean3p * mean3q)
            pair_hessian_out[k, 2] += c * (mean1q * mean1q + mean3q * mean3q)
            h1, h3 = -0.5 * sigma * s1, 0.5 * s3
            mixed_hessian_out[k, 0] += c * (t1 * mean1p + t3 * mean3p + h1 * tp - h3 * tq)
            mixed_hessian_out[k, 1] += c * (t1 * mean1q + t3 * mean3q + h1 * tq + h3 * tp)
            mixed_hessian_out[k, 2] += c * (b1 * mean1p + b3 * mean3p + h1 * bp - h3 * bq)
            mixed_hessian_out[k, 3] += c * (b1 * mean1q + b3 * mean3q + h1 * bq + h3 * bp)
    return energy


@kernel
def polar_to_edges(axes, frame, polar_gradient, edge_gradient_out):
    """Add N t + T m to ∂/∂e of every edge and wall [N], in space, shape (n_edge + n_wall, 4)."""
    for k in range(frame.shape[0]):
        force, moment = polar_gradient[k, 0], polar_gradient[k, 1]
        gp, gq = force * frame[k, 0] + moment * frame[k, 2], force * frame[k, 1] + moment * frame[k, 3]
        for d in range(3):
            edge_gradient_out[k, d] += gp * axes[0, d] + gq * axes[1, d]
