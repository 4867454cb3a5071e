"""Joints: stiff springs between points and directions of two bodies.

With the arms ρ = R r from the bodies' positions, the distance d = X_A + ρ_A − X_B − ρ_B of the two points, and unit
vectors u_A, u_B that were one at the start (none on a pin, the axis on a hinge, two on a weld),

    E = ½ k |d|² + ½ k_θ Σ |u_A − u_B|²

Arms and vectors turn by x → x + φ×x + ½ φ×(φ×x), see `engine.linear.attachments`. With g = k d,

    ∂E/∂(X_A, φ_A) = (g, ρ_A×g − k_θ Σ u_A×u_B),      ∂E/∂(X_B, φ_B) = (−g, −ρ_B×g + k_θ Σ u_A×u_B)

    Hessian of the first term    k JᵀJ + T(ρ_A, g) − T(ρ_B, g),    J = (1, −[ρ_A]×, −1, [ρ_B]×)
    of the second                by (φ_A, φ_A) and (φ_B, φ_B)  −k_θ T(u_A, u_B),
                                 by (φ_A, φ_B)                 −k_θ ((u_A·u_B) 1 − u_B u_Aᵀ)

and T(a, b) = ½ (a bᵀ + b aᵀ) − (a·b) 1. Since |u_A − u_B|² = 2 − 2 u_A·u_B, only the product acts; the energy is taken
from the difference, which keeps its digits. A joint gives way by d = F/k, which `sim.joints` and summaries state.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import kernel, piece, record
from ..jit.record import Indices, Matrix, Stack, Vector
from ..jit.stack import stack_matrix, stack_vector
from ..model.force_slots import slot_of
from ..model.model import Model
from ..model.records.problem import Problem
from ..model.records.step import Configuration, Stage
from .contact_on_bodies import add_force

JOINTS = slot_of("joints")
STIFFER = 100.0
"""Than the stiffest edge and the stiffest bend of a rod."""
ACROSS = {"pin": 0, "hinge": 1, "weld": 2}
"""How many directions a joint keeps."""


@record
class Joints:
    """Joints of a model, and what each exerted at the last evaluation."""

    body: Indices  # A and B of each in turn, among all bodies, shape (2 n_joint,)
    free: Indices  # likewise among the free ones, −1 for a prescribed one
    arm: Matrix  # r in the axes of the body, A and B in turn [m], shape (2 n_joint, 3)
    direction: Stack  # u in the axes of the body, likewise, shape (2 n_joint, 2, 3)
    aligned: Indices  # how many directions each aligns, shape (n_joint,)
    stiffness: Vector  # k [N/m], shape (n_joint,)
    torsional: Vector  # k_θ [N m], shape (n_joint,)
    gradient: Matrix  # ∂E/∂(X, φ) of A and B in turn [N, N m], shape (2 n_joint, 6)


@kernel
def _turned(rotation, b, local, k, out):
    """R r of a body."""
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
    """Second derivatives of the distance of two points by (X_A, φ_A, X_B, φ_B), shape (12, 12)."""
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
def _add_direction(stiffness, u, v, hessian):
    """Likewise of the difference of two unit vectors."""
    _add_turning(u, v, -stiffness, hessian, 3)
    _add_turning(u, v, -stiffness, hessian, 9)
    product = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    for i in range(3):
        for j in range(3):
            value = stiffness * v[i] * u[j]
            hessian[3 + i, 9 + j] += value
            hessian[9 + j, 3 + i] += value
        hessian[3 + i, 9 + i] -= stiffness * product
        hessian[9 + i, 3 + i] -= stiffness * product


@piece(float, Joints, Problem, Configuration, Stage, bool)
def add_joints(joints, p, at, stage, with_hessian):
    """Energy and derivatives of all joints."""
    sums, total = p.sums, 0.0
    if not sums.selected[JOINTS]:
        return math.inf
    arms, u, v, g, zero = stack_matrix(2, 3), stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    zero[0] = zero[1] = zero[2] = 0.0
    hessian = stack_matrix(12, 12)
    for k in range(joints.aligned.shape[0]):
        a, b = joints.body[2 * k], joints.body[2 * k + 1]
        own = joints.gradient
        for s in range(2):
            for n in range(6):
                own[2 * k + s, n] = 0.0
        if with_hessian:
            for m in range(12):
                for n in range(12):
                    hessian[m, n] = 0.0
        _turned(at.rotation, a, joints.arm, 2 * k, arms[0])
        _turned(at.rotation, b, joints.arm, 2 * k + 1, arms[1])
        for c in range(3):
            apart = (at.pose_position[a, c] - at.pose_position[b, c]) + (arms[0, c] - arms[1, c])
            g[c] = joints.stiffness[k] * apart
            total += 0.5 * g[c] * apart
        add_force(own, 2 * k, 1.0, arms[0], g)
        add_force(own, 2 * k + 1, -1.0, arms[1], g)
        if with_hessian:
            _add_point(joints.stiffness[k], arms, g, hessian)
        for j in range(joints.aligned[k]):
            _turned(at.rotation, a, joints.direction[2 * k], j, u)
            _turned(at.rotation, b, joints.direction[2 * k + 1], j, v)
            for c in range(3):
                total += 0.5 * joints.torsional[k] * (u[c] - v[c]) ** 2
                m, n = (c + 1) % 3, (c + 2) % 3
                moment = joints.torsional[k] * (u[m] * v[n] - u[n] * v[m])
                own[2 * k, 3 + c] -= moment
                own[2 * k + 1, 3 + c] += moment
            if with_hessian:
                _add_direction(joints.torsional[k], u, v, hessian)
        for n in range(6):
            sums.contact[a, n] += own[2 * k, n]
            sums.contact[b, n] += own[2 * k + 1, n]
        if with_hessian:
            _scatter(joints.free[2 * k], joints.free[2 * k + 1], hessian, sums.body_hessian)
    sums.energy[JOINTS] = total
    return math.inf


@kernel
def _scatter(first, second, block, out):
    """Add a block by (X_A, φ_A, X_B, φ_B) to the second derivatives of free bodies."""
    for m in range(12):
        f = first if m < 6 else second
        if f < 0:
            continue
        row = 6 * f + m % 6
        for n in range(12):
            other = first if n < 6 else second
            if other >= 0:
                out[row, 6 * other + n % 6] += block[m, n]


def joints_of(model: Model) -> Joints:
    """The record of a model; absent where its scene has no joints."""
    joints, bodies = model.scene.joints, model.bodies
    if not joints:
        return Joints.absent()
    body = np.array([[bodies.names.index(name) for name in joint.bodies] for joint in joints])
    turned = bodies.start_rotation[body]  # (n, 2, 3, 3), columns: axes of the body
    arms = np.array([joint.point for joint in joints])[:, None] - bodies.start_position[body]
    directions = np.array([_directions(joint.axis) for joint in joints])
    edge = float((model.axial_stiffness / model.rest_length).max())
    bend = float(model.joint_stiffness.max())
    return Joints(
        body=body.reshape(-1),
        free=bodies.free_index[body].reshape(-1),
        arm=np.einsum("ksij,ksi->ksj", turned, arms).reshape(-1, 3),
        direction=np.einsum("ksij,kni->ksnj", turned, directions).reshape(-1, 2, 3),
        aligned=np.array([ACROSS[joint.type] for joint in joints]),
        stiffness=np.array([joint.stiffness or STIFFER * edge for joint in joints], dtype=float),
        torsional=np.array([joint.torsional_stiffness or STIFFER * bend for joint in joints], dtype=float),
        gradient=np.zeros((2 * len(joints), 6)),
    )


def _directions(axis: tuple[float, float, float] | None) -> np.ndarray:
    """The axis of a hinge, or that of a weld, which may be any, and a direction across, shape (2, 3)."""
    first = np.array(axis if axis is not None else (1.0, 0.0, 0.0))
    across = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
    return np.stack([first, across / np.linalg.norm(across)])
