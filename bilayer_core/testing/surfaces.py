"""Surfaces of a scene and what meets them, for a check of gaps that has no part of the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bilayer_core.model.contact_points import Owned, owned_shapes
from bilayer_core.model.model import Model
from bilayer_core.observed.frame import Frame

Array = np.ndarray


class MeetingPoints:
    """All points with a radius that can meet surfaces, in one row.

    Of each node the middle of its section and, in space, its two borders, by the directors of the edges beside it; the
    corners and rims of bodies; and the centres of balls.

    Attributes
    ----------
    node_radius : Array
        Half the thickness [m], shape (n_node,).
    radius : Array
        Of each point [m], shape (n_point,).
    node : Array
        Whose section it belongs to, −1 of bodies' points, shape (n_point,).
    body : Array
        That it belongs to, −1 of rods, shape (n_point,).
    slot : Array
        Among the contact points of the model, −1 of balls, shape (n_point,).
    """

    def __init__(self, model: Model):
        self._model = model
        nodes = model.node_count
        self.node_radius, half_width, self._offset = np.zeros((3, nodes))
        for strand in model.strands:
            own = slice(strand.first_node, strand.first_node + strand.node_count)
            self.node_radius[own], half_width[own] = 0.5 * strand.thickness, 0.5 * strand.width
            self._offset[own] = strand.offset
        beyond = np.zeros(nodes) if model.plane.exists else np.maximum(half_width - self.node_radius, 0.0)
        self._sides = [np.zeros(nodes), -beyond, beyond] if beyond.any() else [np.zeros(nodes)]
        self._balls = [
            index for index, shape in enumerate(model.bodies.shapes) if shape is not None and shape.kind == "sphere"
        ]
        contact = model.surfaces
        shown = np.arange(nodes, nodes + model.point_count)
        copies = len(self._sides)
        radii = [float(model.bodies.shapes[ball].half[0]) for ball in self._balls]
        self.radius = np.concatenate([np.tile(self.node_radius, copies), contact.radius[shown], radii])
        rest = np.full(len(shown) + len(self._balls), -1)
        self.node = np.concatenate([np.tile(np.arange(nodes), copies), rest])
        self.body = np.concatenate(
            [np.full(copies * nodes, -1), contact.contact_point_body[shown], self._balls]
        ).astype(np.int64)
        self.slot = np.concatenate([np.tile(np.arange(nodes), copies), shown, np.full(len(self._balls), -1)])

    def middles(self, position: Array, directors: Array) -> Array:
        """Middles of the sections of nodes [m], shape (n_node, 3)."""
        return position + self._offset[:, None] * directors[self._model.surfaces.node_edges].mean(axis=1)

    def places(self, frame: Frame) -> Array:
        """Where they are [m], shape (n_point, 3)."""
        model, nodes = self._model, self._model.node_count
        position, edges = frame.positions[:nodes], model.surfaces.node_edges
        along = position[model.rods.edge_node + 1] - position[model.rods.edge_node]
        tangent = along / np.linalg.norm(along, axis=1)[:, None]
        m2 = np.cross(tangent, frame.directors)[edges].mean(axis=1)
        middle = self.middles(position, frame.directors)
        sections = [middle + side[:, None] * m2 for side in self._sides]
        return np.concatenate([*sections, frame.positions[nodes:], frame.body_positions[self._balls]])


@dataclass(frozen=True)
class MetSurface:
    """A surface, and which of the `MeetingPoints` can meet it, with their radii [m].

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

    @property
    def smallest(self) -> float:
        """Half of what has to be passed through to be behind it [m]; infinite for a half space."""
        return math.inf if self.kind == "plane" else float(self.half.min())

    def distance(self, x: Array) -> Array:
        """Signed distance of points of its frame [m], shape (n, 3) to (n,)."""
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


def surfaces_of(model: Model, points: MeetingPoints) -> list[MetSurface]:
    """All surfaces that anything can meet."""
    if model.scene.contact is None or not model.has_surface_contact:
        return []
    found = []
    for owned in owned_shapes(model.scene, model.bodies):
        if owned.collider.name not in model.surface_names:
            continue
        meeting = np.flatnonzero(_can_meet(model, points, owned))
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
            )
        )
    return found


def _can_meet(model: Model, points: MeetingPoints, owned: Owned) -> Array:
    """Which points can meet a surface, shape (n_point,): not those of its own body, nor of a rod that grows out of it;
    of what goes by schedules, none meets another.
    """
    surfaces, of_rods = model.surfaces, model.surfaces.rod_points.node
    meets = surfaces.can_collide[model.surface_names.index(owned.collider.name)][surfaces.group]
    section = meets[: model.node_count].copy()
    np.logical_or.at(section, of_rods, meets[len(meets) - len(of_rods) :])
    can = np.zeros(len(points.radius), dtype=bool)
    sections, listed = points.node >= 0, points.slot >= model.node_count
    can[sections] = section[points.node[sections]]
    can[listed] = meets[points.slot[listed]]
    free = np.append(model.free_bodies.free_index[: len(model.bodies.names)] >= 0, False)
    balls = points.slot < 0
    can[balls] = free[points.body[balls]] | free[owned.body]
    return can & (points.body != owned.body)
