"""Small departures of rods from their paths: shapes, and where one is missed.

A rod that is its own mirror image stays so until it buckles, and only what breaks the symmetry says when: without an
imperfection, the last digit of a position. One of size a in the shape of the first buckling, free of stress, becomes

    w = a/(1 − P/P_cr)

under an end load P, to first order (Timoshenko and Gere 1961, Theory of Elastic Stability, ch. 1.12).

Shapes f(x) of a rod along x = s/L from 0 to 1, the n-th of those that leave position and direction of clamped ends:

    both ends free       sin nπx
    clamped at x = 0     1 − cos (n − ½)πx        the buckling of a column with a free end
    both ends clamped    sin πx sin nπx           n = 1: ½ (1 − cos 2πx), that of a clamped column
    closed               cos 4πx, sin 4πx, cos 6πx …      an oval: the buckling of a ring under pressure
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.model.findings import Finding
from bilayer_core.model.section import outline
from bilayer_core.scene.body import Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.faults import ROUNDING
from bilayer_core.scene.imperfection import Imperfection
from bilayer_core.scene.paths import StraightPath
from bilayer_core.scene.rod import Rod, RodCopy

Array = np.ndarray
MODES = 6
"""Of a random shape."""
SAMPLES = 1001
"""Places along the rod at which its largest departure is looked for."""
ADVISED = 0.01
"""Part of the thickness."""


def departure(rod: Rod, arc: Array) -> tuple[Array, Array]:
    """Return the distance from the path [m] and its slope at lengths `arc` [m] along it, towards the normal and across,
    shapes (n, 2).
    """
    weights = _weights(rod.imperfection)
    largest = np.linalg.norm(_modes(rod, np.linspace(0.0, 1.0, SAMPLES))[0] @ weights, axis=1).max()
    values, slopes = _modes(rod, arc / rod.path.length)
    scale = rod.imperfection.size / largest
    return scale * (values @ weights), scale / rod.path.length * (slopes @ weights)


def _weights(imperfection: Imperfection) -> Array:
    """Return the weight of each mode in the two directions, shape (MODES, 2)."""
    directed = np.array([imperfection.direction != "across", imperfection.direction != "normal"], dtype=float)
    if imperfection.shape == "bow":
        return np.outer(np.arange(MODES) == 0, directed)
    random = np.random.default_rng(imperfection.seed).standard_normal((MODES, 2))
    return directed * random / np.arange(1, MODES + 1)[:, None] ** 2


def _modes(rod: Rod, x: Array) -> tuple[Array, Array]:
    """Return f and df/dx, shapes (n, MODES)."""
    n, pi, x = np.arange(1, MODES + 1), np.pi, x[:, None]
    if rod.closed:
        rate, phase = 2.0 * pi * (1 + (n + 1) // 2), 0.5 * pi * (1 - n % 2)
        return np.cos(rate * x - phase), -rate * np.sin(rate * x - phase)
    start, end = rod.clamp_start is not None, rod.clamp_end is not None
    if start and end:
        rate = n * pi * np.sin(pi * x) * np.cos(n * pi * x) + pi * np.cos(pi * x) * np.sin(n * pi * x)
        return np.sin(pi * x) * np.sin(n * pi * x), rate
    if not (start or end):
        return np.sin(n * pi * x), n * pi * np.cos(n * pi * x)
    sign, k = (1.0, (n - 0.5) * pi) if start else (-1.0, (n - 0.5) * pi)
    from_clamp = x if start else 1.0 - x
    return 1.0 - np.cos(k * from_clamp), sign * k * np.sin(k * from_clamp)


def advice(scene: SceneConfig) -> Iterator[Finding]:
    """Yield the rods whose buckling is left to rounding, each with what to declare."""
    for scene_rod in scene.rods:
        for copy in scene_rod.copies if scene_rod.imperfection is None else ():
            reason, rod = _symmetry(scene, copy), copy.rod
            if reason:
                thickness = float(outline(rod, np.arange(rod.stations))[1].sum(axis=0).min())
                shape = "random" if rod.clamp_start and rod.clamp_end else "bow"
                yield Finding(
                    kind=reason,
                    where=f"rods.{rod.name}",
                    after=f": {reason}, so that rounding decides when and which way it buckles or snaps; "
                    f"declare `imperfection: {{shape: {shape}, size: {1e6 * ADVISED * thickness:.2g} um}}`",
                )


def _symmetry(scene: SceneConfig, copy: RodCopy) -> str:
    """Return the reason why rounding decides the buckling of a rod, in words; empty if there is none."""
    rod = copy.rod
    bodies = {body.name: body.motion for body in scene.bodies}
    holders = [bodies.get(name) for name in (rod.clamp_start, rod.clamp_end)]
    grows = any(layer.eigenstrain for layer in rod.layers)
    moved = any(isinstance(motion, Prescribed) and motion.moves for motion in holders)
    if all(isinstance(motion, Prescribed) for motion in holders) and (grows or moved):
        return "is clamped at both ends and " + ("grows" if grows else "its ends move")
    natural = ("natural_curvature", "natural_curvature_across", "natural_twist")
    bent = grows or any(getattr(layer, key) for layer in rod.layers for key in natural)
    if bent or not isinstance(rod.path, StraightPath) or (rod.clamp_start is None) == (rod.clamp_end is None):
        return ""
    direction, normal = (copy.place.directions(np.array(vector)) for vector in (rod.path.direction, rod.normal))
    away = direction * (1.0 if rod.clamp_start else -1.0)
    forces = [np.array(scene.gravity)]
    for load in scene.loads:
        if load.rod is not None and load.rod in (rod.name, copy.name):
            axes = np.array([direction, normal, np.cross(direction, normal)])
            forces.append(np.array(load.force) @ (axes if load.frame == "material" else np.eye(3)))
    across = any(np.linalg.norm(np.cross(force, away)) > ROUNDING * np.linalg.norm(force) for force in forces)
    return "" if across or sum(force @ away < 0.0 for force in forces) == 0 else "is pressed along its axis"
