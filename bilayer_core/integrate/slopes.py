"""Slopes at the start of a step, for integrators that use them (`method.History`).

Those of positions are velocities. Those of momenta the last stage of the step before has left in the state, as
f = (p − p̄)/(γ′ h); no force is evaluated for them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics.rotation import rotation_matrix
from ..model.model import Model
from ..model.state import State
from .method import History
from .stages import MOMENTA, POSITIONS, Point, inertia_tensors

Array = np.ndarray
KEPT = dict(
    velocity="acceleration",
    spin="spin_acceleration",
    body_velocity="body_acceleration",
    angular_momentum="body_moment",
    fluid_momentum="fluid_force",
)
"""Where the state keeps the slope of each momentum of a `Point`."""


@dataclass(frozen=True)
class Slopes:
    """Time derivatives of a `Point`.

    Attributes
    ----------
    first : dict of str to Array
        Of its positions and momenta, by name.
    second : dict of str to Array
        Second derivatives of its positions.
    angular_velocity, angular_acceleration : Array
        Of all bodies [rad/s, rad/s²], shape (n_body, 3).
    """

    first: dict[str, Array]
    second: dict[str, Array]
    angular_velocity: Array
    angular_acceleration: Array


def slopes_of(model: Model, state: State, point: Point) -> Slopes:
    """Slopes at a state, which is `point`."""
    free = model.bodies.body_of_free
    gyroscopic = np.cross(state.body_angular_velocity[free], point.angular_momentum)
    inertia = inertia_tensors(model, state.body_rotation[free])
    acceleration, angular_acceleration = np.zeros((2, *state.body_position.shape))
    acceleration[free] = state.body_acceleration
    angular_acceleration[free] = np.linalg.solve(inertia, (state.body_moment - gyroscopic)[..., None])[..., 0]
    positions = {"position": state.velocity, "body_position": state.body_velocity, "turn": state.spin}
    return Slopes(
        first={**positions, **{name: getattr(state, kept) for name, kept in KEPT.items()}},
        second={"position": state.acceleration, "body_position": acceleration, "turn": state.spin_acceleration},
        angular_velocity=state.body_angular_velocity,
        angular_acceleration=angular_acceleration,
    )


def move_along(point: Point, slopes: Slopes, history: History, stage: int, h: float) -> None:
    """Move the origin of a stage by what the slopes at the start of a step of length `h` [s] add to it."""
    along, bend = h * history.positions[stage], h * h * history.bend
    for name in POSITIONS:
        getattr(point, name)[...] += along * slopes.first[name] + bend * slopes.second[name]
    for name in MOMENTA:
        getattr(point, name)[...] += h * history.momenta[stage] * slopes.first[name]
    turn = along * slopes.angular_velocity + bend * slopes.angular_acceleration
    for b in range(len(turn)):
        point.rotation[b] = rotation_matrix(turn[b]) @ point.rotation[b]


def keep_slopes(state: State, origin: Point, end: Point, momentum_length: float, history: History | None) -> None:
    """Write the slopes at the end of the last stage of a step into the state; without `history` just what acts there.

    Parameters
    ----------
    origin, end : Point
        Of the last stage.
    momentum_length : float
        γ′ h [s].
    history : History or None
        Of the method that made the step.
    """
    carry = history.carry if history else 0.0
    for name, kept in KEPT.items():
        acting = (getattr(end, name) - getattr(origin, name)) / momentum_length
        before = getattr(state, kept)
        before[...] = (acting - carry * before) / (1.0 - carry)
    state.kept[...] = 1.0
