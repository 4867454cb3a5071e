"""Shapes of a scene as numbers: their signed distance, the points that feel other surfaces, inertia, what to draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.contact import shapes as kinds
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.scene import shape as scene_shapes

NUMBER = {"plane": kinds.PLANE, "sphere": kinds.SPHERE, "box": kinds.BOX, "cylinder": kinds.CYLINDER}


@dataclass(frozen=True)
class Shape:
    """A shape in the frame of its owner.

    Attributes
    ----------
    kind : str
        ``"plane"``, ``"sphere"``, ``"box"`` or ``"cylinder"``.
    half : ndarray
        Half sizes along its own axes, rounding included [m], shape (3,); zero for a plane.
    rounding : float
        Radius of its edges, that of a sphere [m].
    rotation : ndarray
        Columns are its own axes in the owner's frame; z is a cylinder's axis and a plane's normal, shape (3, 3).
    rim_points : int
        Points on each rim of a cylinder.
    """

    kind: str
    half: np.ndarray
    rounding: float
    rotation: np.ndarray
    rim_points: int = 0

    @property
    def core(self) -> np.ndarray:
        """Half sizes of what is rounded [m], shape (3,)."""
        return np.maximum(self.half - self.rounding, 0.0)

    @property
    def bound(self) -> float:
        """Radius of a ball about its centre that holds it [m]."""
        if self.kind == "plane":
            return np.inf
        core = self.core
        corner = np.hypot(core[0], core[2]) if self.kind == "cylinder" else np.linalg.norm(core)
        return float(corner + self.rounding)

    def points(self) -> tuple[np.ndarray, float, float]:
        """Return the points that feel other surfaces, in the owner's frame [m], shape (·, 3), their radius and their
        length Δl [m].

        A ball is its centre with its radius, also as length. Corners of a box stand for half of each of their three
        edges, points on the rim of a cylinder for their part of it. Where rounding leaves nothing between two, they are
        one.
        """
        core = self.core
        if self.kind == "plane":
            return np.zeros((0, 3)), 0.0, 0.0
        if self.kind == "sphere":
            return np.zeros((1, 3)), self.rounding, self.rounding
        if self.kind == "box":
            signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij")).reshape(3, -1).T
            points, length = core * signs, float(self.half.sum())
        else:
            angle = 2.0 * np.pi * np.arange(self.rim_points) / self.rim_points
            rim = core[0] * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
            points = np.concatenate([rim + side * core[2] * np.array([0.0, 0.0, 1.0]) for side in (-1.0, 1.0)])
            length = 2.0 * np.pi * self.half[0] / self.rim_points
        found = np.unique(points + 0.0, axis=0)  # + 0.0: one kind of zero
        return found @ self.rotation.T, self.rounding, length * len(points) / len(found)

    def inertia(self, mass: float, shell: bool = False) -> np.ndarray:
        """Return the inertia tensor of the solid shape, without regard to its rounding, or of a hollow ball [kg m²]."""
        a, b, c = self.half
        if self.kind == "sphere":
            moments = (2.0 / 3.0 if shell else 0.4) * a**2 * np.ones(3)
        elif self.kind == "box":
            moments = np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2]) / 3.0
        else:
            across = 0.25 * a**2 + c**2 / 3.0
            moments = np.array([across, across, 0.5 * a**2])
        return mass * (self.rotation * moments) @ self.rotation.T


def axis_frame(axis: np.ndarray) -> np.ndarray:
    """Return the rotation that takes z to `axis` (unit) on the shortest way; about x where they are opposite, shape (3,
    3).
    """
    cross = np.array([-axis[1], axis[0], 0.0])
    sine = np.linalg.norm(cross)
    if sine == 0.0:
        return np.eye(3) if axis[2] > 0.0 else np.diag([1.0, -1.0, -1.0])
    return rotation_matrix(np.arctan2(sine, axis[2]) / sine * cross)


def shape_of(surface: scene_shapes.Surface | scene_shapes.Obstacle) -> Shape:
    """Return the shape of a surface of a body, or of an obstacle (the rotation of a box obstacle is not part of it)."""
    kind = surface.shape if hasattr(surface, "shape") else surface.type
    if kind == "plane":
        return Shape(kind, np.zeros(3), 0.0, axis_frame(np.array(surface.normal)))
    if kind == "sphere":
        return Shape(kind, np.full(3, surface.radius), surface.radius, np.eye(3))
    if kind == "box":
        return Shape(kind, 0.5 * np.array(surface.size), surface.rounding, np.eye(3))
    half = np.array([surface.radius, surface.radius, 0.5 * surface.length])
    return Shape(kind, half, surface.rounding, axis_frame(np.array(surface.axis)), surface.rim_points)


def obstacle_pose(obstacle: scene_shapes.Obstacle) -> tuple[np.ndarray, np.ndarray]:
    """Return the position [m], shape (3,), and rotation of an obstacle, shape (3, 3)."""
    position = obstacle.point if obstacle.type == "plane" else obstacle.position
    rotation = rotation_matrix(np.array(obstacle.rotation)) if obstacle.type == "box" else np.eye(3)
    return np.array(position), rotation


def signed_distance(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Return the distance of points of the owner's frame from a shape [m], negative inside (there up to the rounding of
    edges).

    Parameters
    ----------
    shape : Shape
    points : ndarray
        [m], shape (·, 3).
    """
    own, core = points @ shape.rotation, shape.core
    if shape.kind == "plane":
        return own[:, 2]
    if shape.kind == "sphere":
        return np.linalg.norm(own, axis=1) - shape.rounding
    if shape.kind == "cylinder":
        own, core = np.stack([np.hypot(own[:, 0], own[:, 1]), own[:, 2]], axis=1), core[[0, 2]]
    beyond = np.abs(own) - core
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0.0) - shape.rounding
