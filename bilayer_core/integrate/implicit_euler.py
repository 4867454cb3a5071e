"""Implicit Euler, the paper's integrator (eq. 29): order 1, strongly dissipative.

    q̃ = qₙ + h vₙ,   minimise ½ |q − q̃|²_M/h² + V(q),   v = (q − qₙ)/h

Rotations of bodies are treated likewise on their group: R̃ = exp(h [ω̃]×) Rₙ with ω̃ = ωₙ + h I⁻¹ (I ωₙ × ωₙ) (the
torque-free change of a body that is no
ball), and ω = log(R Rₙᵀ)/h. A ball that spins freely keeps its spin; with R̃ = Rₙ + h [ωₙ]× Rₙ, implicit Euler of the
mass points, it
would lose h ω²/2 of it in each unit of time.
"""

from __future__ import annotations

import numpy as np

from ..kinematics.rotation import rotation_matrix, rotation_vector
from ..model.model import Model
from ..model.state import State
from ..solve.configuration import Configuration
from ..solve.terms.fluid import momentum_of_fluid
from ..solve.terms.term import StepContext

NAME = "implicit_euler"
ORDER = 1


def predict(
    model: Model, state: State, start: Configuration, h: float, eigenstrain: np.ndarray, load_factor: np.ndarray
) -> StepContext:
    """Frozen data of a step of length `h` [s] from `state`."""
    free = model.bodies.body_of_free
    rotation = np.empty((len(free), 3, 3))
    for place, body in enumerate(free):
        spin = _torque_free_spin(model, place, start.body_rotation[place], state.body_angular_velocity[body], h)
        rotation[place] = rotation_matrix(h * spin) @ start.body_rotation[place]
    return StepContext(
        length=h,
        start=start,
        predicted_position=state.position + h * state.velocity,
        predicted_turn=h * state.spin,
        predicted_body_position=start.body_position + h * state.body_velocity[free],
        predicted_body_rotation=rotation,
        fluid_momentum=momentum_of_fluid(model, start, state.velocity),
        eigenstrain=eigenstrain,
        load_factor=load_factor,
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
        turn = end.body_rotation[place] @ context.start.body_rotation[place].T
        state.body_velocity[body] = (end.body_position[place] - context.start.body_position[place]) / h
        state.body_angular_velocity[body] = rotation_vector(turn) / h
        state.body_position[body] = end.body_position[place]
        state.body_rotation[body] = _orthonormal(end.body_rotation[place])


def _torque_free_spin(model: Model, place: int, rotation: np.ndarray, spin: np.ndarray, h: float) -> np.ndarray:
    """Angular velocity [rad/s] after a step `h` [s] without torque, to first order; unchanged for a ball."""
    if model.bodies.isotropic[place]:
        return spin
    second = model.bodies.second_moment[place]
    inertia = rotation @ (np.trace(second) * np.eye(3) - second) @ rotation.T
    return spin + h * np.linalg.solve(inertia, np.cross(inertia @ spin, spin))


def _orthonormal(matrix: np.ndarray) -> np.ndarray:
    """The rotation matrix nearest to `matrix` to first order in its error: 1.5 R − 0.5 R Rᵀ R (a Newton–Schulz
    step).
    """
    return 1.5 * matrix - 0.5 * matrix @ matrix.T @ matrix
