"""Twist, writhe and linking of curves given by points: what no motion changes without one passing through another.

The Gauss integral of two segments is the solid angle of all directions in which one is seen to cross the other, over
4π, with the sign of the crossing (Klenin and Langowski 2000, method 1a); of two curves, the sum over their segments.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray
FAR = 1e4
"""Length by which curves are made longer at their ends, over their own."""

FLAT = 1e-10
"""Volume of two segments over their lengths up to which they lie in one plane, as neighbours do, and never cross."""


def gauss_integral(first: Array, second: Array) -> float:
    """Return half the signed crossings seen of two chains, shapes (n, 3) and (m, 3), averaged over directions."""
    a, b = first[:-1, None], first[1:, None]
    c, d = second[None, :-1], second[None, 1:]
    corners = [_unit(np.cross(c - a, d - a)), _unit(np.cross(d - a, d - b))]
    corners += [_unit(np.cross(d - b, c - b)), _unit(np.cross(c - b, c - a))]
    angles = [(p * q).sum(-1).clip(-1.0, 1.0) for p, q in zip(corners, corners[1:] + corners[:1], strict=True)]
    lengths = np.linalg.norm(d - c, axis=-1) * np.linalg.norm(b - a, axis=-1) * np.linalg.norm(c - a, axis=-1)
    volume = (np.cross(d - c, b - a) * (c - a)).sum(-1)
    sign = np.where(np.abs(volume) > FLAT * lengths, np.sign(volume), 0.0)
    return float((np.arcsin(angles).sum(0) * sign).sum() / (4.0 * np.pi))


def _unit(v: Array) -> Array:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return v / np.where(length > 0.0, length, 1.0)


def longer(points: Array, axis: Array) -> Array:
    """Return a curve that continues straight at both ends, far before it and behind it along an axis."""
    far = FAR * np.linalg.norm(np.diff(points, axis=0), axis=1).sum() * axis
    return np.concatenate([[points[0] - far], points, [points[-1] + far]])


def twist(points: Array, directors: Array) -> float:
    """Return the turns of the directors of edges about the curve, shape (n − 1, 3).

    From edge to edge a director turns by less than half a turn.
    """
    tangent = _unit(np.diff(points, axis=0))
    before, after = tangent[:-1], tangent[1:]
    carried = _carried(directors[:-1], before, after)
    next_one = directors[1:]
    sine = (np.cross(carried, next_one) * after).sum(1)
    return float(np.arctan2(sine, (carried * next_one).sum(1)).sum() / (2.0 * np.pi))


def _carried(vectors: Array, before: Array, after: Array) -> Array:
    """Return the vectors turned by the smallest rotation from one tangent to the next."""
    axis = np.cross(before, after)
    along = (axis * vectors).sum(1, keepdims=True) * axis / (1.0 + (before * after).sum(1, keepdims=True))
    return (before * after).sum(1, keepdims=True) * vectors + np.cross(axis, vectors) + along
