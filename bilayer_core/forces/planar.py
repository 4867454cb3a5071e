"""Elasticity of rods in a plane, as functions of the lengths and angles of edges.

In the plane with unit vectors p, q an edge is e = l t, t = (cos φ, sin φ), and n = ∂t/∂φ = (−sin φ, cos φ). Its
director is m1 = σ n, with one sign σ along a rod. Nothing twists, and the strains of `stretch`, `bend_twist` and
`bond` become

    ε = l/|ē| − 1,   κ = 2 σ tan(Δ/2), Δ = φ_b − φ_a = atan2(a × b, a·b),   s_α = p·m̄_α − d_α, α = 1, 3

so that all of them depend on l, φ and the vector p between paired edges alone. First derivatives are an axial force
N = ∂E/∂l and a moment T = ∂E/∂φ of each edge; second ones those of l and φ. With m = n/l,

    ∂l/∂e = t,   ∂φ/∂e = m,   ∂²l/∂e² = l m mᵀ,   ∂²φ/∂e² = −(t mᵀ + m tᵀ)/l

take them to edge vectors: the gradient is N t + T m; `engine.linear.planar_assembly` does so with second derivatives.

Bending, with c = 1 + a·b:   κ = 2 σ a×b/c,   ∂κ/∂Δ = 2 σ/c,   ∂²κ/∂Δ² = κ/c. Off the neutral axis κ̄ depends on
lengths, ∂κ̄/∂l_i = s_i (`forces.bend_twist`): ½ k r² with r = κ − κ̄ has all second derivatives k ∂r ∂r + k r ∂²κ.

Bond, translation: m̄₁ = ½ σ (n_t + n_b), m̄₃ = ½ (t_t + t_b), and for either edge ∂m̄₁/∂φ = −½ σ t, ∂m̄₃/∂φ = ½ n,
∂²m̄₁/∂φ² = −½ σ n, ∂²m̄₃/∂φ² = −½ t. Its rotation is bending between the paired edges, with another stiffness.

The direction of a clamp ("wall") has a length of 1, and its angle is that of its body.
"""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..model.force_slots import slot_of
from ..model.records.parts import Plane
from ..model.records.problem import Problem
from ..model.records.step import Configuration, Stage
from .bend_twist import bend_by_strains
from .viscosity import acts_viscously

STRETCHING, BENDING, BOND = map(slot_of, ("stretching", "bending", "bond"))


@kernel
def measure_in_plane(plane, strands, at):
    """Write t and m = n/l of every edge and clamp edge in the plane, (t_p, t_q, m_p, m_q), into `Plane.frame`."""
    axes, length, tangent, frame = strands.axes, at.length, at.tangent, plane.frame
    p0, p1, p2 = axes[0, 0], axes[0, 1], axes[0, 2]
    q0, q1, q2 = axes[1, 0], axes[1, 1], axes[1, 2]
    for k in range(length.shape[0]):
        t0, t1, t2 = tangent[k, 0], tangent[k, 1], tangent[k, 2]
        tp, tq = p0 * t0 + p1 * t1 + p2 * t2, q0 * t0 + q1 * t1 + q2 * t2
        inverse = 1.0 / length[k]
        frame[k, 0], frame[k, 1] = tp, tq
        frame[k, 2], frame[k, 3] = -tq * inverse, tp * inverse


@kernel
def planar_stretch(plane, strands, at, stage, with_hessian):
    """Add ½ EA (ε − η)² |ē| of every edge to N and ∂²/∂l², and return it [J]."""
    stiffness, rest_length, neutral = stage.axial_stiffness, strands.rest_length, stage.neutral_edge
    length = at.length
    gradient, hessian = plane.polar_gradient, plane.polar_hessian
    energy = 0.0
    for k in range(stiffness.shape[0]):
        strain = length[k] / rest_length[k] - 1.0 - neutral[k]
        force = stiffness[k] * strain
        energy += 0.5 * force * strain * rest_length[k]
        gradient[k, 0] += force
        if with_hessian:
            hessian[k, 0] += stiffness[k] / rest_length[k]
    return energy


@kernel
def planar_bend(first, last, rest, plane, strands, stage, at, with_hessian):
    """Add ½ k (κ − κ̄)² of joints first … last − 1 and return it, of bends and of bonds [J].

    `rest` has κ̄ [rad] in its first column. Of the strains in `at` κ alone is written; the others vanish in the plane.
    """
    edge_a, edge_b, stiffness, strain_out = strands.joint_a, strands.joint_b, stage.joint_stiffness, at.joint_strain
    side, frame, gradient = plane.side, plane.frame, plane.polar_gradient
    hessian, cross_hessian = plane.polar_hessian, plane.cross_hessian
    bending = bond = 0.0
    for k in range(first, last):
        a, b = edge_a[k], edge_b[k]
        ap, aq, bp, bq = frame[a, 0], frame[a, 1], frame[b, 0], frame[b, 1]
        inverse = 1.0 / (1.0 + ap * bp + aq * bq)
        slope = 2.0 * side[a] * inverse
        kappa = slope * (ap * bq - aq * bp)
        strain_out[k, 0] = kappa
        difference = kappa - rest[k, 0]
        force = stiffness[k, 0] * difference
        if k < strands.bend_count:
            bending += 0.5 * force * difference
        else:
            bond += 0.5 * force * difference
        moment = force * slope
        gradient[a, 1] -= moment
        gradient[b, 1] += moment
        if with_hessian:
            second = stiffness[k, 0] * slope * slope + force * kappa * inverse
            hessian[a, 2] += second
            hessian[b, 2] += second
            cross_hessian[k, 3] -= second
    return bending, bond


@kernel
def planar_stretch_bend(off_axis, plane, strands, stage, at, with_hessian):
    """Add the derivatives of bending through κ̄ where stretching bends."""
    joint, slope, rest = off_axis.joint, off_axis.slope, off_axis.rest
    edge_a, edge_b, stiffness, strain = strands.joint_a, strands.joint_b, stage.joint_stiffness, at.joint_strain
    side, frame, gradient = plane.side, plane.frame, plane.polar_gradient
    hessian, cross_hessian = plane.polar_hessian, plane.cross_hessian
    for i in range(joint.shape[0]):
        k = joint[i]
        a, b = edge_a[k], edge_b[k]
        sa, sb = slope[i, 0], slope[i, 1]
        k1 = stiffness[k, 0]
        moment = k1 * (strain[k, 0] - rest[k, 0])
        gradient[a, 0] -= moment * sa
        gradient[b, 0] -= moment * sb
        if with_hessian:
            cosine = frame[a, 0] * frame[b, 0] + frame[a, 1] * frame[b, 1]
            turning = 2.0 * side[a] * k1 / (1.0 + cosine)
            hessian[a, 0] += k1 * sa * sa
            hessian[b, 0] += k1 * sb * sb
            hessian[a, 1] += turning * sa
            hessian[b, 1] -= turning * sb
            cross_hessian[k, 0] += k1 * sa * sb
            cross_hessian[k, 1] -= turning * sa
            cross_hessian[k, 2] += turning * sb


@kernel
def planar_bond(bonds, plane, strands, at, sums, with_hessian):
    """Add ½ k_T l (s₁² + s₃²) of every pair of edges and return it [J]."""
    axes, position, edge_node, first_joint = strands.axes, at.position, strands.edge_node, strands.bend_count
    edge_top, edge_bottom, stiffness, rest_offset = bonds.top, bonds.bottom, bonds.stiffness, bonds.rest
    side, frame, gradient, hessian = plane.side, plane.frame, plane.polar_gradient, plane.polar_hessian
    cross_hessian, pair_gradient, pair_hessian = plane.cross_hessian, sums.pair, plane.pair_hessian
    mixed_hessian = plane.mixed_hessian
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
            pair_gradient[k, d] += gp * axes[0, d] + gq * axes[1, d]
        along_t, along_b = 0.5 * (vp * tp + vq * tq), 0.5 * (vp * bp + vq * bq)
        across_t, across_b = 0.5 * (vq * tp - vp * tq), 0.5 * (vq * bp - vp * bq)
        t1, t3, b1, b3 = -sigma * along_t, across_t, -sigma * along_b, across_b  # ∂s/∂φ
        gradient[t, 1] += c * (s1 * t1 + s3 * t3)
        gradient[b, 1] += c * (s1 * b1 + s3 * b3)
        if with_hessian:
            hessian[t, 2] += c * (t1 * t1 + t3 * t3 - s1 * sigma * across_t - s3 * along_t)
            hessian[b, 2] += c * (b1 * b1 + b3 * b3 - s1 * sigma * across_b - s3 * along_b)
            cross_hessian[first_joint + k, 3] += c * (t1 * b1 + t3 * b3)
            pair_hessian[k, 0] += c * (mean1p * mean1p + mean3p * mean3p)
            pair_hessian[k, 1] += c * (mean1p * mean1q + mean3p * mean3q)
            pair_hessian[k, 2] += c * (mean1q * mean1q + mean3q * mean3q)
            h1, h3 = -0.5 * sigma * s1, 0.5 * s3
            mixed_hessian[k, 0] += c * (t1 * mean1p + t3 * mean3p + h1 * tp - h3 * tq)
            mixed_hessian[k, 1] += c * (t1 * mean1q + t3 * mean3q + h1 * tq + h3 * tp)
            mixed_hessian[k, 2] += c * (b1 * mean1p + b3 * mean3p + h1 * bp - h3 * bq)
            mixed_hessian[k, 3] += c * (b1 * mean1q + b3 * mean3q + h1 * bq + h3 * bp)
    return energy


@piece(float, Plane, Problem, Configuration, Stage, bool)
def add_elasticity_in_plane(plane, p, at, stage, with_hessian):
    """Add stretching, bending and bonds; first derivatives by edges and pairs in space, second ones by l, φ and p."""
    strands, bonds, off_axis, sums = p.strands, p.bonds, p.off_axis, p.sums
    gradient, frame, axes, edge_gradient = plane.polar_gradient, plane.frame, strands.axes, sums.edge
    gradient[:] = 0.0
    measure_in_plane(plane, strands, at)
    viscous = acts_viscously(p)
    if sums.selected[STRETCHING] or viscous:
        sums.energy[STRETCHING] = planar_stretch(plane, strands, at, stage, with_hessian)
    bends, ties, rest = sums.selected[BENDING] or viscous, bonds.exists and sums.selected[BOND], stage.neutral_joint
    if bends and off_axis.exists:
        bend_by_strains(off_axis, strands, at, rest)
        rest = off_axis.rest
    first, last = 0 if bends else strands.bend_count, strands.joint_a.shape[0] if ties else strands.bend_count
    sums.energy[BENDING], rotation = planar_bend(first, last, rest, plane, strands, stage, at, with_hessian)
    if bends and off_axis.exists:
        planar_stretch_bend(off_axis, plane, strands, stage, at, with_hessian)
    if ties:
        sums.energy[BOND] = rotation + planar_bond(bonds, plane, strands, at, sums, with_hessian)
    for k in range(frame.shape[0]):  # N t + T m
        force, moment = gradient[k, 0], gradient[k, 1]
        gp, gq = force * frame[k, 0] + moment * frame[k, 2], force * frame[k, 1] + moment * frame[k, 3]
        for d in range(3):
            edge_gradient[k, d] += gp * axes[0, d] + gq * axes[1, d]
    return math.inf
