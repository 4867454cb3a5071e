"""Surfaces of a scene and what meets them, for a check of gaps that has no part of the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bilayer_core.model.contact_points import Owned, owned_shapes
from bilayer_core.model.model import Model
from bilayer_core.observed.frame import Frame

Array = np.ndarray
TINY = 1e-12
"""Distance from an edge [m] below which the curvature about it counts as that."""


class BodyPoints:
    """All points of bodies with a radius that can meet surfaces, in one row: corners and rims, and centres of balls.

    Attributes
    ----------
    radius : Array
        Of each point [m], shape (n_point,).
    body : Array
        That it belongs to, shape (n_point,).
    slot : Array
        Among the contact points of the model, −1 of balls, shape (n_point,).
    """

    def __init__(self, model: Model):
        self._nodes, contact = model.node_count, model.surfaces
        self._balls = [
            index for index, shape in enumerate(model.bodies.shapes) if shape is not None and shape.kind == "sphere"
        ]
        shown = np.arange(self._nodes, self._nodes + model.point_count)
        radii = [float(model.bodies.shapes[ball].half[0]) for ball in self._balls]
        self.radius = np.concatenate([contact.radius[shown], radii])
        self.body = np.concatenate([contact.contact_point_body[shown], self._balls]).astype(np.int64)
        self.slot = np.concatenate([shown, np.full(len(self._balls), -1)])

    def places(self, frame: Frame) -> Array:
        """Return where they are [m], shape (n_point, 3)."""
        return np.concatenate([frame.positions[self._nodes :], frame.body_positions[self._balls]])


@dataclass(frozen=True)
class MetSurface:
    """A surface, which of the `BodyPoints` can meet it, with their radii [m], and which nodes of rods.

    `half` are its half sizes, rounding included [m]; `body` the index of its owner, after the last that of the world.
    """

    name: str
    body: int
    kind: str
    half: Array
    rounding: float
    position: Array
    rotation: Array
    points: Array
    radii: Array
    nodes: Array

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


def surfaces_of(model: Model, points: BodyPoints) -> list[MetSurface]:
    """Return all surfaces that anything can meet."""
    if model.scene.contact is None or not model.has_surface_contact:
        return []
    found = []
    for owned in owned_shapes(model.scene, model.bodies):
        if owned.collider.name not in model.surface_names:
            continue
        meets = model.surfaces.can_collide[model.surface_names.index(owned.collider.name)][model.surfaces.group]
        meeting = np.flatnonzero(_points_meet(model, points, owned, meets))
        found.append(
            MetSurface(
                owned.collider.name,
                owned.body,
                owned.shape.kind,
                np.asarray(owned.shape.half, dtype=float),
                owned.shape.rounding,
                owned.position,
                owned.rotation @ owned.shape.rotation,
                meeting,
                points.radius[meeting],
                _nodes_meet(model, meets),
            )
        )
    return found


def _nodes_meet(model: Model, meets: Array) -> Array:
    """Return which nodes of rods can meet a surface, shape (n_node,): not those that grow out of its body."""
    of_rods, found = model.surfaces.rod_points.node, meets[: model.node_count].copy()
    np.logical_or.at(found, of_rods, meets[len(meets) - len(of_rods) :])
    return found


def _points_meet(model: Model, points: BodyPoints, owned: Owned, meets: Array) -> Array:
    """Return which points can meet a surface, shape (n_point,): not those of its own body; of what goes by schedules,
    none meets another.
    """
    free = np.append(model.free_bodies.free_index[: len(model.bodies.names)] >= 0, False)
    balls = points.slot < 0
    return np.where(balls, free[points.body] | free[owned.body], meets[points.slot]) & (points.body != owned.body)
