"""How joints, and hinges and rails of guided bodies, are drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.kinematics.rotation import quaternion_from_matrix
from bilayer_core.model.bend_faces import whole_section
from bilayer_core.model.model import Model
from bilayer_core.observed.frame import JointInfo, ShapeInfo
from bilayer_core.scene.body import Guided
from bilayer_core.scene.joint import Joint

RADIUS, LEAST_RADIUS = 0.75, 0.04
"""Of pins and axes: over the largest thickness of a rod, and at least over its width."""
HINGE_LENGTH, RAIL_LENGTH = 1.2, 8.0
"""Of axes and rails, in widths of the widest rod."""
RAIL_RADIUS = 0.5
"""In radii of pins."""
WORLD = -1


def joint_shapes(model: Model) -> tuple[JointInfo, ...]:
    """Return the shapes of all joints and guides of a model."""
    return tuple([*_of_joints(model), *_of_guides(model)])


def _sizes(model: Model) -> tuple[float, float]:
    """Return the radius of pins, and the width of the widest rod [m]."""
    width, thickness = (float(of.max()) for of in whole_section(model))
    return max(RADIUS * thickness, LEAST_RADIUS * width), width


def _of_joints(model: Model) -> Iterator[JointInfo]:
    (radius, width), bodies = _sizes(model), model.bodies
    for joint in model.scene.joints:
        first = bodies.names.index(joint.bodies[0])
        rotation = bodies.start_rotation[first]
        place = rotation.T @ (np.array(joint.point) - bodies.start_position[first])
        axis = rotation.T @ np.array(joint.axis if joint.axis is not None else (0.0, 0.0, 1.0))
        yield JointInfo(f"joints/{joint.name}", first, _shape(joint, radius, width, place, axis))


def _shape(joint: Joint, radius: float, width: float, place: np.ndarray, axis: np.ndarray) -> ShapeInfo:
    if joint.type in ("pin", "universal"):
        return _ball(radius, place)
    if joint.type == "weld":
        return ShapeInfo("box", (2.0 * radius,) * 3, 0.0, tuple(place.tolist()), (0.0, 0.0, 0.0, 1.0))
    if joint.type == "hinge":
        return _axle(radius, HINGE_LENGTH * width, place, axis)
    limits = joint.sliding.limits if joint.sliding is not None else None
    return _rail(radius, width, place, axis, limits)


def _of_guides(model: Model) -> Iterator[JointInfo]:
    (radius, width), origin = _sizes(model), np.zeros(3)
    for index, body in enumerate(model.scene.bodies):
        motion, rotation = body.motion, model.bodies.start_rotation[index]
        if not isinstance(motion, Guided):
            continue
        if motion.axis is not None:
            limits = motion.sliding.limits if motion.sliding is not None else None
            rail = _rail(radius, width, np.array(body.position), np.array(motion.axis), limits)
            yield JointInfo(f"rails/{body.name}", WORLD, rail)
        if motion.hinge is not None:
            axle = _axle(radius, HINGE_LENGTH * width, origin, rotation.T @ np.array(motion.hinge))
            yield JointInfo(f"guides/{body.name}", index, axle)
        elif motion.pinned:
            yield JointInfo(f"guides/{body.name}", index, _ball(radius, origin))


def _ball(radius: float, place: np.ndarray) -> ShapeInfo:
    return ShapeInfo("sphere", (2.0 * radius,) * 3, 0.0, tuple(place.tolist()), (0.0, 0.0, 0.0, 1.0))


def _rail(
    radius: float, width: float, place: np.ndarray, axis: np.ndarray, limits: tuple[float, float] | None
) -> ShapeInfo:
    """Return a rail between its limits, or of a usual length."""
    low, high = limits or (-0.5 * RAIL_LENGTH * width, 0.5 * RAIL_LENGTH * width)
    return _axle(RAIL_RADIUS * radius, high - low, place + 0.5 * (low + high) * axis, axis)


def _axle(radius: float, length: float, place: np.ndarray, axis: np.ndarray) -> ShapeInfo:
    """Return a cylinder, whose axis is z of its own frame."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    rotation = np.stack([across, np.cross(axis, across), axis], axis=1)
    quaternion = tuple(quaternion_from_matrix(rotation).tolist())
    return ShapeInfo("cylinder", (2.0 * radius, 2.0 * radius, length), 0.0, tuple(place.tolist()), quaternion)
