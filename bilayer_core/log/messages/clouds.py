"""Surfaces and contact forces as points, for viewers that draw ``sensor_msgs/PointCloud2`` but no markers.

rerun's importer of logs is one of them; it shows the rods by the topic ``points``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.kinematics.rotation import matrix_from_quaternion
from bilayer_core.log.messages.encoders import point_cloud_template
from bilayer_core.log.messages.markers import ARROW_SHOWN, force_arrows
from bilayer_core.log.messages.topics import BODY_POINTS, FORCE_POINTS, OBSTACLE_POINTS, TopicSpec
from bilayer_core.observed.frame import Description, Frame, ShapeInfo

Array = np.ndarray
PLANE_SHARE = 1.0
"""Half the edge of the square drawn for a plane, by the largest extent of the rods at the start."""
PLANE_LINE, EDGE_POINTS, CIRCLE_POINTS = 21, 6, 24
"""Points along each edge of a plane, along each edge of a box, and round a cylinder or a sphere."""
SHAFT = np.array([1.0, 2.0, 3.0]) / 3.0
"""Where the points of an arrow are, from the node that the force acts on to the tip."""


class CloudEncoder:
    """Encodes what is not a rod as point clouds in the frame of the world.

    Parameters
    ----------
    description : Description

    Attributes
    ----------
    topics : tuple of TopicSpec
        Those that `encode` may give.
    """

    def __init__(self, description: Description):
        self._description = description
        self.topics: tuple[TopicSpec, ...] = (OBSTACLE_POINTS, BODY_POINTS, FORCE_POINTS)
        self._begun = self._had_forces = False
        self._bodies: list[Array] = []

    def encode(self, frame: Frame) -> Iterator[tuple[str, bytes]]:
        """Yield names of topics and their messages: obstacles with the first frame, forces while there are any."""
        if not self._begun:
            self._begun = True
            yield from self._begin(frame)
        if self._bodies:
            poses = zip(self._bodies, frame.body_positions, frame.body_quaternions, strict=True)
            placed = [points @ matrix_from_quaternion(q).T + position for points, position, q in poses]
            yield BODY_POINTS.name, _cloud(frame, np.concatenate(placed))
        forces = _force_points(frame)
        if len(forces) or self._had_forces:  # the last ones are replaced by none
            yield FORCE_POINTS.name, _cloud(frame, forces)
        self._had_forces = len(forces) > 0

    def _begin(self, frame: Frame) -> Iterator[tuple[str, bytes]]:
        nodes = frame.positions
        middle, size = nodes.mean(axis=0), PLANE_SHARE * float(np.ptp(nodes, axis=0).max())
        centre = np.zeros((1, 3))
        self._bodies = [
            surface_points(body.shape, np.zeros(3), size) if body.shape else centre for body in self._description.bodies
        ]
        obstacles = [surface_points(obstacle.shape, middle, size) for obstacle in self._description.obstacles]
        if obstacles:
            yield OBSTACLE_POINTS.name, _cloud(frame, np.concatenate(obstacles))


def surface_points(shape: ShapeInfo, middle: Array, plane_size: float) -> Array:
    """Return points on the surface of a shape, in the frame of its owner.

    Parameters
    ----------
    shape : ShapeInfo
    middle : ndarray
        Point next to which a plane is drawn [m], shape (3,), in the same frame.
    plane_size : float
        Half the edge of the square drawn for a plane [m].

    Returns
    -------
    ndarray
        [m], shape (points, 3).
    """
    origin, axes = np.array(shape.position), matrix_from_quaternion(np.array(shape.quaternion))
    if shape.kind == "plane":
        line = plane_size * np.linspace(-1.0, 1.0, PLANE_LINE)
        own = np.stack(np.meshgrid(line, line, [0.0]), axis=-1).reshape(-1, 3)
        origin = middle - ((middle - origin) @ axes[:, 2]) * axes[:, 2]
    else:
        own = 0.5 * np.array(shape.size) * _UNIT_POINTS[shape.kind]
    return own @ axes.T + origin


def _circle(height: float, radius: float) -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS, endpoint=False)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(CIRCLE_POINTS, height)], axis=1)


def _box() -> Array:
    line = np.linspace(-1.0, 1.0, EDGE_POINTS)
    lattice = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    return lattice[(np.abs(lattice) == 1.0).sum(axis=1) >= 2]


_EQUATOR = _circle(0.0, 1.0)
_UNIT_POINTS = {
    "sphere": np.concatenate([np.roll(_EQUATOR, shift, axis=1) for shift in range(3)]),
    "box": _box(),
    "cylinder": np.concatenate([_circle(-1.0, 1.0), _circle(1.0, 1.0)]),
}
"""On shapes from -1 to 1 along each axis: three great circles, twelve edges, two rims."""


def _force_points(frame: Frame) -> Array:
    touching = np.flatnonzero(np.linalg.norm(frame.contact_forces, axis=1) > ARROW_SHOWN)
    origins, forces = frame.positions[touching], frame.contact_forces[touching]
    tips = force_arrows(origins, forces).reshape(-1, 6, 3)[:, 1]
    return (origins[:, None] + SHAFT[:, None] * (tips - origins)[:, None]).reshape(-1, 3)


def _cloud(frame: Frame, points: Array) -> bytes:
    template = point_cloud_template(len(points), ("x", "y", "z"))
    template.views()["points"][:] = points
    template.set_time(frame.time)
    return template.to_bytes()
