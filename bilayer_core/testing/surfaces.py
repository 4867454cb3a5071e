"""Surfaces of a scene and what meets them, read from the scene: a check of gaps that has no part of the solver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bilayer_core.model.model import Model
from bilayer_core.scene.body import Body, Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.shape import Obstacle, Surface

Array = np.ndarray
TINY = 1e-12
"""Distance from an edge [m] below which the curvature about it counts as that."""
FIXED, SCHEDULED, FREE = 0, 1, 2
"""How something moves."""


@dataclass(frozen=True)
class SceneSurface:
    """A surface of a body or an obstacle.

    `half` are its half sizes, rounding included [m]; `body` the index of its owner, after the last that of the world;
    position and rotation those in its frame.
    """

    name: str
    body: int
    kind: str
    half: Array
    rounding: float
    position: Array
    rotation: Array
    rim_points: int = 0

    @property
    def smallest(self) -> float:
        """Half of what has to be passed through to be behind it [m]; infinite for a half space."""
        return math.inf if self.kind == "plane" else float(self.half.min())

    def distance(self, x: Array) -> Array:
        """Return the signed distance of points of its frame [m], shape (n, 3) to (n,)."""
        if self.kind == "plane":
            return x[:, 2]
        if self.kind == "sphere":
            return np.linalg.norm(x, axis=1) - self.half[0]
        core = self.half - self.rounding
        if self.kind == "box":
            beyond = np.abs(x) - core
        else:
            beyond = np.stack([np.hypot(x[:, 0], x[:, 1]) - core[0], np.abs(x[:, 2]) - core[2]], axis=1)
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.where((beyond > 0.0).any(axis=1), outside, beyond.max(axis=1)) - self.rounding

    def bend(self, x: Array, reach: Array) -> Array:
        """Return a bound of the curvature of `distance` within `reach` [m] of points of its frame [1/m], shape (n,)."""
        if self.kind == "plane":
            return np.zeros(len(x))
        if self.kind == "sphere":
            return 1.0 / np.maximum(np.linalg.norm(x, axis=1) - reach, TINY)
        core = self.half - self.rounding
        if self.kind == "box":
            across, round_about = np.abs(x) - core, np.zeros(len(x))
        else:
            from_axis = np.hypot(x[:, 0], x[:, 1])
            across = np.stack([from_axis - core[0], np.abs(x[:, 2]) - core[2]], axis=1)
            round_about = np.where(from_axis - core[0] > -reach, 1.0 / np.maximum(from_axis - reach, TINY), 0.0)
        one_face = (across > reach[:, None]).any(axis=1) & ((across > -reach[:, None]).sum(axis=1) == 1)
        outside = np.linalg.norm(np.maximum(across, 0.0), axis=1)
        return round_about + np.where(one_face, 0.0, 1.0 / np.maximum(outside - reach, TINY))

    def points(self) -> Array:
        """Return the corners or rims of what is rounded, or the centre of a ball, in the owner's frame [m]."""
        core = self.half - self.rounding
        if self.kind == "plane":
            return np.zeros((0, 3))
        if self.kind == "sphere":
            own = np.zeros((1, 3))
        elif self.kind == "box":
            own = core * np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        else:
            angle = 2.0 * math.pi * np.arange(self.rim_points) / self.rim_points
            rim = np.stack([core[0] * np.cos(angle), core[0] * np.sin(angle)], axis=1)
            own = np.concatenate([np.insert(rim, 2, height, axis=1) for height in (-core[2], core[2])])
        return self.position + own @ self.rotation.T


def surfaces_of(scene: SceneConfig) -> list[SceneSurface]:
    """Return all surfaces of a scene, those of obstacles first."""
    of_obstacles = [_surface(obstacle, obstacle.name, obstacle.type, len(scene.bodies)) for obstacle in scene.obstacles]
    of_bodies = [
        _surface(body.surface, body.name, body.surface.shape, index)
        for index, body in enumerate(scene.bodies)
        if body.surface is not None
    ]
    return of_obstacles + of_bodies


def _surface(shape: Surface | Obstacle, name: str, kind: str, body: int) -> SceneSurface:
    position, turned, rounding = np.zeros(3), Rotation.identity(), getattr(shape, "rounding", 0.0)
    if hasattr(shape, "type"):
        position = np.array(shape.point if kind == "plane" else shape.position)
    if kind in ("plane", "cylinder"):
        turned, _ = Rotation.align_vectors([shape.normal if kind == "plane" else shape.axis], [[0.0, 0.0, 1.0]])
    if kind == "plane":
        half = np.zeros(3)
    elif kind == "sphere":
        half, rounding = np.full(3, shape.radius), shape.radius
    elif kind == "box":
        half, turned = 0.5 * np.array(shape.size), Rotation.from_rotvec(getattr(shape, "rotation", np.zeros(3)))
    else:
        half = np.array([shape.radius, shape.radius, 0.5 * shape.length])
    rim_points = shape.rim_points if kind == "cylinder" else 0
    return SceneSurface(name, body, kind, half, rounding, position, turned.as_matrix(), rim_points)


def _mobility(body: Body) -> int:
    """Return how a body moves."""
    if not isinstance(body.motion, Prescribed):
        return FREE
    return SCHEDULED if body.motion.moves else FIXED


class BodyPoints:
    """All points of bodies and obstacles with a radius that can meet surfaces, in one row.

    Corners and rims, centres of balls, and contact points of the scene.

    Attributes
    ----------
    position : Array
        In the frame of the owner [m], shape (n_point, 3).
    radius : Array
        Of each point [m], shape (n_point,).
    body : Array
        That it belongs to, after the last the world, shape (n_point,).
    """

    def __init__(self, scene: SceneConfig):
        self._moves = np.array([*map(_mobility, scene.bodies), FIXED])
        found = [(x, of.rounding, of.body, FREE) for of in surfaces_of(scene) for x in of.points()]
        for index, body in enumerate(scene.bodies):
            found += [(point.position, point.offset, index, SCHEDULED) for point in body.contact_points]
        position, radius, body, least = zip(*found, strict=True) if found else ((), (), (), ())
        self.position, self.radius = np.array(position, dtype=float).reshape(-1, 3), np.array(radius, dtype=float)
        self.body, self._least = np.array(body, dtype=np.int64), np.array(least, dtype=np.int64)

    def places(self, poses: Sequence[tuple[Array, Array]]) -> Array:
        """Return where they are by the poses of bodies and the world [m], shape (n_point, 3)."""
        position, rotation = (np.array(part) for part in zip(*poses, strict=True))
        return position[self.body] + np.einsum("kij,kj->ki", rotation[self.body], self.position)

    def meeting(self, surface: SceneSurface) -> Array:
        """Return which can meet a surface: not those of its own body; one of the two must be free, or move where it is
        a contact point of the scene.
        """
        moves = np.maximum(self._moves[self.body], self._moves[surface.body])
        return np.flatnonzero((moves >= self._least) & (self.body != surface.body))

    def nodes_meeting(self, model: Model, surface: SceneSurface, gaps: Array) -> Array:
        """Return which nodes of rods can meet a surface, by their gaps at the start [m], shape (n_node,).

        What a body holds does not meet the body's own surface, nor do its neighbours up to the first that is clear of
        the barrier: a rod may grow out of a body.
        """
        meets, clear = np.ones(model.node_count, dtype=bool), gaps >= model.scene.contact.barrier_distance
        for node, body in zip(model.constrained.node, model.constrained.body, strict=True):
            meets[node] &= max(self._moves[body], self._moves[surface.body]) > FIXED
            if body != surface.body:
                continue
            strand = next(s for s in model.strands if s.first_node <= node < s.first_node + s.node_count)
            own = np.arange(strand.first_node, strand.first_node + strand.node_count)
            way = own[::-1] if node == own[-1] else own
            first_clear = np.append(np.flatnonzero(clear[way[1:]]), len(own) - 1)[0]
            meets[way[: first_clear + 1]] = False
        return meets
