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

Bond, translation: m̄₁ = σ (w_a n_a + w_b n_b), m̄₃ = w_a t_a + w_b t_b, and for an edge of weight w ∂m̄₁/∂φ = −w σ t,
∂m̄₃/∂φ = w n, ∂²m̄₁/∂φ² = −w σ n, ∂²m̄₃/∂φ² = −w t. Its rotation is bending between the paired edges, with another
stiffness.

The direction of a clamp ("wall") has a length of 1, and its angle is that of its body.
"""

from __future__ import annotations

import math

from bilayer_core.forces.bend_twist import bend_by_strains
from bilayer_core.forces.elements import acts_viscously, multiple_of_joint
from bilayer_core.forces.flattening import strip_law
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.kernel import Kernel
from bilayer_core.jit.piece import Piece
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Plane
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

STRETCHING, BENDING, FLATTENING, BOND = map(slot_of, ("stretching", "bending", "flattening", "bond"))


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


def _planar_bend(strips: bool) -> Kernel:
    """Return the kernel for rods with strips among them, or without."""

    @kernel
    def planar_bend(first, last, rest, plane, p, stage, at, with_hessian):
        """Add ½ k (κ − κ̄)² of joints first … last − 1 and return it, of bends and of bonds [J]; of strips add F.

        `rest` has κ̄ [rad] in its first column. Of strains in `at` κ alone is written; the others vanish in the plane.
        """
        strands = p.strands
        edge_a, edge_b, stiffness, strain_out = strands.joint_a, strands.joint_b, stage.joint_stiffness, at.joint_strain
        side, frame, gradient = plane.side, plane.frame, plane.polar_gradient
        hessian, cross_hessian = plane.polar_hessian, plane.cross_hessian
        bending = bond = 0.0
        if strips:
            flattening, strip, flattened = p.flattening, 0, 0.0
            flattens = p.sums.selected[FLATTENING]
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
            if strips:
                k11 = 0.0
                if flattens and strip < flattening.joint.shape[0] and flattening.joint[strip] == k:
                    energy, f1, _, k11, _, _, _, _ = strip_law(
                        flattening, stage.rest_joint, strip, k, kappa, 0.0, multiple_of_joint(p, stage, k, 0)
                    )
                    strip, flattened, force = strip + 1, flattened + energy, force + f1
            moment = force * slope
            gradient[a, 1] -= moment
            gradient[b, 1] += moment
            if with_hessian:
                second = stiffness[k, 0] * slope * slope + force * kappa * inverse
                if strips:
                    second += k11 * slope * slope
                hessian[a, 2] += second
                hessian[b, 2] += second
                cross_hessian[k, 3] -= second
        if strips:
            p.sums.energy[FLATTENING] = flattened
        return bending, bond

    return planar_bend


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
def planar_bond(ties, bends, bonds, plane, strands, stage, at, sums, with_hessian):
    """Add ½ (k₁ s₁² + k₃ s₃²) of vectors between layers: translation of paired edges if it `ties` layers, bending of
    ends if it `bends`. Returns both [J].
    """
    axes, position, joint, node, weight = strands.axes, at.position, bonds.joint, bonds.node, bonds.weight
    stiffness, rest_offset = stage.pair_stiffness, stage.neutral_pair
    side, frame, gradient, hessian = plane.side, plane.frame, plane.polar_gradient, plane.polar_hessian
    cross_hessian, pair_gradient, pair_hessian = plane.cross_hessian, sums.pair, plane.pair_hessian
    mixed_hessian = plane.mixed_hessian
    paired = strands.joint_a.shape[0] - strands.bend_count
    bond = bending = 0.0
    for k in range(0 if ties else paired, joint.shape[0] if bends else paired):
        x = joint[k]
        a, b = strands.joint_a[x], strands.joint_b[x]
        i0, i1, j0, j1 = node[k, 0], node[k, 1], node[k, 2], node[k, 3]
        x0 = 0.5 * (position[i0, 0] + position[i1, 0] - position[j0, 0] - position[j1, 0])
        x1 = 0.5 * (position[i0, 1] + position[i1, 1] - position[j0, 1] - position[j1, 1])
        x2 = 0.5 * (position[i0, 2] + position[i1, 2] - position[j0, 2] - position[j1, 2])
        vp = axes[0, 0] * x0 + axes[0, 1] * x1 + axes[0, 2] * x2
        vq = axes[1, 0] * x0 + axes[1, 1] * x1 + axes[1, 2] * x2
        sigma, c1, c3, wa, wb = side[a], stiffness[k, 0], stiffness[k, 2], weight[k, 0], weight[k, 1]
        ap, aq, bp, bq = frame[a, 0], frame[a, 1], frame[b, 0], frame[b, 1]
        mean3p, mean3q = wa * ap + wb * bp, wa * aq + wb * bq
        mean1p, mean1q = -sigma * mean3q, sigma * mean3p
        s1 = vp * mean1p + vq * mean1q - rest_offset[k, 0]
        s3 = vp * mean3p + vq * mean3q - rest_offset[k, 2]
        f1, f3 = c1 * s1, c3 * s3
        if k < paired:
            bond += 0.5 * (f1 * s1 + f3 * s3)
        else:
            bending += 0.5 * f3 * s3
        gp, gq = f1 * mean1p + f3 * mean3p, f1 * mean1q + f3 * mean3q
        for d in range(3):
            pair_gradient[k, d] += gp * axes[0, d] + gq * axes[1, d]
        along_a, along_b = wa * (vp * ap + vq * aq), wb * (vp * bp + vq * bq)
        across_a, across_b = wa * (vq * ap - vp * aq), wb * (vq * bp - vp * bq)
        a1, a3, b1, b3 = -sigma * along_a, across_a, -sigma * along_b, across_b  # ∂s/∂φ
        gradient[a, 1] += f1 * a1 + f3 * a3
        gradient[b, 1] += f1 * b1 + f3 * b3
        if with_hessian:
            hessian[a, 2] += c1 * a1 * a1 + c3 * a3 * a3 - f1 * sigma * across_a - f3 * along_a
            hessian[b, 2] += c1 * b1 * b1 + c3 * b3 * b3 - f1 * sigma * across_b - f3 * along_b
            cross_hessian[x, 3] += c1 * a1 * b1 + c3 * a3 * b3
            pair_hessian[k, 0] += c1 * mean1p * mean1p + c3 * mean3p * mean3p
            pair_hessian[k, 1] += c1 * mean1p * mean1q + c3 * mean3p * mean3q
            pair_hessian[k, 2] += c1 * mean1q * mean1q + c3 * mean3q * mean3q
            h1a, h3a, h1b, h3b = -wa * sigma * f1, wa * f3, -wb * sigma * f1, wb * f3
            mixed_hessian[k, 0] += c1 * a1 * mean1p + c3 * a3 * mean3p + h1a * ap - h3a * aq
            mixed_hessian[k, 1] += c1 * a1 * mean1q + c3 * a3 * mean3q + h1a * aq + h3a * ap
            mixed_hessian[k, 2] += c1 * b1 * mean1p + c3 * b3 * mean3p + h1b * bp - h3b * bq
            mixed_hessian[k, 3] += c1 * b1 * mean1q + c3 * b3 * mean3q + h1b * bq + h3b * bp
    return bond, bending


def _add_elasticity(strips: bool) -> Piece:
    """Return the piece for rods with strips among them, or without."""
    planar_bend = _planar_bend(strips)

    def add_elasticity(plane, p, at, stage, with_hessian):
        """Add stretching, bending and bonds; first derivatives by edges and pairs in space, second ones by l, φ, p."""
        strands, bonds, off_axis, sums = p.strands, p.bonds, p.off_axis, p.sums
        gradient, frame, axes, edge_gradient = plane.polar_gradient, plane.frame, strands.axes, sums.edge
        gradient[:] = 0.0
        measure_in_plane(plane, strands, at)
        viscous = acts_viscously(p)
        if sums.selected[STRETCHING] or viscous:
            sums.energy[STRETCHING] = planar_stretch(plane, strands, at, stage, with_hessian)
        bends, ties, rest = sums.selected[BENDING] or viscous, bonds.exists and sums.selected[BOND], stage.neutral_joint
        if strips:
            bends |= sums.selected[FLATTENING]
        if bends and off_axis.exists:
            bend_by_strains(off_axis, strands, at, rest)
            rest = off_axis.rest
        first, last = 0 if bends else strands.bend_count, strands.joint_a.shape[0] if ties else strands.bend_count
        sums.energy[BENDING], rotation = planar_bend(first, last, rest, plane, p, stage, at, with_hessian)
        if bends and off_axis.exists:
            planar_stretch_bend(off_axis, plane, strands, stage, at, with_hessian)
        if bonds.exists:
            translation, of_ends = planar_bond(ties, bends, bonds, plane, strands, stage, at, sums, with_hessian)
            sums.energy[BOND] = rotation + translation
            sums.energy[BENDING] += of_ends
        for k in range(frame.shape[0]):  # N t + T m
            force, moment = gradient[k, 0], gradient[k, 1]
            gp, gq = force * frame[k, 0] + moment * frame[k, 2], force * frame[k, 1] + moment * frame[k, 3]
            for d in range(3):
                edge_gradient[k, d] += gp * axes[0, d] + gq * axes[1, d]
        return math.inf

    add_elasticity.__name__ = "add_elasticity_of_strips_in_plane" if strips else "add_elasticity_in_plane"
    return piece(float, Plane, Problem, Configuration, Stage, bool)(add_elasticity)


add_elasticity_in_plane, add_elasticity_of_strips_in_plane = _add_elasticity(False), _add_elasticity(True)
