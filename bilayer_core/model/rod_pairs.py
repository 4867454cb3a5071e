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

from bilayer_core.model.edge_figures import edge_figures
from bilayer_core.model.findings import Finding
from bilayer_core.model.section import sections
from bilayer_core.scene.body import Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Rod

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
    severity: float = 0.0  # of rods that may meet themselves, by how far they turn [rad]

    @property
    def itself(self) -> bool:
        """True if the pair is one rod and itself."""
        return self.first == self.second and not self.copies


def rod_pairs(scene: SceneConfig) -> tuple[RodPair, ...]:
    """Return all pairs of rods, with the decision and its reason."""
    return scene.keep("rod pairs", (), lambda: _rod_pairs(scene))


def _rod_pairs(scene: SceneConfig) -> tuple[RodPair, ...]:
    found, regions = [], [_regions(scene, rod) for rod in scene.rods]
    for index, rod in enumerate(scene.rods):
        possible, geometry, angle = _can_close(scene, rod)
        decided = _decide(scene, (possible, geometry))
        found.append(RodPair(index, index, False, f"{rod.name} – itself", *decided, severity=angle))
        if len(rod.copy_names) > 1:
            can = _can_reach(scene, regions[index], regions[index], copies=True)
            found.append(RodPair(index, index, True, f"{rod.name} – its copies", *_decide(scene, can)))
        for other in range(index):
            can = _can_reach(scene, regions[other], regions[index])
            found.append(RodPair(other, index, False, f"{scene.rods[other].name} – {rod.name}", *_decide(scene, can)))
    return tuple(found)


def passing_warnings(scene: SceneConfig) -> Iterator[Finding]:
    """Yield the warnings of rods that could meet, but would pass through each other."""
    for rod_pair in rod_pairs(scene):
        if rod_pair.possible and not rod_pair.active:
            yield Finding(
                kind="rods that pass through themselves" if rod_pair.itself else "rods that pass through each other",
                where=rod_pair.what,
                before="rods may pass through each other: ",
                after=f" ({rod_pair.reason}; by geometry: {rod_pair.geometry})",
                severity=rod_pair.severity,
            )


def _decide(scene: SceneConfig, by_geometry: tuple[bool, str]) -> tuple[bool, bool, str, str]:
    """Return whether geometry lets two rods meet, whether they have contact, and the reason for each."""
    possible, geometry = by_geometry
    if scene.contact is None:
        return possible, False, geometry, "no contact settings"
    if scene.contact.rods == "auto":
        return possible, possible, geometry, geometry
    return possible, scene.contact.rods, geometry, f"contact.rods is {str(scene.contact.rods).lower()}"


def _can_close(scene: SceneConfig, rod: Rod) -> tuple[bool, str, float]:
    """Return whether a rod can turn far enough to meet itself, the reason, and how far it can turn [rad]."""
    length, middles = rod.path.length, np.arange(rod.stations - 1) + 0.5
    figures = edge_figures(scene, rod)
    copy = rod.copies[0].rod  # whose sections are those of all
    layers = [sections(copy, layer, scene.materials[layer.material], middles) for layer in copy.layers]
    stiffness = sum(layer.bending_stiffness[0] for layer in layers)
    if len(layers) == 2:
        first, second = (layer.axial_stiffness for layer in layers)
        stiffness = stiffness + first * second / (first + second) * (0.5 * figures.thickness) ** 2
    weight = float(sum(layer.mass for layer in layers).max() * np.linalg.norm(scene.gravity))
    own = [[layer.natural_curvature or 0.0, layer.natural_curvature_across or 0.0] for layer in rod.layers]
    natural = np.abs([[values_at(part, rod.edge_length * middles) for part in parts] for parts in own])
    bent = figures.free_curvature() + natural.max(axis=0).sum(axis=0)
    sag = weight * length**3 / (6.0 * float(stiffness.min()))
    if all(variant.clamp_start or variant.clamp_end for variant in rod.variants):
        sag = min(sag, 0.5 * HALF_TURN)
    angle = rod.path.turn + float(bent.sum()) * rod.edge_length + sag
    degrees = f"{math.degrees(angle):.0f}°" if angle < 100.0 * HALF_TURN else "many times"
    if angle < HALF_TURN:
        return False, f"turns by {degrees} at most, 180° would be needed to meet itself", angle
    return True, f"can turn by {degrees}", angle


Region = tuple[np.ndarray, float]
"""Centre and radius [m] of a ball."""


def _can_reach(
    scene: SceneConfig, first: list[Region | None], second: list[Region | None], copies: bool = False
) -> tuple[bool, str]:
    """Return whether copies of two rods, or several of one, can come together, and the reason."""
    if None in first or None in second:
        return True, "nothing keeps them apart"
    (center_a, radius_a), (center_b, radius_b) = (
        map(np.array, zip(*regions, strict=True)) for regions in (first, second)
    )
    gaps = np.linalg.norm(center_a[:, None] - center_b, axis=2) - radius_a[:, None] - radius_b
    apart = float((gaps[np.triu_indices(len(gaps), 1)] if copies else gaps).min())
    if apart > scene.contact.barrier_distance if scene.contact else apart > 0.0:
        return False, f"held {1e3 * apart:.3g} mm apart by their clamps"
    return True, "both reach the space between their clamps"


def _regions(scene: SceneConfig, rod: Rod) -> list[Region | None]:
    """Return the balls that the copies of a rod do not leave; None for one that no prescribed body holds."""
    figures = edge_figures(scene, rod)
    extent = rod.path.length * (1.0 + figures.eigenstrain.max()) + figures.thickness.max()
    bodies = {body.name: body for body in scene.bodies if isinstance(body.motion, Prescribed)}
    ends = rod.frames_at(np.array([0.0, rod.path.length]))[0]
    regions: list[Region | None] = []
    for copy in rod.copies:
        names = [name for name in (copy.rod.clamp_start, copy.rod.clamp_end) if name in bodies]
        held = [name for name in names if not bodies[name].motion.controlled]
        if not held:
            regions.append(None)
            continue
        body = bodies[held[0]]
        moved = max((math.dist(move, (0.0, 0.0, 0.0)) for move in body.motion.displacements), default=0.0)
        clamped = copy.place.points(ends)[0 if held[0] == copy.rod.clamp_start else 1]
        offset = float(np.linalg.norm(clamped - np.array(body.position))) * (2.0 if body.motion.rotations else 1.0)
        regions.append((clamped, extent + moved + offset))
    return regions
