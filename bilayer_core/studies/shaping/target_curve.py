"""Curves that a rod is to follow: drawn with any sampling, and parametrised by their arc length."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from bilayer_core.errors import InputError
from bilayer_core.scene.limits import LARGEST_TABLE, read_text

Array = np.ndarray
FEWEST = 4
"""Points of a curve."""
SHARPEST = math.radians(45.0)
"""Turn from a piece of a curve to the next that is no kink."""
SAMPLES = 16
"""Of each piece, for its arc length."""
FARTHEST = 1e6
"""Coordinate of a curve [m]."""
CORRECTIONS = 8
"""Of the nearest point by Newton's method."""


class TargetCurve:
    """A smooth curve through points.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        [m], in order.
    source : str
        What messages call it.
    sharpest : float
        Largest turn from a piece to the next that is no kink [rad].

    Attributes
    ----------
    points : ndarray
    source : str
    length : float
        [m]

    Raises
    ------
    InputError
        If there are too few points, two next to each other are one, or they have a kink.
    """

    def __init__(self, points: Array, source: str = "target", sharpest: float = SHARPEST):
        points = np.array(points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < FEWEST:
            raise InputError(f"{source}: must be {FEWEST} points or more of x, y and z, has shape {points.shape}")
        allowed = (np.abs(points) <= FARTHEST).all(axis=1)
        if not allowed.all():
            k = int(np.argmin(allowed))
            raise InputError(
                f"{source}: point {k + 1} is {', '.join(f'{x:g}' for x in points[k])}; must be finite, "
                f"at most {FARTHEST:g} m"
            )
        pieces = np.diff(points, axis=0)
        lengths = np.linalg.norm(pieces, axis=1)
        if not lengths.all():
            raise InputError(f"{source}: point {int(np.argmin(lengths)) + 2} is that before it; leave one out")
        tangents = pieces / lengths[:, None]
        turns = np.arccos(np.clip(np.einsum("ij,ij->i", tangents[1:], tangents[:-1]), -1.0, 1.0))
        if turns.max() > sharpest:
            k = int(np.argmax(turns))
            raise InputError(
                f"{source}: has a kink at point {k + 2} ({', '.join(f'{x:.4g}' for x in points[k + 1])} m), where it "
                f"turns by {math.degrees(turns[k]):.3g}°; allowed are {math.degrees(sharpest):g}° from piece to piece: "
                "round it off, or give more points where it bends"
            )
        self.points, self.source = points, source
        along = np.concatenate([[0.0], np.cumsum(lengths)])
        fine = np.interp(np.arange((len(along) - 1) * SAMPLES + 1) / SAMPLES, np.arange(len(along)), along)
        steps = np.linalg.norm(np.diff(CubicSpline(along, points)(fine), axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])[::SAMPLES]
        self._curve = CubicSpline(along, points)
        self.length = float(along[-1])

    def at(self, along: Array) -> Array:
        """Return points of the curve, beyond its end on its last tangent.

        Parameters
        ----------
        along : ndarray, shape (n,)
            Lengths along the curve [m].

        Returns
        -------
        ndarray
            [m], shape (n, 3).
        """
        inside = np.minimum(along, self.length)
        return self._curve(inside) + (along - inside)[:, None] * self._curve(inside, 1)

    def tangents(self, along: Array) -> Array:
        """Return unit tangents.

        Parameters
        ----------
        along : ndarray, shape (n,)
            Lengths along the curve [m].

        Returns
        -------
        ndarray
            Shape (n, 3).
        """
        slope = self._curve(np.minimum(along, self.length), 1)
        return slope / np.linalg.norm(slope, axis=1, keepdims=True)

    def departures(self, points: Array, near: Array) -> tuple[Array, Array]:
        """Return how far points are from the curve.

        Parameters
        ----------
        points : ndarray, shape (n, 3)
        near : ndarray, shape (n,)
            Lengths along the curve, near which the nearest points are looked for.

        Returns
        -------
        ways, tangents : ndarray
            From the nearest points [m], and tangents there, 0 where that is an end; shapes (n, 3).
        """
        along, farthest = np.clip(near, 0.0, self.length), 0.1 * self.length
        for _ in range(CORRECTIONS):
            away, slope = points - self._curve(along), self._curve(along, 1)
            down = np.einsum("ij,ij->i", away, slope)
            steep = np.einsum("ij,ij->i", slope, slope) - np.einsum("ij,ij->i", away, self._curve(along, 2))
            step = np.clip(down / np.maximum(steep, 0.1), -farthest, farthest)
            along = np.clip(along + step, 0.0, self.length)
        tangents = self.tangents(along)
        away = points - self._curve(along)
        inside = (along > 0.0) & (along < self.length)
        tangents[~inside] = 0.0
        return away - np.einsum("ij,ij->i", away, tangents)[:, None] * tangents, tangents


def read_curve(path: str | Path) -> TargetCurve:
    """Return the curve of a csv file with columns x, y and z [m].

    Raises
    ------
    InputError
        If it cannot be read, or holds no curve.
    """
    source = str(path)
    try:
        text = io.StringIO(read_text(Path(path), LARGEST_TABLE), newline="")
        table = csv.DictReader(text, strict=True, skipinitialspace=True)
        columns, rows = list(table.fieldnames or ()), list(table)
    except (csv.Error, ValueError) as error:
        raise InputError(f"{source}: must be a readable csv file: {error}") from None
    if any(columns.count(axis) != 1 for axis in "xyz"):
        raise InputError(f"{source}: must have columns x, y and z [m], each once; its first line has: {columns}")
    points = []
    for line, row in enumerate(rows, start=2):
        try:
            points.append([float(row[axis] or "") for axis in "xyz"])
        except ValueError:
            raise InputError(f"{source}: line {line}: must have three numbers x, y and z") from None
    return TargetCurve(np.array(points), source)


def between(start: Array, target: TargetCurve, part: float) -> TargetCurve:
    """Return the curve whose bends are a part of the way from those of a polygon to those of a target, from the same
    start; what is interpolated are turns in frames that go along without turning about the tangent (Bishop).
    """
    lengths = np.linalg.norm(np.diff(start, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)]) * target.length / lengths.sum()
    first, last = np.diff(start, axis=0), np.diff(target.at(along), axis=0)
    ways = [edges / np.linalg.norm(edges, axis=1, keepdims=True) for edges in (first, last)]
    frame = np.linalg.svd(ways[0][:1])[2]
    frame[0] = ways[0][0]
    other = _carry(frame, _turn(ways[0][0], ways[1][0]))
    turns = [_bends(own, of) for own, of in zip(ways, (frame, other), strict=True)]
    begin = part * _turn(ways[0][0], ways[1][0])
    now = _carry(frame, begin)
    points = [start[0], start[0] + lengths[0] * now[0]]
    for length, one, two in zip(lengths[1:], *turns, strict=True):
        bend = (1.0 - part) * one + part * two
        now = _carry(now, bend[0] * now[1] + bend[1] * now[2])
        points.append(points[-1] + length * now[0])
    return TargetCurve(np.array(points), target.source, math.pi)


def _turn(one: Array, other: Array) -> Array:
    """Return the rotation vector of the smallest turn from a unit vector to another."""
    axis, cosine = np.cross(one, other), float(one @ other)
    sine = float(np.linalg.norm(axis))
    return axis * (math.atan2(sine, cosine) / sine if sine > 0.0 else 0.0)


def _carry(frame: Array, turn: Array) -> Array:
    """Return the rows of a frame, turned by a rotation vector."""
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return frame
    axis = turn / angle
    around = frame @ axis
    parallel = around[:, None] * axis
    return parallel + math.cos(angle) * (frame - parallel) + math.sin(angle) * np.cross(axis, frame)


def _bends(ways: Array, frame: Array) -> list[Array]:
    """Return the turns from each tangent to the next, along the two normals of a frame that is carried along."""
    found = []
    for one, other in zip(ways[:-1], ways[1:], strict=True):
        turn = _turn(one, other)
        found.append(np.array([turn @ frame[1], turn @ frame[2]]))
        frame = _carry(frame, turn)
    return found
