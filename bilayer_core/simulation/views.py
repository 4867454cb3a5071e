"""Bodies and clamps by name, as they are at present."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..forces.mechanisms import REMEMBERED
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
        return observe.quaternion_from_matrix(self._present.state.body_rotation[self._index])

    @property
    def contact_wrench(self) -> Array:
        return observe.contact_wrenches(self._present.evaluated())[self._index].copy()

    @property
    def clamp_wrench(self) -> Array:
        return observe.clamp_wrenches(self._present.evaluated())[self._index]

    @property
    def turning(self) -> Motion | None:
        return _motion(self._present, self._name, slides=False, guides=True)

    @property
    def sliding(self) -> Motion | None:
        return _motion(self._present, self._name, slides=True, guides=True)

    @property
    def _name(self) -> str:
        return self._present.model.bodies.names[self._index]


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


@dataclass(frozen=True)
class Motion:
    """What a hinge, a rail or a joint has done along or about its axis, where something resists that.

    Attributes
    ----------
    value : float
        Angle since the start, whole turns too [rad], or way along the axis [m].
    exerted : float
        Moment about the axis [N m], or force along it [N], of spring, damping, friction and limits together, on the
        guided body or the second body of the joint.
    beyond : float
        Largest angle or way beyond a limit at the end of any step [rad, m].
    """

    value: float
    exerted: float
    beyond: float


class JointView:
    """A joint between two bodies as it is at present.

    Attributes
    ----------
    bodies : tuple of str
        The two that it joins.
    wrench : Array
        Force [N] that it exerts on the first of them, and moment about the joint [N m], in the world's axes, shape
        (6,); on the second the opposite. What resists its turn or its way is part of it.
    distance, angle : float
        By how much it gives way: distance of the two points, on a slide or a cylinder across the axis [m], and the
        largest angle of a direction that it keeps [rad].
    turning, sliding : Motion or None
        About and along its axis, where the scene has `turning` or `sliding`.
    """

    def __init__(self, present: Present, name: str, bodies: tuple[str, str], index: int):
        self._present, self._name, self.bodies, self._index = present, name, bodies, index

    def __repr__(self) -> str:
        return f"joint of {self.bodies[0]} and {self.bodies[1]}, {self.distance:.2g} m and {self.angle:.2g} rad apart"

    @property
    def wrench(self) -> Array:
        engine, first = self._present.evaluated().engine, 2 * self._index
        joints = engine.joints
        body, wrench = joints.body[first], -joints.gradient[first]
        for index in _of_owner(self._present, self._name, guides=False).values():
            wrench = wrench - engine.mechanisms.gradient[2 * index]
        arm = self._present.state.body_rotation[body] @ joints.arm[first]
        wrench[3:] -= np.cross(arm, wrench[:3])
        return wrench

    @property
    def distance(self) -> float:
        return float(self._present.evaluated().engine.joints.apart[self._index, 0])

    @property
    def angle(self) -> float:
        return float(self._present.evaluated().engine.joints.apart[self._index, 1])

    @property
    def turning(self) -> Motion | None:
        return _motion(self._present, self._name, slides=False, guides=False)

    @property
    def sliding(self) -> Motion | None:
        return _motion(self._present, self._name, slides=True, guides=False)


def _of_owner(present: Present, owner: str, guides: bool) -> dict[bool, int]:
    """Slots of the mechanisms of a joint or of a guided body, by whether they slide."""
    return {
        mechanism.slides: index
        for index, mechanism in enumerate(present.model.mechanisms)
        if mechanism.owner == owner and mechanism.is_guide == guides
    }


def _motion(present: Present, owner: str, slides: bool, guides: bool) -> Motion | None:
    index = _of_owner(present, owner, guides).get(slides)
    if index is None:
        return None
    mechanisms = present.evaluated().engine.mechanisms
    first, gradient, axis = mechanisms.body[2 * index], -mechanisms.gradient[2 * index + 1], mechanisms.axis[index]
    if first < len(present.state.body_rotation):  # not the world
        axis = present.state.body_rotation[first] @ axis
    exerted = (gradient[:3] if slides else gradient[3:]) @ axis
    beyond = present.state.memory[mechanisms.memory[0] + REMEMBERED * index + 1]
    return Motion(float(mechanisms.value[index]), float(exerted), float(beyond))


def joint_views(present: Present) -> dict[str, JointView]:
    """Every joint by name."""
    joints = enumerate(present.model.scene.joints)
    return {joint.name: JointView(present, joint.name, joint.bodies, index) for index, joint in joints}


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
