"""Implicit Euler, the paper's integrator (eq. 25): order 1, strongly dissipative.

    q̃ = qₙ + h vₙ,   minimise ½ |q − q̃|²_M/h² + V(q),   v = (q − qₙ)/h

For rotations R̃ = Rₙ + h [ωₙ]× Rₙ, and [ω]× is the skew part of (R − Rₙ) Rᵀ/h.
"""

from __future__ import annotations

import numpy as np

from ..kinematics.rotation import skew
from ..model.model import Model
from ..model.state import State
from ..solve.configuration import Configuration
from ..solve.potential import StepContext

NAME = "implicit_euler"
ORDER = 1


def predict(model: Model, state: State, start: Configuration, h: float, eigenstrain: np.ndarray) -> StepContext:
    """Frozen data of a step of length `h` [s] from `state`."""
    free = model.bodies.body_of_free
    rotation = np.array(
        [r + h * skew(w) @ r for r, w in zip(start.body_rotation, state.body_angular_velocity[free], strict=True)]
    )
    return StepContext(
        length=h,
        start=start,
        predicted_position=state.position + h * state.velocity,
        predicted_turn=h * state.spin,
        predicted_body_position=start.body_position + h * state.body_velocity[free],
        predicted_body_rotation=rotation.reshape(-1, 3, 3),
        eigenstrain=eigenstrain,
    )


def accept(model: Model, state: State, context: StepContext, end: Configuration) -> None:
    """Write the end of a step into `state`: positions, frames, and the velocities that follow from them."""
    h = context.length
    state.velocity[:] = (end.position - state.position) / h
    state.position[:] = end.position
    state.director1[:] = end.director1[: model.edge_count]
    state.spin[:] = end.turn / h
    state.twist[:] = end.joint_strain[:, 2]
    for place, body in enumerate(model.bodies.body_of_free):
        moved = (end.body_rotation[place] - context.start.body_rotation[place]) @ end.body_rotation[place].T
        state.body_velocity[body] = (end.body_position[place] - context.start.body_position[place]) / h
        state.body_angular_velocity[body] = (
            0.5 / h * np.array([moved[2, 1] - moved[1, 2], moved[0, 2] - moved[2, 0], moved[1, 0] - moved[0, 1]])
        )
        state.body_position[body] = end.body_position[place]
        state.body_rotation[body] = _orthonormal(end.body_rotation[place])


def _orthonormal(matrix: np.ndarray) -> np.ndarray:
    """The rotation matrix nearest to `matrix` to first order in its error: 1.5 R − 0.5 R Rᵀ R (a Newton–Schulz step)."""
    return 1.5 * matrix - 0.5 * matrix @ matrix.T @ matrix
