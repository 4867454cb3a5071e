"""Contact points of rods between stations and across the width where a scene starts; `contact.near` has their pattern.

Kernels make those that are near in each configuration. Checks of a start, which compile nothing, make them here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bilayer_core.contact.near import SAG
from bilayer_core.contact.shapes import PLANE, SPHERE
from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.model import Model
from bilayer_core.model.shape_numbers import Shape

Array = np.ndarray
MOST_ON_FLAT = 500
"""Points between stations that press on a flat face at a time, at most."""


@dataclass(frozen=True)
class PointsBetween:
    """Points in the cell of one node: the parts of its edges that are nearer to it than to any other.

    `place` [m], shape (n, 3), `radius` and `weight` [m], shape (n,).
    """

    node: int
    place: Array
    radius: Array
    weight: Array


def strip_area(section: Array) -> float:
    """Return the area of all rods together [m²]; `section` as in `Surfaces`."""
    return float((2.0 * (section[:, 0] + section[:, 1]) * section[:, 3]).sum())


def demand_of(shape: Shape, area: float, bend: float) -> tuple[float, float]:
    """Return the least radius of what is not flat of a shape, of a plane that of rods on it (`bend_of`, −1 if they are
    met at stations), and the least distance of points [m].

    Points as dense as sharp edges demand would be many on large faces: their distance is such that those of rods of an
    area [m²] on a face of a box, or on the end of a cylinder, are `MOST_ON_FLAT` at most.
    """
    if shape.kind == "plane":
        return bend, 0.0
    a, b, c = shape.core
    flat = 4.0 * max(a * b, b * c, c * a) if shape.kind == "box" else np.pi * a * b
    return shape.rounding, math.sqrt(min(flat, area) / MOST_ON_FLAT)


def spacing(demand: tuple[float, float], radius: float, distance: float) -> float:
    """Return the distance of points that a demand makes of a rod with half the thickness `radius` [m]; `distance` is
    that of the barrier.
    """
    return max(math.sqrt(4.0 * (demand[0] + radius) * SAG * distance), demand[1])


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
    reach = within + surfaces.bound[s] + section[:, 0] + 1.25 * np.linalg.norm(edge, axis=1)[edges].max(axis=1)
    reach += surfaces.rod_points.longest
    flat = surfaces.kind[s] == PLANE
    is_near = flat | (np.linalg.norm(x - centre, axis=1) < reach)
    for i in np.flatnonzero(meets[edges].any(axis=1) & surfaces.node_between[s] & is_near).tolist():
        (b, a), single = edges[i], False
        if is_end[i]:
            single = surfaces.node_part[i, 1] == 1.0 and bool(is_end[i + 1])
            if not single:
                continue
        apart = spacing((surfaces.sharpest[s], surfaces.least_spacing[s]), section[i, 0], surfaces.d_hat)
        parts = 2 * int(np.ceil(0.5 * (surfaces.edge_length[[b, a]].max() / apart - 1.0))) + 1
        before = 0 if single or not meets[b] else parts if is_end[i - 1] else parts // 2
        after = 0 if not meets[a] else parts if is_end[i + 1] else parts // 2
        j = np.arange(-before, after + 1)
        at_station = np.where(np.abs(j) == parts, i + np.sign(j), i)
        j = j[(np.abs(j) % parts > 0) | surfaces.node_can_collide[s, at_station]]
        if flat:
            j = j[(np.abs(j) == parts) | (j == 0) | (2 * np.abs(j) < (0 if single else parts))]
        part, aside = j / parts, np.abs(j)[:, None] / parts
        radius, border, height = (section[i, :3] + aside * (section[i + np.sign(j), :3] - section[i, :3])).T
        along = np.stack([0.5 * (part - part**2), 0.5 * (part + part**2)], axis=1)
        shares, weight = np.stack([0.5 - part, 0.5 + part], axis=1), surfaces.edge_length[np.where(j < 0, b, a)]
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
