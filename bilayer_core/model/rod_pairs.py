"""Which rods can meet each other or themselves: what `contact.rods: auto` decides, and why.

A rod that meets itself has turned by half a turn or more in between (a closed curve with one corner of at most 180°
turns by 180° at least along its smooth part: Fenchel, Milnor). It is taken to turn by at most

    Θ = (turn of its path) + ∫ κ ds + q L³/(6 EI)

where κ is the largest free curvature that its eigenstrains, with any stimulus in the range of its channels, and its
layers' natural curvatures add, and the last term the turn of a cantilever under its own weight q per length, a quarter
turn at most if a body holds the rod. What pushes a rod beyond that (a fall, a moved clamp, something pressed against
it) is not foreseen: then `contact.rods: true` is for the scene to say.

Two rods that prescribed bodies hold stay within their lengths of their clamps, and do not meet if these regions are
apart. All others can.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..scene.body import Prescribed
from ..scene.config import SceneConfig
from ..scene.profile import values_at
from ..scene.rod import Rod
from .section import sections
from .validity import EdgeFigures

HALF_TURN = math.pi


@dataclass(frozen=True)
class RodPair:
    """Two rods of a scene by their index in it, copies of one, or one and itself; and what was decided about them.

    `possible` is what geometry says, `active` whether contact is computed, `geometry` and `reason` why.
    """

    first: int
    second: int
    copies: bool
    what: str
    possible: bool
    active: bool
    geometry: str
    reason: str


def rod_pairs(scene: SceneConfig) -> tuple[RodPair, ...]:
    """All pairs of rods, with the decision and its reason."""
    found = []
    for index, rod in enumerate(scene.rods):
        found.append(RodPair(index, index, False, f"{rod.name} – itself", *_decide(scene, _can_close(scene, rod))))
        if len(rod.copies) > 1:
            can = _can_reach(scene, rod, rod)
            found.append(RodPair(index, index, True, f"{rod.name} – its copies", *_decide(scene, can)))
        for other in range(index):
            can = _can_reach(scene, scene.rods[other], rod)
            found.append(RodPair(other, index, False, f"{scene.rods[other].name} – {rod.name}", *_decide(scene, can)))
    return tuple(found)


def passing_warnings(scene: SceneConfig) -> Iterator[str]:
    """Warnings of rods that could meet, but would pass through each other."""
    for rod_pair in rod_pairs(scene):
        if rod_pair.possible and not rod_pair.active:
            why = f"{rod_pair.reason}; by geometry: {rod_pair.geometry}"
            yield f"rods may pass through each other: {rod_pair.what} ({why})"


def _decide(scene: SceneConfig, by_geometry: tuple[bool, str]) -> tuple[bool, bool, str, str]:
    """Whether geometry lets two rods meet, whether they have contact, and the reasons of either."""
    possible, geometry = by_geometry
    if scene.contact is None:
        return possible, False, geometry, "no contact settings"
    if scene.contact.rods == "auto":
        return possible, possible, geometry, geometry
    return possible, scene.contact.rods, geometry, f"contact.rods is {str(scene.contact.rods).lower()}"


def _can_close(scene: SceneConfig, rod: Rod) -> tuple[bool, str]:
    """Whether a rod can turn far enough to meet itself."""
    length, middles = rod.path.length, np.arange(rod.stations - 1) + 0.5
    figures = EdgeFigures(scene, rod)
    layers = [sections(rod, layer, scene.materials[layer.material], middles) for layer in rod.layers]
    stiffness = sum(layer.bending_stiffness[0] for layer in layers)
    if len(layers) == 2:
        first, second = (layer.axial_stiffness for layer in layers)
        stiffness = stiffness + first * second / (first + second) * (0.5 * figures.thickness) ** 2
    weight = float(sum(layer.mass for layer in layers).max() * np.linalg.norm(scene.gravity))
    natural = [np.abs(values_at(layer.natural_curvature or 0.0, rod.edge_length * middles)) for layer in rod.layers]
    bent = figures.free_curvature() + np.max(natural, axis=0)
    sag = weight * length**3 / (6.0 * float(stiffness.min()))
    if rod.clamp_start is not None or rod.clamp_end is not None:
        sag = min(sag, 0.5 * HALF_TURN)
    angle = rod.path.turn + float(bent.sum()) * rod.edge_length + sag
    degrees = f"{math.degrees(angle):.0f}°" if angle < 100.0 * HALF_TURN else "many times"
    if angle < HALF_TURN:
        return False, f"turns by {degrees} at most, 180° would be needed to meet itself"
    return True, f"can turn by {degrees}"


def _can_reach(scene: SceneConfig, first: Rod, second: Rod) -> tuple[bool, str]:
    """Whether two rods, or copies of one, can come together."""
    if first is second:
        return True, "turned about one axis"
    regions = [_region(scene, rod) for rod in (first, second)]
    if any(region is None for region in regions):
        return True, "nothing keeps them apart"
    (center_a, radius_a), (center_b, radius_b) = regions
    apart = float(np.linalg.norm(center_a - center_b)) - radius_a - radius_b
    if apart > scene.contact.barrier_distance if scene.contact else apart > 0.0:
        return False, f"held {1e3 * apart:.3g} mm apart by their clamps"
    return True, "both reach the space between their clamps"


def _region(scene: SceneConfig, rod: Rod) -> tuple[np.ndarray, float] | None:
    """Centre and radius [m] of a ball that a rod held by a prescribed body does not leave; None for any other, or for a
    pattern.
    """
    if rod.pattern is not None:
        return None
    for name in (rod.clamp_start, rod.clamp_end):
        body = next((body for body in scene.bodies if body.name == name), None)
        if body is not None and isinstance(body.motion, Prescribed):
            moved = max((math.dist(move, (0.0, 0.0, 0.0)) for move in body.motion.displacements), default=0.0)
            start = np.array(rod.path.start) if name == rod.clamp_start else np.array(body.position)
            figures = EdgeFigures(scene, rod)
            stretched = 1.0 + figures.eigenstrain.max()
            offset = float(np.linalg.norm(start - np.array(body.position)))
            offset *= 2.0 if body.motion.rotations else 1.0
            return start, rod.path.length * stretched + moved + offset + figures.thickness.max()
    return None
