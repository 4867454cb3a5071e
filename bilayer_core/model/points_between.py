"""Contact points of rods between stations and across the width where a scene starts.

Kernels make those that are near in each configuration, in the pattern of `contact.between_stations`. Checks of a start,
which compile nothing, make them here. Near edges of boxes and cylinders they take all points that kernels could make.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bilayer_core.contact.between_stations import SAG
from bilayer_core.contact.shapes import BOX, CYLINDER, PLANE, SPHERE
from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.model import Model
from bilayer_core.model.records.contacts import Surfaces
from bilayer_core.model.shape_numbers import NUMBER, Shape, signed_distance

Array = np.ndarray
_KIND = {number: kind for kind, number in NUMBER.items()}


@dataclass(frozen=True)
class PointsBetween:
    """Points in the cell of one node: the parts of its edges that are nearer to it than to any other.

    `place` [m], shape (n, 3), `radius` and `weight` [m], shape (n,).
    """

    node: int
    place: Array
    radius: Array
    weight: Array


def demand_of(shape: Shape, bend: float) -> float:
    """Return the least radius of what is not flat of a shape [m]; of a plane that of rods on it (`bend_of`, −1 if they
    are met at stations).
    """
    return bend if shape.kind == "plane" else shape.rounding


def spacing(sharpest: Array | float, radius: Array | float, distance: float) -> Array:
    """Return the distance of points where a surface has the radius `sharpest`, of a rod with half the thickness
    `radius` [m]; `distance` is that of the barrier.
    """
    return np.sqrt(np.maximum(4.0 * (sharpest + radius) * SAG * distance, 0.0))


def _faces_one(surfaces: Surfaces, s: int, x: Array, reach: Array) -> Array:
    """Return whether all within `reach` [m] of points of the surface's frame, shape (n, 3), is before one flat face of
    it, shape (n,).
    """
    kind, size = int(surfaces.kind[s]), surfaces.size[s]
    if kind == BOX:
        return (np.abs(x) - size > -reach[:, None]).sum(axis=1) == 1
    flat = np.hypot(x[:, 0], x[:, 1]) <= size[0] - reach if kind == CYLINDER else np.zeros(len(x), dtype=bool)
    return flat | (kind == PLANE)


def core_of(model: Model, s: int) -> Shape:
    """Return the core of surface s, without its rounding, in the axes of the world at the start."""
    surfaces = model.surfaces
    owner = np.concatenate([model.bodies.start_rotation, np.eye(3)[None]])[surfaces.body[s]]
    return Shape(_KIND[int(surfaces.kind[s])], surfaces.size[s], 0.0, owner @ surfaces.rotation[s])


def points_between(model: Model, s: int, centre: Array, within: float) -> Iterator[PointsBetween]:
    """Yield the points, at the start, of the nodes that surface s can meet where it has its middle at `centre`, shape
    (3,), and that may be nearer to it than `within` [m].
    """
    surfaces, x = model.surfaces, model.start_position
    if surfaces.sharpest[s] < 0.0:
        return
    first = model.rods.edge_node
    edge, m1 = x[first + 1] - x[first], model.start_director1
    m2 = cross(edge / np.linalg.norm(edge, axis=1)[:, None], m1)
    edges, section, meets = surfaces.node_edges, surfaces.section, surfaces.edge_can_collide[s]
    is_end = (edges[:, 0] == edges[:, 1]) & (section[:, 3] > 0.0)
    longest = np.linalg.norm(edge, axis=1)[edges].max(axis=1)
    reach = 1.25 * longest + surfaces.rod_points.longest
    core = core_of(model, s)
    one_face = _faces_one(surfaces, s, (x - centre) @ core.rotation, reach)
    one_face &= (surfaces.kind[s] == PLANE) | (longest <= surfaces.coarsest)
    is_plane = surfaces.kind[s] == PLANE
    is_near = signed_distance(core, x - centre) - surfaces.rounding[s] < within + section[:, 0] + reach
    for i in np.flatnonzero(meets[edges].any(axis=1) & surfaces.node_between[s] & is_near).tolist():
        (b, a), single = edges[i], False
        if is_end[i]:
            single = surfaces.node_part[i, 1] == 1.0 and bool(is_end[i + 1])
            if not single:
                continue
        flat, apart = one_face[i], spacing(surfaces.sharpest[s], section[i, 0], surfaces.d_hat)
        if flat and not is_plane:
            apart = np.inf
        parts = 2 * max(int(np.ceil(0.5 * (surfaces.edge_length[[b, a]].max() / apart - 1.0))), 0) + 1
        before = 0 if single or not meets[b] else parts if is_end[i - 1] else parts // 2
        after = 0 if not meets[a] else parts if is_end[i + 1] else parts // 2
        j = np.arange(-before, after + 1)
        at_station = np.where(np.abs(j) == parts, i + np.sign(j), i)
        j = j[(np.abs(j) % parts > 0) | surfaces.node_can_collide[s, at_station]]
        if flat:
            j = j[(np.abs(j) == parts) | (j == 0) | (2 * np.abs(j) < (0 if single else parts))]
        part, aside = j / parts, np.abs(j)[:, None] / parts
        radius, border, height = (section[i, :3] + aside * (section[i + np.sign(j), :3] - section[i, :3])).T
        along, after = np.stack([0.5 * (part - part**2), 0.5 * (part + part**2)], axis=1), np.clip(0.5 + part, 0.0, 1.0)
        shares, weight = np.stack([1.0 - after, after], axis=1), surfaces.edge_length[np.where(j < 0, b, a)]
        weight = np.where(j == 0, surfaces.edge_length[[b, a]].mean(), weight)
        of_end = (np.abs(j) == parts) | (single & (j == 0))
        weight = weight * np.where(of_end, 0.5, 1.0) / np.where(of_end & flat, 1, parts)
        if single:
            along, shares = np.stack([0.0 * part, part], axis=1), np.array([0.0, 1.0]) + 0.0 * along
        if surfaces.kind[s] == SPHERE:
            weight *= np.maximum(1.0, border / np.sqrt(2.0 * (surfaces.sharpest[s] + radius) * surfaces.d_hat))
        half = int(np.ceil(border.max() / (max(apart, border.max()) if flat else apart)))
        across = np.arange(-half, half + 1) / max(half, 1)
        share = np.where(np.abs(across) == 1.0, 0.25, 0.5) / half if half else np.ones(1)
        middle = x[i] + along @ edge[[b, a]] + height[:, None] * (shares @ m1[[b, a]])
        aside_of = (border[:, None] * (shares @ m2[[b, a]]))[:, None, :] * across[:, None]
        yield PointsBetween(
            i,
            (middle[:, None, :] + aside_of).reshape(-1, 3),
            np.repeat(radius, len(across)),
            (weight[:, None] * share).ravel(),
        )
