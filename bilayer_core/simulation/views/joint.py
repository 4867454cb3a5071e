"""Joints between two bodies at present."""

from __future__ import annotations

import numpy as np

from bilayer_core.simulation.views.motion import Motion, motion_of
from bilayer_core.simulation.views.present import ByName, Present

Array = np.ndarray


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
        return self._present.seen().joint_wrench[self._index]

    @property
    def distance(self) -> float:
        return float(self._present.evaluated().engine.joints.apart[self._index, 0])

    @property
    def angle(self) -> float:
        return float(self._present.evaluated().engine.joints.apart[self._index, 1])

    @property
    def turning(self) -> Motion | None:
        return motion_of(self._present, self._name, slides=False, guides=False)

    @property
    def sliding(self) -> Motion | None:
        return motion_of(self._present, self._name, slides=True, guides=False)


def joint_views(present: Present) -> ByName[JointView]:
    """Return every joint by name."""
    joints = enumerate(present.model.scene.joints)
    views = {joint.name: JointView(present, joint.name, joint.bodies, index) for index, joint in joints}
    return ByName("joints", views)
