"""Bodies and clamps by name, as they are at present."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..model.model import Model
from ..model.state import State
from . import observation as observe
from .stepper import Stepper

Array = np.ndarray


@dataclass(frozen=True)
class Present:
    """What views look at: a model, its state, and what evaluates the forces there."""

    model: Model
    state: State
    evaluated: Callable[[], Stepper]


class BodyView:
    """A rigid body as it is at present; every attribute is a copy.

    Attributes
    ----------
    position : Array
        Of its mass centre [m], shape (3,).
    quaternion : Array
        Orientation x y z w, shape (4,).
    contact_wrench : Array
        Contact force [N] and moment about its position [N m], in the world's axes, shape (6,).
    clamp_wrench : Array
        Likewise, what the rods that it holds exert on it; see `observation.clamp_wrenches`. At the end of the last
        step: with the inertia of the held nodes, which `implicit_midpoint` does not give at the ends of its steps.
    """

    def __init__(self, present: Present, index: int):
        self._present, self._index = present, index

    def __repr__(self) -> str:
        return f"{self._present.model.bodies.names[self._index]} at {self.position.tolist()}"

    @property
    def position(self) -> Array:
        return self._present.state.body_position[self._index].copy()

    @property
    def quaternion(self) -> Array:
        return observe.quaternion_from_matrix(self._present.state.body_rotation[self._index])

    @property
    def contact_wrench(self) -> Array:
        return observe.contact_wrenches(self._present.evaluated())[self._index].copy()

    @property
    def clamp_wrench(self) -> Array:
        return observe.clamp_wrenches(self._present.evaluated())[self._index]


class ClampView:
    """An end of a rod that a body holds, as it is at present.

    Attributes
    ----------
    body : str
        What holds it.
    position : Array
        Middle of the nodes that are held [m], shape (3,).
    wrench : Array
        Force [N] that the end exerts on the body, and moment about `position` [N m], in the world's axes, shape (6,).
    """

    def __init__(self, present: Present, body: str, held: list[int]):
        self._present, self.body, self._held = present, body, held

    def __repr__(self) -> str:
        return f"clamp by {self.body} at {self.position.tolist()}"

    @property
    def position(self) -> Array:
        present = self._present
        return present.state.position[present.model.attached_node[self._held]].mean(axis=0)

    @property
    def wrench(self) -> Array:
        present = self._present
        wrench = observe.each_clamp(present.evaluated())[self._held].sum(axis=0)
        body = present.model.attached_body[self._held[0]]
        wrench[3:] -= np.cross(self.position - present.state.body_position[body], wrench[:3])
        return wrench


class JointView:
    """A joint between two bodies as it is at present.

    Attributes
    ----------
    bodies : tuple of str
        The two that it joins.
    wrench : Array
        Force [N] that it exerts on the first of them, and moment about the joint [N m], in the world's axes, shape
        (6,); on the second the opposite.
    distance, angle : float
        By how much it gives way: of the two points [m], and of the directions that it keeps [rad].
    """

    def __init__(self, present: Present, bodies: tuple[str, str], index: int):
        self._present, self.bodies, self._index = present, bodies, index

    def __repr__(self) -> str:
        return f"joint of {self.bodies[0]} and {self.bodies[1]}, {self.distance:.2g} m and {self.angle:.2g} rad apart"

    @property
    def wrench(self) -> Array:
        joints, first = self._present.evaluated().engine.joints, 2 * self._index
        body, wrench = joints.body[first], -joints.gradient[first]
        arm = self._present.state.body_rotation[body] @ joints.arm[first]
        wrench[3:] -= np.cross(arm, wrench[:3])
        return wrench

    @property
    def distance(self) -> float:
        joints = self._present.evaluated().engine.joints
        return float(np.linalg.norm(self.wrench[:3]) / joints.stiffness[self._index])

    @property
    def angle(self) -> float:
        joints = self._present.evaluated().engine.joints
        return float(np.linalg.norm(self.wrench[3:]) / joints.torsional[self._index])


def joint_views(present: Present) -> dict[str, JointView]:
    """Every joint by name."""
    joints = enumerate(present.model.scene.joints)
    return {joint.name: JointView(present, joint.bodies, index) for index, joint in joints}


def body_views(present: Present) -> dict[str, BodyView]:
    """Every body by name."""
    return {name: BodyView(present, index) for index, name in enumerate(present.model.bodies.names)}


def clamp_views(present: Present) -> dict[str, ClampView]:
    """Every held end of a rod, as ``ROD.start`` or ``ROD.end``."""
    model, ends = present.model, {}
    for strand in model.strands:
        ends[strand.first_node] = f"{strand.rod}.start"
        ends[strand.first_node + strand.node_count - 1] = f"{strand.rod}.end"
    held: dict[str, list[int]] = {}
    for index, node in enumerate(model.attached_node.tolist()):
        held.setdefault(ends[node], []).append(index)
    names = model.bodies.names
    return {end: ClampView(present, names[model.attached_body[own[0]]], own) for end, own in held.items()}
