"""Curves through points, and frames along them: straight segments, or a cubic spline.

Normals. The normal at the start is carried along without any twist (parallel transport). Where points have normals of
their own, made perpendicular to the curve, the angle between the two is interpolated between the points: linearly on
segments, by a cubic spline on a smooth curve. Its rate is the twist.

Closed curves. The normal that was carried once round comes back turned by the *closing* angle, between −180° and 180°
and zero in a plane. Without normals of its own a closed curve spreads that angle evenly, so that frames close with the
least twist; with them they close because the last normal is the first. Their twist, less the closing angle, is a whole
number of turns.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from bilayer_core.scene.faults import ROUNDING

Array = np.ndarray
CELLS = 32
"""Of a smooth curve between two points: double reflections carry normals over each with an error of fourth order."""
GAUSS = tuple(0.5 * values for values in np.polynomial.legendre.leggauss(5))
"""Halves of places and weights of the rule by which lengths are integrated over a cell; the places from −½ to ½."""
NEWTON = 4
"""Steps of Newton's method from linear interpolation within a cell: far more than its digits need."""
CURVES_KEPT = 64
"""Of those last asked for."""

Vectors = tuple[tuple[float, float, float], ...]


@lru_cache(CURVES_KEPT)
def curve_through(shape: str, points: Vectors, normals: Vectors | None, closed: bool = False) -> Curve:
    """Return the `polyline` or `spline` through points [m], with normals at them or without.

    A closed curve leads from the last point back to the first.
    """
    kind = {"polyline": Polyline, "spline": Spline}[shape]
    once_more = slice(None, 1 if closed else 0)
    points, normals = (None if part is None else (*part, *part[once_more]) for part in (points, normals))
    return kind(np.array(points), None if normals is None else np.array(normals), closed)


class Curve(ABC):
    """A curve through points.

    Attributes
    ----------
    points : ndarray
        [m], shape (n_point, 3); of a closed curve the last is the first.
    normals : ndarray or None
        At the points, shape (n_point, 3).
    knots : ndarray
        Lengths along the curve at the points [m], shape (n_point,).
    sharpest : ndarray
        Lengths along it [m] of which one has the largest curvature.
    turn : float
        Angle by which the tangent turns in all [rad].
    """

    knots: Array
    sharpest: Array
    turn: float

    def __init__(self, points: Array, normals: Array | None, closed: bool):
        self.points, self.normals, self.closed = points, normals, closed

    @abstractmethod
    def carried(self, normal: Array, arc: Array) -> tuple[Array, Array, Array]:
        """Return the points [m], tangents and normals at lengths `arc` [m] from the start, shapes (n, 3); the normals
        do not twist.
        """

    @abstractmethod
    def bend(self, arc: Array, over: float) -> Array:
        """Return t′ there [1/m], shape (n, 3); of corners the mean `over` a length [m]."""

    @abstractmethod
    def angle(self, arc: Array, derivative: int = 0) -> Array:
        """Return the angle from carried normals [rad] there, where points have normals; or its derivative."""

    @cached_property
    def angles(self) -> Array:
        """From carried normals to those of the points [rad], shape (n_point,)."""
        _, tangents, carried = self.carried(self.normals[0], self.knots)
        sines = (self.normals * np.cross(tangents, carried)).sum(axis=1)
        return np.unwrap(np.arctan2(sines, (self.normals * carried).sum(axis=1)))

    @cached_property
    def closing(self) -> float:
        """Angle from the normal carried once round to that at the start [rad]; 0 of an open curve."""
        if not self.closed:
            return 0.0
        tangent = self.carried(np.eye(3)[0], np.zeros(1))[1]
        start = across(np.eye(3)[[np.abs(tangent[0]).argmin()]], tangent)[0]
        _, tangents, (first, last) = self.carried(start, self.knots[[0, -1]])
        return float(np.arctan2(first @ np.cross(tangents[0], last), first @ last))

    def frames(self, normal: Array, arc: Array) -> tuple[Array, Array, Array]:
        """Return the points [m], tangents and normals at lengths `arc` [m] from the start, shapes (n, 3)."""
        if self.normals is None and not self.closed:
            return self.carried(normal, arc)
        if self.normals is None:
            points, tangents, carried = self.carried(normal, arc)
            angle = (self.closing * arc / self.knots[-1])[:, None]
        else:
            points, tangents, carried = self.carried(self.normals[0], arc)
            angle = self.angle(arc)[:, None]
        return points, tangents, np.cos(angle) * carried + np.sin(angle) * np.cross(tangents, carried)

    def curvatures(self, normal: Array, arc: Array, over: float) -> Array:
        """Return the curvature towards the normal and across, and twist [1/m] there, shape (n, 3)."""
        _, tangents, normals = self.frames(normal, arc)
        bend, across = self.bend(arc, over), np.cross(tangents, normals)
        even = np.full(len(arc), self.closing / self.knots[-1])
        twist = even if self.normals is None else self.angle(arc, 1)
        return np.stack([(bend * normals).sum(axis=1), (bend * across).sum(axis=1), twist], axis=1)


class Polyline(Curve):
    """Straight segments."""

    def __init__(self, points: Array, normals: Array | None, closed: bool):
        super().__init__(points, normals, closed)
        segments = np.diff(points, axis=0)
        length = np.linalg.norm(segments, axis=1)
        self.knots = np.concatenate([[0.0], np.cumsum(length)])
        self._tangents = segments / length[:, None]
        before, after = self._beside_corners
        self.corners = 2.0 * np.arctan2(
            np.linalg.norm(after - before, axis=1), np.linalg.norm(after + before, axis=1)
        )  # angle by which the curve turns at each inner point, and at the last of a closed one [rad]
        self.turn, self.sharpest = float(self.corners.sum()), self.knots[1 : 1 + len(self.corners)]

    @property
    def _beside_corners(self) -> tuple[Array, Array]:
        """Tangents of the segments before and after each corner, shape (n_corner, 3)."""
        if self.closed:
            return self._tangents, np.roll(self._tangents, -1, axis=0)
        return self._tangents[:-1], self._tangents[1:]

    @cached_property
    def _transport(self) -> Array:
        """From the normal at the start to that of each segment, shape (n_point − 1, 3, 3)."""
        return _products(_rotations(self._tangents[:-1], self._tangents[1:]))

    def _segment(self, arc: Array) -> Array:
        """Return the segment of each length `arc` [m]; at a point it is the segment after it."""
        return np.clip(np.searchsorted(self.knots, arc, side="right") - 1, 0, len(self._tangents) - 1)

    def carried(self, normal: Array, arc: Array) -> tuple[Array, Array, Array]:
        """Return the frames whose normals do not twist; at a corner the mean of both sides."""
        own = self._transport @ across(normal[None], self._tangents[:1])[0]
        near = ROUNDING * self.knots[-1]
        before, after = self._segment(arc - near), self._segment(arc + near)
        points = self.points[after] + (arc - self.knots[after])[:, None] * self._tangents[after]
        tangents, normals = (unit(part[before] + part[after]) for part in (self._tangents, own))
        if self.closed:  # at the join from either side: one is not the other carried on, see `closing`
            middle = unit(self._tangents[-1:] + self._tangents[:1])
            for side, there in ((0, arc <= near), (-1, arc >= self.knots[-1] - near)):
                tangents[there] = middle
                normals[there] = _rotations(self._tangents[[side]], middle)[0] @ own[side]
        return points, tangents, normals

    def angle(self, arc: Array, derivative: int = 0) -> Array:
        """Return the angle from carried normals [rad], or its derivative."""
        if derivative == 0:
            return np.interp(arc, self.knots, self.angles)
        return (np.diff(self.angles) / np.diff(self.knots))[self._segment(arc)]

    def bend(self, arc: Array, over: float) -> Array:
        """Return t′ [1/m]: of each corner less than half of `over` away 2 tan(θ/2) over that length, as a joint
        has it.
        """
        before, after = self._beside_corners
        kinks = (after - before) / np.cos(0.5 * self.corners)[:, None]
        distance = arc[:, None] - self.sharpest
        if self.closed:
            distance -= self.knots[-1] * np.round(distance / self.knots[-1])
        inside = (-0.5 * over <= distance) & (distance < 0.5 * over)
        return inside @ kinks / over


class Spline(Curve):
    """A cubic spline over the distances between the points."""

    def __init__(self, points: Array, normals: Array | None, closed: bool):
        from scipy.interpolate import CubicSpline

        super().__init__(points, normals, closed)
        distance = np.linalg.norm(np.diff(points, axis=0), axis=1)
        ends = "periodic" if closed else "not-a-knot"
        self._curve = CubicSpline(np.concatenate([[0.0], np.cumsum(distance)]), points, bc_type=ends)
        x = self._curve.x
        inside = x[:-1, None] + np.diff(x)[:, None] * np.arange(CELLS) / CELLS
        self._grid = np.append(inside, x[-1])  # ends of all cells, of the curve's parameter, shape (n_cell + 1,)
        self.sharpest = np.concatenate([[0.0], np.cumsum(self._length_between(self._grid[:-1], self._grid[1:]))])
        self.knots = self.sharpest[::CELLS]
        self._tangents = unit(self._curve(self._grid, 1))
        if closed:
            self._tangents[-1] = self._tangents[0]
        halves = np.minimum(0.5 * np.linalg.norm(np.diff(self._tangents, axis=0), axis=1), 1.0)
        self.turn = float(2.0 * np.arcsin(halves).sum())

    def _length_between(self, begin: Array, end: Array) -> Array:
        """Return the length of the curve between parameters no farther apart than a cell [m]."""
        places, weights = GAUSS
        middle, width = 0.5 * (begin + end), end - begin
        speed = np.linalg.norm(self._curve(middle[:, None] + width[:, None] * places, 1), axis=2)
        return width * (speed @ weights)

    def _located(self, arc: Array) -> tuple[Array, Array]:
        """Return the curve's parameter at lengths `arc` [m] by Newton's method on the length, and the cell before."""
        cell = np.clip(np.searchsorted(self.sharpest, arc, side="right") - 1, 0, len(self._grid) - 2)
        at = np.interp(arc, self.sharpest, self._grid)
        for _ in range(NEWTON):
            beyond = self.sharpest[cell] + self._length_between(self._grid[cell], at) - arc
            at = at - beyond / np.linalg.norm(self._curve(at, 1), axis=1)
        return at, cell

    @cached_property
    def _transport(self) -> Array:
        """From the normal at the start to that at the end of each cell, shape (n_cell + 1, 3, 3)."""
        points, tangents = self._curve(self._grid), self._tangents
        return _products(_double_reflections(points[:-1], tangents[:-1], points[1:], tangents[1:]))

    def carried(self, normal: Array, arc: Array) -> tuple[Array, Array, Array]:
        """Return the frames whose normals do not twist."""
        at, cell = self._located(arc)
        points, tangents = self._curve(at), unit(self._curve(at, 1))
        own = self._transport @ across(normal[None], self._tangents[:1])[0]
        last = _double_reflections(self._curve(self._grid[cell]), self._tangents[cell], points, tangents)
        return points, tangents, across((last @ own[cell][:, :, None])[:, :, 0], tangents)

    @cached_property
    def _turning(self) -> Any:
        """Angle from carried normals [rad] over the length along the curve [m]."""
        from scipy.interpolate import CubicSpline

        if not self.closed:
            return CubicSpline(self.knots, self.angles)
        about_ramp = self.angles - self._ramp * self.knots
        about_ramp[-1] = about_ramp[0]
        return CubicSpline(self.knots, about_ramp, bc_type="periodic")

    @property
    def _ramp(self) -> float:
        """Mean rate of that angle along a closed curve [rad/m]; 0 of an open one."""
        return float(self.angles[-1] - self.angles[0]) / self.knots[-1] if self.closed else 0.0

    def angle(self, arc: Array, derivative: int = 0) -> Array:
        """Return the angle from carried normals [rad], or its derivative."""
        return self._turning(arc, derivative) + self._ramp * (arc if derivative == 0 else 1.0)

    def bend(self, arc: Array, over: float) -> Array:
        """Return t′ [1/m], but for a part along t."""
        at, _ = self._located(arc)
        speed = np.linalg.norm(self._curve(at, 1), axis=1, keepdims=True)
        return self._curve(at, 2) / speed**2


def unit(vectors: Array) -> Array:
    """Return the vectors at length 1, shape (n, 3)."""
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def across(normals: Array, tangents: Array) -> Array:
    """Return normals made perpendicular to tangents, unit, shape (n, 3); where both are parallel, any perpendicular."""
    parts = normals - (normals * tangents).sum(axis=1, keepdims=True) * tangents
    length = np.linalg.norm(parts, axis=1, keepdims=True)
    other = np.cross(tangents, np.eye(3)[np.abs(tangents).argmin(axis=1)])
    return unit(np.where(length > ROUNDING, parts, other))


def _reflections(vectors: Array) -> Array:
    """Return the matrices that reflect along vectors, shape (n, 3, 3)."""
    squares = (vectors * vectors).sum(axis=1)
    scale = 2.0 / np.where(squares > 0.0, squares, 1.0)
    return np.eye(3) - scale[:, None, None] * vectors[:, :, None] * vectors[:, None, :]


def _rotations(tangents: Array, next_tangents: Array) -> Array:
    """Return the matrices of the least rotations that take unit vectors to others, shape (n, 3, 3)."""
    return _reflections(tangents + next_tangents) @ _reflections(tangents)


def _double_reflections(points: Array, tangents: Array, next_points: Array, next_tangents: Array) -> Array:
    """Return the matrices that carry normals on without twist from places of a curve to others, shape (n, 3, 3) (Wang,
    Jüttler, Zheng and Liu 2008, Computation of rotation minimizing frames).
    """
    way = next_points - points
    far = np.linalg.norm(way, axis=1, keepdims=True) > ROUNDING * np.abs(next_points).max(axis=1, keepdims=True)
    first = _reflections(np.where(far, way, tangents))  # between equal points rounding has no direction
    reflected = (first @ tangents[:, :, None])[:, :, 0]
    return _reflections(next_tangents - reflected) @ first


def _products(matrices: Array) -> Array:
    """Return the identity and the products of the first 1 to n matrices, the last at the left, shape (n + 1, 3, 3)."""
    found = np.empty((len(matrices) + 1, 3, 3))
    found[0] = np.eye(3)
    for index, matrix in enumerate(matrices):
        found[index + 1] = matrix @ found[index]
    return found
