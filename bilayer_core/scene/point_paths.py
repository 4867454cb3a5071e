"""Paths through points, from the scene or from a csv file: straight segments, or a smooth curve."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from pydantic import ValidationInfo, model_validator

from bilayer_core.scene.curves import Curve, across, curve_through
from bilayer_core.scene.faults import ROUNDING, Fault, refuse_all
from bilayer_core.scene.part import Direction, Point
from bilayer_core.scene.paths import Array, Frames, Path
from bilayer_core.scene.table_file import CsvFile

STEEP = math.radians(10.0)
"""Least angle between a normal and its tangent [rad]: a smaller one does not say where the top is."""
AGREE = math.radians(1.0)
"""Most that the rod's normal may be off the first one of the points [rad]."""
MOST_BACK = math.radians(90.0)
"""Most that the normals of a closed path may turn from its last point to the first [rad]."""
CLOSED_BY = 0.1
"""Part of the shortest other segment: a shorter one from the last point to the first is a gap."""
CLOSE = "Each face of a rod meets itself: whole turns close, half ones (a Moebius band) do not"
SHARPEST_CORNER = math.radians(170.0)
"""Largest turn of a corner [rad]: beyond it the path folds back on itself."""


class PointPath(Path):
    """A path through points."""

    points: list[Point] | None = None
    """In their order, the first at the start of the rod: on the interface of two layers, or in the middle of one."""
    normals: list[Direction] | None = None
    """Normal of the rod at each point; only their parts across the path count. Without them the rod's normal at the
    start is carried along the path without twist.
    """
    file: str | None = None
    """Instead of points: csv file, relative to the scene file, with columns `x`, `y`, `z` [m] and perhaps `nx`, `ny`,
    `nz`, the normals.
    """
    closed: bool = False
    """Whether the path leads from the last point back to the first, which may stand once more at the end: the rod has
    no ends. Without normals its frame closes with the least twist.
    """

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        """Return the points and normals of the file, if one is given: a validated scene needs no further file."""
        if not isinstance(data, dict) or not isinstance(data.get("file"), str):
            return data
        given = [key for key in ("points", "normals") if data.get(key) is not None]
        if given:
            demand = f"must be left out where {' and '.join(f'`{key}`' for key in given)} are given"
            refuse_all(cls.__name__, [(("file",), data["file"], demand)])
        table = CsvFile(cls.__name__, data["file"], (info.context or {}).get("directory", ""))
        return {**data, **points_of_file(table), "file": None}

    def _faults(self) -> list[Fault]:
        return faults_of_points(self)

    @property
    def start(self) -> Point:
        """The first point [m]."""
        return self.points[0]

    @property
    def curve(self) -> Curve:
        """The curve itself."""
        own = slice(self.own_points)
        normals = None if self.normals is None else tuple(self.normals[own])
        return curve_through(self.shape, tuple(self.points[own]), normals, self.closed)

    @property
    def own_points(self) -> int:
        """Number of points, without the first one where a closed path has it at its end once more."""
        return len(self.points) - int(self.closed and _are_one(self.points[0], self.points[-1]))

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(self.curve.knots[-1])

    @property
    def turn(self) -> float:
        """Angle by which the tangent turns in all [rad]."""
        return self.curve.turn

    @property
    def sharpest(self) -> Array:
        """Lengths along it [m] of which one has the largest curvature."""
        return self.curve.sharpest

    def frames_at(self, normal: Array, arc: Array) -> Frames:
        """Return the frames at lengths `arc` [m] from the start."""
        return self.curve.frames(normal, arc)

    def curvatures_at(self, normal: Array, arc: Array, over: float) -> Array:
        """Return χ, ξ, τ [1/m] at lengths `arc` [m], shape (n, 3)."""
        return self.curve.curvatures(normal, arc, over)

    def demand_of_normal(self, normal: Array) -> str:
        """Return the demand that the rod's normal at the start does not meet; empty if it meets all."""
        tangent = self.curve.carried(normal, np.zeros(1))[1][0]
        steepness = _angle_between(normal, tangent)
        if min(steepness, math.pi - steepness) < STEEP:
            return f"must be across the path, is {math.degrees(steepness):.3g} deg from its tangent {_rounded(tangent)}"
        if self.normals is None:
            return ""
        first = across(np.array(self.normals[:1]), tangent[None])[0]
        if _angle_between(across(normal[None], tangent[None])[0], first) > AGREE:
            return f"must be the first of `path.normals`, across the path {_rounded(first)}, within 1 deg"
        return ""

    def key_of_radius(self, arc: float) -> str:
        """Return the key that sets the radius of curvature."""
        return "points"

    def describe(self) -> str:
        """Describe the shape in words."""
        normals = "" if self.normals is None else " with normals"
        closed = "closed " if self.closed else ""
        return f"{closed}{self.shape} through {self.own_points} points{normals}"


class PolylinePath(PointPath):
    """Straight segments through points.

    Its corners are free of stress as well. Their curvature is concentrated: a corner at a station is the angle of one
    joint; between two stations the edge there cuts it, and two joints share its turn. The joint of a corner by θ is
    stiffer than that of a straight rod, by 1/cos⁴(θ/2): four times at a right angle, an error of first order in the
    length of edges. For a bend that does not depend on the number of stations use `spline`, or points on the bend.
    """

    shape: Literal["polyline"]


class SplinePath(PointPath):
    """A smooth curve through points, three at least: a cubic spline over the distances between them.

    The stations of the rod are at equal lengths along it.
    """

    shape: Literal["spline"]


def points_of_file(table: CsvFile) -> dict[str, list[list[float]]]:
    """Return the points and, if it has one of their columns, normals of a csv file."""
    columns = {"points": ("x", "y", "z")}
    if {"nx", "ny", "nz"} & set(table.columns):
        columns["normals"] = ("nx", "ny", "nz")
    return {key: [list(row) for row in zip(*map(table.numbers, names), strict=True)] for key, names in columns.items()}


def faults_of_points(path: PointPath) -> list[Fault]:
    """Return the points that make no curve, and normals that make no frame."""
    least = 3 if path.shape == "spline" or path.closed else 2
    if path.points is None:
        return [(("points",), None, "must be given, or `file`")]
    count = len(path.points)
    if count < least or path.own_points < least:
        kind = f"closed {path.shape}" if path.closed else path.shape
        return [(("points",), f"{path.own_points} points", f"must be at least {least} points for a {kind}")]
    faults: list[Fault] = [
        (("points", index), after, "must be another point than the one before it")
        for index, (before, after) in enumerate(pairwise(path.points), start=1)
        if _are_one(before, after)
    ]
    faults += _faults_of_gap(path) if path.closed and not faults else ()
    faults += () if faults else _faults_of_spacing(path)
    if path.normals is not None and len(path.normals) != count:
        faults.append((("normals",), f"{len(path.normals)} entries", f"must be as many as points, {count}"))
    if faults:
        return faults
    if isinstance(path, PolylinePath):
        faults += [
            (("points", index), path.points[index], "must not be a corner where the path folds back on itself")
            for index, corner in ((k % path.own_points, c) for k, c in enumerate(path.curve.corners, start=1))
            if corner > SHARPEST_CORNER
        ]
    if faults or path.normals is None:
        return faults
    _, tangents, _ = path.curve.carried(np.array(path.normals[0]), path.curve.knots)
    for index, (normal, tangent) in enumerate(zip(path.normals[: path.own_points], tangents, strict=False)):
        steepness = _angle_between(np.array(normal), tangent)
        if min(steepness, math.pi - steepness) < STEEP:
            demand = f"must be across the path, is {math.degrees(steepness):.3g} deg from its tangent"
            faults.append((("normals", index), normal, f"{demand} {_rounded(tangent)}"))
    last = path.own_points - 1
    if last + 1 < count and _angle_between(np.array(path.normals[-1]), np.array(path.normals[0])) > AGREE:
        faults.append((("normals", last + 1), path.normals[-1], f"must be the first normal, as the point is. {CLOSE}"))
    back = abs(float(np.diff(path.curve.angles)[-1])) if path.closed and not faults else 0.0
    if back > MOST_BACK:
        demand = (
            f"must turn by at most {math.degrees(MOST_BACK):g} deg from the last point back to the first, turns by "
            f"{math.degrees(back):.0f} deg. {CLOSE}"
        )
        faults.append((("normals", last), path.normals[last], demand))
    return faults


def _are_one(first: Point, second: Point) -> bool:
    return math.dist(first, second) <= ROUNDING * max(math.hypot(*first), math.hypot(*second))


def _faults_of_gap(path: PointPath) -> list[Fault]:
    """Return a fault if the last point of a closed path is meant to be the first, but is not quite."""
    own = path.points[: path.own_points]
    gap, others = math.dist(own[-1], own[0]), [math.dist(before, after) for before, after in pairwise(own)]
    if gap >= CLOSED_BY * min(others):
        return []
    demand = f"must be the first point or well apart from it: the path does not close by {gap:.3g} m"
    return [(("points", path.own_points - 1), own[-1], demand)]


def _faults_of_spacing(path: PointPath) -> list[Fault]:
    """Return a fault if a point is so near to the one before it that no curve is smooth through all of them."""
    spaces = [math.dist(before, after) for before, after in pairwise(path.points[: path.own_points])]
    largest, least = max(spaces), min(spaces)
    if least >= ROUNDING * largest:
        return []
    index = 1 + spaces.index(least)
    demand = f"must be {ROUNDING * largest:g} m or more from the point before it: others are {largest:g} m apart"
    return [(("points", index), path.points[index], demand)]


def _rounded(vector: Array) -> str:
    return f"[{', '.join(f'{component:.4g}' for component in vector)}]"


def _angle_between(first: Array, second: Array) -> float:
    """Return the angle of two unit vectors [rad]."""
    return 2.0 * math.atan2(float(np.linalg.norm(first - second)), float(np.linalg.norm(first + second)))
