"""Where the validity of a rod model ends."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..scene.config import SceneConfig
from ..scene.rod import Layer, Rod
from ..scene.transduction import free_strain

LARGE_STRAIN = 0.1  # linear elasticity and the rectangular section lose meaning
SLENDER = 5.0  # least length over width
THICK_CURVATURE = 0.2  # curvature × thickness
PLATE_RANGE = (0.5, 3.0)  # of w²κ/H: between beam and plate


def validity_warnings(scene: SceneConfig) -> Iterator[str]:
    """Warnings, each with the figure and the limit."""
    for rod in scene.rods:
        thickness = sum(layer.thickness for layer in rod.layers)
        if rod.path.length < SLENDER * rod.width:
            yield (
                f"rods.{rod.name}: length/width is {rod.path.length / rod.width:.2g}; "
                f"below {SLENDER:g} it is a plate more than a rod"
            )
        strain = max((_largest_eigenstrain(scene, rod, layer) for layer in rod.layers), default=0.0)
        if strain > LARGE_STRAIN:
            yield (
                f"rods.{rod.name}: eigenstrain up to {100 * strain:.3g} %; "
                f"the material law is linear, meant for up to {100 * LARGE_STRAIN:g} %"
            )
        curvature = _free_curvature(scene, rod)
        if curvature * thickness > THICK_CURVATURE:
            yield (
                f"rods.{rod.name}: curvature × thickness reaches {curvature * thickness:.2g}; "
                f"above {THICK_CURVATURE:g} it is no thin rod"
            )
        ratio = rod.width**2 * curvature / thickness
        if PLATE_RANGE[0] <= ratio <= PLATE_RANGE[1]:
            yield (
                f"rods.{rod.name}: w²κ/H reaches {ratio:.2g}, between beam and plate: "
                "an experiment may be up to 1/(1−ν²) stiffer and its swelling curvature 1+ν higher; "
                "agreement below 30 % means nothing"
            )
        if scene.contact is not None:
            distance = scene.contact.barrier_distance
            if distance > 0.5 * thickness:
                yield (
                    f"contact.barrier_distance: {1e3 * distance:g} mm against "
                    f"{1e3 * thickness:g} mm of thickness of rods.{rod.name}: surfaces float visibly apart; "
                    "0.1 to 0.2 mm is closer"
                )
            if rod.edge_length > 2.0 * thickness + 2.0 * distance:
                yield (
                    f"rods.{rod.name}: edges are {1e3 * rod.edge_length:.3g} mm long; "
                    "only nodes feel surfaces, and a small obstacle fits between them"
                )


def _largest_eigenstrain(scene: SceneConfig, rod: Rod, layer: Layer) -> float:
    """Largest magnitude of a layer's eigenstrain over its channels' ranges."""
    largest = np.zeros(rod.stations - 1)
    for law in layer.eigenstrain:
        channel = scene.stimuli[law.stimulus]
        ends = np.array([channel.minimum, channel.maximum])
        largest[rod.driven_edges(layer, law)] += np.abs(
            free_strain(ends, law.gain, law.reference, np.full(2, law.limit))
        ).max()
    return float(largest.max())


def _free_curvature(scene: SceneConfig, rod: Rod) -> float:
    """Largest free curvature of a bilayer by Timoshenko's formula [1/m]; 0 for one layer."""
    if len(rod.layers) == 1:
        return 0.0
    bottom, top = rod.layers
    m = scene.materials[bottom.material].youngs_modulus / scene.materials[top.material].youngs_modulus
    n = bottom.thickness / top.thickness
    mismatch = sum(_largest_eigenstrain(scene, rod, layer) for layer in rod.layers)
    shape = 6.0 * (1.0 + n) ** 2 / (3.0 * (1.0 + n) ** 2 + (1.0 + m * n) * (n**2 + 1.0 / (m * n)))
    return shape * mismatch / (bottom.thickness + top.thickness)
