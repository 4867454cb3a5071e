"""Rigid bodies at present."""

from __future__ import annotations

import numpy as np

from bilayer_core.kinematics.rotation import quaternion_from_matrix
from bilayer_core.simulation.views.motion import Motion, motion_of
from bilayer_core.simulation.views.present import ByName, Present

Array = np.ndarray


class BodyView:
    """A rigid body as it is at present; every attribute is a copy.

    Attributes
    ----------
    position : Array
        Of its mass centre [m], shape (3,).
    quaternion : Array
        Orientation x y z w, shape (4,).
    velocity, angular_velocity : Array
        Of its mass centre [m/s], and about it [rad/s], in the world's axes, shape (3,).
    contact_wrench : Array
        Contact force [N] and moment about its position [N m], in the world's axes, shape (6,).
    clamp_wrench : Array
        Likewise, what the rods that it holds exert on it; see `engine.observables`. At the end of the last
        step: with the inertia of the held nodes, which `implicit_midpoint` does not give at the ends of its steps.
    turning, sliding : Motion or None
        About the hinge and along the rail of a guided body, where the scene has `turning` or `sliding`.
    """

    def __init__(self, present: Present, index: int):
        self._present, self._index = present, index

    def __repr__(self) -> str:
        return f"{self._name} at {self.position.tolist()}"

    @property
    def position(self) -> Array:
        return self._present.state.body_position[self._index].copy()

    @property
    def quaternion(self) -> Array:
        return quaternion_from_matrix(self._present.state.body_rotation[self._index])

    @property
    def velocity(self) -> Array:
        return self._present.state.body_velocity[self._index].copy()

    @property
    def angular_velocity(self) -> Array:
        return self._present.state.body_angular_velocity[self._index].copy()

    @property
    def contact_wrench(self) -> Array:
        return self._present.seen().contact_wrench[self._index]

    @property
    def clamp_wrench(self) -> Array:
        return self._present.seen().clamp_wrench[self._index]

    @property
    def turning(self) -> Motion | None:
        return motion_of(self._present, self._name, slides=False, guides=True)

    @property
    def sliding(self) -> Motion | None:
        return motion_of(self._present, self._name, slides=True, guides=True)

    @property
    def _name(self) -> str:
        return self._present.model.bodies.names[self._index]


def body_views(present: Present) -> ByName[BodyView]:
    """Return every body by name."""
    names = present.model.bodies.names
    return ByName("bodies", {name: BodyView(present, index) for index, name in enumerate(names)})
