"""Faults of paths that come nearer to themselves than their rod is thick."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from bilayer_core.scene.faults import ROUNDING, Fault
from bilayer_core.scene.paths import Frames, Path
from bilayer_core.scene.profile import extremes


class Rod(Protocol):
    """A rod, as far as its shape goes: see `bilayer_core.scene.rod.Rod`."""

    path: Path
    layers: list
    closed: bool

    def frames_at(self, arc: np.ndarray) -> Frames:
        """Return the points [m], tangents and normals at lengths `arc` [m] along the path."""
        ...


SAMPLES_PER_THICKNESS = 3
"""Of a path that may cross itself: two of them are nearer than the thickness wherever it does."""
NEIGHBOURS = 1 + 2 * math.ceil(0.5 * math.pi * SAMPLES_PER_THICKNESS) + 1
"""Of a sample, itself included, of which one at least is no neighbour along the path, if there is any so near."""
MOST_THICKNESSES, SAMPLES_AT_ONCE = 2e5, 100_000
"""Largest length of such a path in thicknesses of its rod, and the samples that are looked at together: in seconds, and
with little memory."""


def crossings(rod: Rod) -> Iterator[Fault]:
    """Yield a fault if a path comes nearer to itself than the thickness of its rod, except for the two sides of a bend
    no sharper than half the thickness.

    A path that turns by less than half a turn cannot.
    """
    if rod.path.turn < math.pi:
        return
    from scipy.spatial import cKDTree

    thickness = sum(extremes(layer.thickness)[1] for layer in rod.layers)
    if rod.path.length > MOST_THICKNESSES * thickness:
        demand = (
            f"must be at most {MOST_THICKNESSES:g} times the thickness of the rod, {thickness:g} m, of a path that may "
            "come back to itself"
        )
        yield ("path",), f"a length of {rod.path.length:g} m", demand
        return
    samples = math.ceil(SAMPLES_PER_THICKNESS * rod.path.length / thickness)
    arc = np.linspace(0.0, rod.path.length, samples + 1)[: samples if rod.closed else None]
    parts = np.array_split(np.arange(len(arc)), 1 + len(arc) // SAMPLES_AT_ONCE)
    points = np.concatenate([rod.frames_at(arc[part])[0] for part in parts])
    tree, nearest, first, second = cKDTree(points), thickness * (1.0 - ROUNDING), 0.0, 0.0
    for part in parts:
        apart, other = tree.query(points[part], NEIGHBOURS, distance_upper_bound=nearest)
        own = np.broadcast_to(part[:, None], other.shape)
        found = other < len(points)
        along = np.abs(arc[own[found]] - arc[other[found]])
        if rod.closed:
            along = np.minimum(along, rod.path.length - along)
        far = along > 0.5 * math.pi * thickness
        if far.any():
            least = apart[found][far].argmin()
            nearest = apart[found][far][least]
            first, second = np.sort([arc[own[found][far][least]], arc[other[found][far][least]]])
    if first == second:
        return
    demand = f"must not come nearer to itself than the thickness of the rod, {thickness:g} m"
    ends_meet = not rod.closed and first <= thickness and rod.path.length - second <= thickness
    if ends_meet and hasattr(rod.path, "closed"):
        demand += "; a ring without ends is `closed: true`"
    yield ("path",), f"{nearest:.3g} m between {first:.4g} m and {second:.4g} m along it", demand
