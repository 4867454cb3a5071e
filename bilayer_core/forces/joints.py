"""Joints: stiff springs between points and directions of two bodies.

With the arms ρ = R r from the bodies' positions, the distance d = X_A + ρ_A − X_B − ρ_B of the two points, and unit
vectors u_A, u_B that were one at the start (none on a pin, the axis on a hinge and a cylinder, and on a weld and a
slide three, one across the other, so that they resist every turn alike, whatever their axes are),

    E = ½ k |d|² + ½ κ Σ |u_A − u_B|²                       pin, hinge, weld; κ = k_θ, with three directions k_θ/2
    E = ½ k (|d|² − (a·d)²) + ½ κ Σ |u_A − u_B|²            slide, cylinder: the point of B stays on the axis a of A
    E = ½ k |d|² + ½ k_θ (a·b)²                             universal: the axis b of B stays across the axis a of A

Arms and vectors turn by x → x + φ×x + ½ φ×(φ×x), see `engine.linear.attachments`. With g = k d,

    ∂E/∂(X_A, φ_A) = (g, ρ_A×g − κ Σ u_A×u_B),        ∂E/∂(X_B, φ_B) = (−g, −ρ_B×g + κ Σ u_A×u_B)

    Hessian of the first term    k JᵀJ + T(ρ_A, g) − T(ρ_B, g),    J = (1, −[ρ_A]×, −1, [ρ_B]×)
    of the second                by (φ_A, φ_A) and (φ_B, φ_B)  −κ T(u_A, u_B),
                                 by (φ_A, φ_B)                 −κ ((u_A·u_B) 1 − u_B u_Aᵀ)

and T(a, b) = ½ (a bᵀ + b aᵀ) − (a·b) 1. Since |u_A − u_B|² = 2 − 2 u_A·u_B, only the product acts; the energy is taken
from the difference, which keeps its digits. The way along an axis, s = −a·d, and its derivatives are those of
`forces.mechanisms`: −½ k s² has −k s ∇s and −k (∇s ∇sᵀ + s ∇²s). Of c = a·b, ½ k_θ c² has k_θ c ∇c and
k_θ (∇c ∇cᵀ + c ∇²c), with the derivatives of u_A·u_B. (The energy of a slide is taken from what d has across the axis.)

A joint gives way by d = F/k and by angles M/k_θ, which `sim.joints` and summaries state.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.forces.contact_on_bodies import add_force
from bilayer_core.forces.joint_stiffness import across, scatter_pair, stiffness_of_joints
from bilayer_core.forces.mechanisms import add_product, add_way
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.jit.record import Flags, Indices, Matrix, Stack, Vector
from bilayer_core.kinematics.vector import cross, dot
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.model import Model
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage
from bilayer_core.scene.joint import SLIDES, Joint

JOINTS = slot_of("joints")
ALIGNED = {"pin": 0, "universal": 0, "hinge": 1, "cylinder": 1, "slide": 3, "weld": 3}
"""How many directions a joint keeps."""


@record
class Joints:
    """Joints of a model, and what each exerted at the last evaluation."""

    body: Indices  # A and B of each in turn, among all bodies, shape (2 n_joint,)
    free: Indices  # likewise among the free ones, −1 for a prescribed one
    arm: Matrix  # r in the axes of the body, A and B in turn [m], shape (2 n_joint, 3)
    direction: Stack  # u in the axes of the body, likewise, the axis first, shape (2 n_joint, 3, 3)
    aligned: Indices  # how many directions each aligns, shape (n_joint,)
    slides: Flags  # whether along the first direction of A, shape (n_joint,)
    crossed: Flags  # whether it keeps the first directions of A and B perpendicular, shape (n_joint,)
    stiffness: Vector  # k [N/m], shape (n_joint,)
    torsional: Vector  # k_θ [N m], shape (n_joint,)
    gradient: Matrix  # ∂E/∂(X, φ) of A and B in turn [N, N m], shape (2 n_joint, 6)
    apart: Matrix  # distance [m], and largest angle of directions [rad], that it gives way by, shape (n_joint, 2)


@kernel
def _turned(rotation, b, local, k, out):
    """Write R r of a body."""
    for i in range(3):
        out[i] = rotation[b, i, 0] * local[k, 0] + rotation[b, i, 1] * local[k, 1] + rotation[b, i, 2] * local[k, 2]


@kernel
def _add_turning(a, b, factor, out, row):
    """Add a multiple of T(a, b) to the block that begins at a row, and column, of a matrix."""
    product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    for i in range(3):
        for j in range(3):
            out[row + i, row + j] += 0.5 * factor * (a[i] * b[j] + b[i] * a[j])
        out[row + i, row + i] -= factor * product


@kernel
def _add_point(stiffness, arms, g, hessian):
    """Add the second derivatives of the distance of two points by (X_A, φ_A, X_B, φ_B), shape (12, 12)."""
    jacobian = stack_matrix(3, 12)
    for s in range(2):
        sign, base = 1.0 - 2.0 * s, 6 * s
        x, y, z = sign * arms[s, 0], sign * arms[s, 1], sign * arms[s, 2]
        for c in range(3):
            for n in range(6):
                jacobian[c, base + n] = 0.0
            jacobian[c, base + c] = sign
        jacobian[0, base + 4], jacobian[0, base + 5] = z, -y
        jacobian[1, base + 3], jacobian[1, base + 5] = -z, x
        jacobian[2, base + 3], jacobian[2, base + 4] = y, -x
    for m in range(12):
        for n in range(12):
            for c in range(3):
                hessian[m, n] += stiffness * jacobian[c, m] * jacobian[c, n]
    _add_turning(arms[0], g, 1.0, hessian, 3)
    _add_turning(arms[1], g, -1.0, hessian, 9)


@kernel
def _add_alignment(stiffness, u, v, with_hessian, own, k, hessian):
    """Add ½ k_θ |u − v|² of joint k: the energy."""
    energy, moment = 0.0, cross(u, v)
    for c in range(3):
        energy += 0.5 * stiffness * (u[c] - v[c]) ** 2
        own[2 * k, 3 + c] -= stiffness * moment[c]
        own[2 * k + 1, 3 + c] += stiffness * moment[c]
    if with_hessian:
        add_product(u, v, -stiffness, hessian)
    return energy


@kernel
def _add_crossing(stiffness, u, v, with_hessian, own, k, hessian):
    """Add ½ k_θ (u·v)² of joint k: the energy."""
    cosine, slope = dot(u, v), cross(u, v)
    for c in range(3):
        own[2 * k, 3 + c] += stiffness * cosine * slope[c]
        own[2 * k + 1, 3 + c] -= stiffness * cosine * slope[c]
    if with_hessian:
        add_product(u, v, stiffness * cosine, hessian)
        for m in range(3):
            for n in range(3):
                square = stiffness * slope[m] * slope[n]
                hessian[3 + m, 3 + n] += square
                hessian[9 + m, 9 + n] += square
                hessian[3 + m, 9 + n] -= square
                hessian[9 + m, 3 + n] -= square
    return 0.5 * stiffness * cosine * cosine


@piece(float, Joints, Problem, Configuration, Stage, bool)
def add_joints(joints, p, at, stage, with_hessian):
    """Add the energy and derivatives of all joints."""
    sums, total, own, apart = p.sums, 0.0, joints.gradient, joints.apart
    own[:] = 0.0
    if not sums.selected[JOINTS]:
        return math.inf
    arms, u, v, d, g = stack_matrix(2, 3), stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    along, hessian = stack_vector(12), stack_matrix(12, 12)
    for k in range(joints.aligned.shape[0]):
        a, b, stiffness = joints.body[2 * k], joints.body[2 * k + 1], joints.stiffness[k]
        if with_hessian:
            hessian[:] = 0.0
        _turned(at.rotation, a, joints.arm, 2 * k, arms[0])
        _turned(at.rotation, b, joints.arm, 2 * k + 1, arms[1])
        for c in range(3):
            d[c] = (at.pose_position[a, c] - at.pose_position[b, c]) + (arms[0, c] - arms[1, c])
            g[c] = stiffness * d[c]
        add_force(own, 2 * k, 1.0, arms[0], g)
        add_force(own, 2 * k + 1, -1.0, arms[1], g)
        if with_hessian:
            _add_point(stiffness, arms, g, hessian)
        if joints.slides[k]:
            _turned(at.rotation, a, joints.direction[2 * k], 0, u)
            way = -(u[0] * d[0] + u[1] * d[1] + u[2] * d[2])
            add_way(at, a, b, u, arms[1], -stiffness * way, -stiffness, with_hessian, along, hessian)
            for c in range(6):
                own[2 * k, c] -= stiffness * way * along[c]
                own[2 * k + 1, c] -= stiffness * way * along[6 + c]
            for c in range(3):
                d[c] += way * u[c]
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        total += 0.5 * stiffness * square
        apart[k, 0], apart[k, 1] = math.sqrt(square), 0.0
        bending = 0.0
        for j in range(joints.aligned[k]):
            _turned(at.rotation, a, joints.direction[2 * k], j, u)
            _turned(at.rotation, b, joints.direction[2 * k + 1], j, v)
            part = joints.torsional[k] if joints.aligned[k] == 1 else 0.5 * joints.torsional[k]
            bending += _add_alignment(part, u, v, with_hessian, own, k, hessian)
        apart[k, 1] = math.sqrt(2.0 * bending / joints.torsional[k])
        total += bending
        if joints.crossed[k]:
            _turned(at.rotation, a, joints.direction[2 * k], 0, u)
            _turned(at.rotation, b, joints.direction[2 * k + 1], 0, v)
            energy = _add_crossing(joints.torsional[k], u, v, with_hessian, own, k, hessian)
            apart[k, 1] = math.sqrt(2.0 * energy / joints.torsional[k])
            total += energy
        for n in range(6):
            sums.contact[a, n] += own[2 * k, n]
            sums.contact[b, n] += own[2 * k + 1, n]
        if with_hessian:
            scatter_pair(joints.free[2 * k], joints.free[2 * k + 1], hessian, sums.body_hessian)
    sums.energy[JOINTS] += total
    return math.inf


def joints_of(model: Model) -> Joints:
    """Return the record of a model; absent if its scene has no joints."""
    joints, bodies = model.scene.joints, model.bodies
    if not joints:
        return Joints.absent()
    body = np.array([[bodies.names.index(name) for name in joint.bodies] for joint in joints])
    turned = bodies.start_rotation[body]  # (n, 2, 3, 3), columns: axes of the body
    arms = np.array([joint.point for joint in joints])[:, None] - bodies.start_position[body]
    directions = np.array([_directions(joint) for joint in joints])
    edge, bend = stiffness_of_joints(model)
    return Joints(
        body=body.reshape(-1),
        free=model.free_bodies.free_index[body].reshape(-1),
        arm=np.einsum("ksij,ksi->ksj", turned, arms).reshape(-1, 3),
        direction=np.einsum("ksij,ksni->ksnj", turned, directions).reshape(-1, 3, 3),
        aligned=np.array([ALIGNED[joint.type] for joint in joints]),
        slides=np.array([joint.type in SLIDES for joint in joints]),
        crossed=np.array([joint.type == "universal" for joint in joints]),
        stiffness=np.array([joint.stiffness or edge for joint in joints], dtype=float),
        torsional=np.array([joint.torsional_stiffness or bend for joint in joints], dtype=float),
        gradient=np.zeros((2 * len(joints), 6)),
        apart=np.zeros((len(joints), 2)),
    )


def _directions(joint: Joint) -> np.ndarray:
    """Return for either body the axis, any for a weld or a pin, and two directions across it, shape (2, 3, 3)."""
    first = np.array(joint.axis if joint.axis is not None else (1.0, 0.0, 0.0))
    second = np.array(joint.second_axis if joint.second_axis is not None else first)
    return np.stack([[axis, across(axis), np.cross(axis, across(axis))] for axis in (first, second)])
