"""Numbers of a scene that are possible, but that hardly anybody means: a unit was forgotten, or another one written."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.model.edge_figures import edge_figures
from bilayer_core.model.findings import Finding
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.profile import extremes

SOFTEST, STIFFEST = 100.0, 2e12
"""Young's moduli [Pa] of the softest gels and beyond diamond."""
LIGHTEST, HEAVIEST = 5.0, 25e3
"""Densities [kg/m³] of a light foam and beyond osmium."""
LARGEST_ROBOT = 10.0
"""Length of a rod [m]."""
LARGEST_SURFACE = 100.0
"""Times the longest rod: the size of a body or of an obstacle that has a size."""
WHOLE = 1.0
"""Eigenstrain of a layer that doubles its length."""
STRONGEST_GRAVITY = 1e3
"""[m/s²]"""


def implausible_numbers(scene: SceneConfig) -> Iterator[Finding]:
    """Yield a question for each number that is far from that of any robot."""
    longest = max(rod.path.length for rod in scene.rods)
    yield from _of_materials(scene)
    for rod in scene.rods:
        where, length = f"rods.{rod.name}", rod.path.length
        if length > LARGEST_ROBOT:
            yield _question(where, "is", f"{length:.3g} m long", "mm")
        width = rod.widest
        if width > length:
            yield _question(f"{where}.width", "is", f"{width:.3g} m, more than its length of {length:.3g} m", "mm")
        for layer in rod.layers:
            thickness = extremes(layer.thickness)[1]
            if thickness > length:
                value = f"{thickness:.3g} m, more than its length of {length:.3g} m"
                yield _question(f"{where}.layers.{layer.name}.thickness", "is", value, "mm")
        strain = float(edge_figures(scene, rod).eigenstrain.max())
        if strain > WHOLE:
            yield _question(where, "has layers that strain by", f"{100 * strain:.3g} % (`gain` times the channel)", "%")
    for key, parts in (("bodies", [(b.name, b.surface) for b in scene.bodies]), ("obstacles", _named(scene))):
        for name, shape in parts:
            size = _size(shape)
            if size > LARGEST_SURFACE * longest:
                value = f"{size:.3g} m large, {size / longest:.2g} times the longest rod"
                yield _question(f"{key}.{name}", "is", value, "mm")
    strength = float(np.linalg.norm(scene.gravity))
    if strength > STRONGEST_GRAVITY:
        yield _question("gravity", "is", f"{strength:.3g} m/s², {strength / 9.81:.2g} times the Earth's", "mm/s^2")


def _named(scene: SceneConfig) -> list:
    return [(obstacle.name, obstacle) for obstacle in scene.obstacles]


def _size(shape: object) -> float:
    """Return the largest length of a surface [m]; 0 for a plane, or without one."""
    lengths = [2.0 * getattr(shape, "radius", 0.0), getattr(shape, "length", 0.0), *getattr(shape, "size", ())]
    return float(max(lengths))


def _of_materials(scene: SceneConfig) -> Iterator[Finding]:
    for name, material in scene.materials.items():
        modulus, density = material.youngs_modulus, material.density
        if not SOFTEST <= modulus <= STIFFEST:
            kind = "softer than any gel" if modulus < SOFTEST else "stiffer than diamond"
            unit = "MPa" if modulus < SOFTEST else "Pa"
            yield _question(f"materials.{name}.youngs_modulus", "is", f"{modulus:.3g} Pa, {kind}", unit)
        if not LIGHTEST <= density <= HEAVIEST:
            kind = "lighter than foam" if density < LIGHTEST else "heavier than any metal"
            yield _question(f"materials.{name}.density", "is", f"{density:.3g} kg/m³, {kind}", "g/cm^3")


def _question(where: str, verb: str, value: str, unit: str) -> Finding:
    after = f" {verb} {value}: is the unit right? A number without one is in SI units, `3 {unit}` says which it has"
    return Finding(f"{unit} {verb} {where.rpartition('.')[2]}", where, after)
