"""Distances between rectangles in space, each a middle and two half sides at right angles.

The least distance of two rectangles that do not cut each other is that of a corner of one from the other, or of two of
their sides. A rectangle may be a line or a point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray
SIGNS = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)], dtype=float)
"""Of the half sides at the corners, one round."""


@dataclass(frozen=True)
class Rectangles:
    """Middles [m], shape (n, 3), and half sides [m], shape (n, 2, 3)."""

    middle: Array
    half: Array

    def of(self, chosen: Array) -> Rectangles:
        """Return some of them."""
        return Rectangles(self.middle[chosen], self.half[chosen])

    @property
    def corners(self) -> Array:
        """Shape (n, 4, 3)."""
        return self.middle[:, None] + SIGNS @ self.half


def apart_at_least(first: Rectangles, second: Rectangles) -> Array:
    """Return a lower bound of the distance of each pair [m], shape (n,): along the line of their middles and across
    each of them.
    """
    away, halves = second.middle - first.middle, np.concatenate([first.half, second.half], axis=1)
    along = np.stack([away, *(np.cross(of.half[:, 0], of.half[:, 1]) for of in (first, second))])
    reach = np.abs(np.einsum("knd,njd->knj", along, halves))
    size = np.maximum(np.linalg.norm(along, axis=2), 1e-300)
    return ((np.abs((along * away).sum(axis=2)) - reach.sum(axis=2)) / size).max(axis=0, initial=0.0)


def apart(first: Rectangles, second: Rectangles, enough: Array | float = np.inf) -> Array:
    """Return the distance of each pair [m], shape (n,), or a lower bound that is not below `enough`."""
    found = apart_at_least(first, second)
    wide = np.abs(first.half[:, 1]).max(axis=1) + np.abs(second.half[:, 1]).max(axis=1) > 0.0
    near = found < enough
    for chosen, lines in ((near & wide, False), (near & ~wide, True)):
        if not chosen.any():
            continue
        one, other = first.of(chosen), second.of(chosen)
        if lines:
            ends = [np.stack([of.middle - of.half[:, 0], of.middle + of.half[:, 0]]) for of in (one, other)]
            found[chosen] = _of_lines(*ends[0], *ends[1])
            continue
        least = np.minimum(_from_corners(one, other), _from_corners(other, one))
        a, b = one.corners, other.corners
        sides = (a[:, :, None], np.roll(a, -1, axis=1)[:, :, None], b[:, None], np.roll(b, -1, axis=1)[:, None])
        lines = (np.broadcast_to(of, (len(a), 4, 4, 3)).reshape(-1, 3) for of in sides)
        least = np.minimum(least, _of_lines(*lines).reshape(len(a), 16).min(axis=1))
        found[chosen] = np.where(_cut(one, other) | _cut(other, one), 0.0, least)
    return found


def _from_corners(one: Rectangles, other: Rectangles) -> Array:
    """Return the distance of the nearest corner of one from the other."""
    away = one.corners - other.middle[:, None]
    square = (other.half**2).sum(axis=2)
    part = np.clip(np.einsum("nkd,njd->nkj", away, other.half) / np.maximum(square, 1e-300)[:, None], -1.0, 1.0)
    return np.linalg.norm(away - part @ other.half, axis=2).min(axis=1)


def _of_lines(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the distance of segments ab and cd, each of shape (n, 3)."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = (np.einsum("nd,nd->n", p, q) for p, q in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    across = uu * vv - uv * uv
    s = np.where(across > 1e-12 * uu * vv, (uv * vw - vv * uw) / np.maximum(across, 1e-300), 0.0)
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((uv * s + vw) / np.maximum(vv, 1e-300), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, 1e-300), 0.0, 1.0)
    return np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1)


def _cut(one: Rectangles, other: Rectangles) -> Array:
    """Return whether a side of one goes through the inside of the other."""
    corners, normal = one.corners - other.middle[:, None], np.cross(other.half[:, 0], other.half[:, 1])
    height = np.einsum("nkd,nd->nk", corners, normal)
    following, above = np.roll(corners, -1, axis=1), np.roll(height, -1, axis=1)
    fall = height - above
    part = np.where(height * above < 0.0, height / np.where(fall == 0.0, 1.0, fall), np.nan)
    at = corners + part[:, :, None] * (following - corners)
    square = np.maximum((other.half**2).sum(axis=2), 1e-300)
    inside = np.abs(np.einsum("nkd,njd->nkj", at, other.half) / square[:, None]) <= 1.0
    return inside.all(axis=2).any(axis=1)
