"""Where the validity of a rod model ends."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..scene.config import SceneConfig
from ..scene.profile import values_at
from ..scene.rod import Rod
from ..scene.transduction import free_strain
from .section import outline

LARGE_STRAIN = 0.1  # linear elasticity and the rectangular section lose meaning
SLENDER = 5.0  # least length over width
THICK_CURVATURE = 0.2  # curvature × thickness
PLATE_RANGE = (0.5, 3.0)  # of w²κ/H: between beam and plate


def validity_warnings(scene: SceneConfig) -> Iterator[str]:
    """Warnings, each with the figure and the limit."""
    for rod in scene.rods:
        at_edges = EdgeFigures(scene, rod)
        thickness, curvature, width = at_edges.thickness, at_edges.free_curvature(), at_edges.width
        if rod.path.length < SLENDER * width.max():
            yield (
                f"rods.{rod.name}: length/width is {rod.path.length / width.max():.2g}; "
                f"below {SLENDER:g} it is a plate more than a rod"
            )
        strain = at_edges.eigenstrain.max()
        if strain > LARGE_STRAIN:
            yield (
                f"rods.{rod.name}: eigenstrain up to {100 * strain:.3g} %; "
                f"the material law is linear, meant for up to {100 * LARGE_STRAIN:g} %"
            )
        if (curvature * thickness).max() > THICK_CURVATURE:
            yield (
                f"rods.{rod.name}: curvature × thickness reaches {(curvature * thickness).max():.2g}; "
                f"above {THICK_CURVATURE:g} it is no thin rod"
            )
        ratio = width**2 * curvature / thickness
        between = ratio[(ratio >= PLATE_RANGE[0]) & (ratio <= PLATE_RANGE[1])]
        if len(between):
            yield (
                f"rods.{rod.name}: w²κ/H reaches {between.max():.2g}, between beam and plate: "
                "an experiment may be up to 1/(1−ν²) stiffer and its swelling curvature 1+ν higher; "
                "agreement below 30 % means nothing"
            )
        if scene.contact is not None:
            distance = scene.contact.barrier_distance
            thin = thickness.min()
            if distance > 0.5 * thin:
                yield (
                    f"contact.barrier_distance: {1e3 * distance:g} mm against "
                    f"{1e3 * thin:g} mm of thickness of rods.{rod.name}: surfaces float visibly apart; "
                    "0.1 to 0.2 mm is closer"
                )
            if rod.edge_length > 2.0 * thin + 2.0 * distance:
                yield (
                    f"rods.{rod.name}: edges are {1e3 * rod.edge_length:.3g} mm long; "
                    "only nodes feel surfaces, and a small obstacle fits between them"
                )


class EdgeFigures:
    """Figures of a rod at the middle of each of its edges.

    Attributes
    ----------
    width, thickness : ndarray
        Of the whole section [m], shape (n_edge,).
    eigenstrain : ndarray
        Largest magnitude in each layer over its channels' ranges, shape (n_layer, n_edge).
    """

    def __init__(self, scene: SceneConfig, rod: Rod):
        stations = np.arange(rod.stations - 1) + 0.5
        self.width, self._layers = outline(rod, stations)
        self._moduli = np.zeros_like(self._layers)
        self.eigenstrain = np.zeros_like(self._layers)
        for index, layer in enumerate(rod.layers):
            stiffness = values_at(layer.stiffness, rod.edge_length * stations)
            self._moduli[index] = stiffness * scene.materials[layer.material].youngs_modulus
            for law in layer.eigenstrain:
                channel = scene.stimuli[law.stimulus]
                ends = np.array([channel.minimum, channel.maximum])
                strain = np.abs(free_strain(ends, law.gain, law.reference, np.full(2, law.limit))).max()
                self.eigenstrain[index, rod.driven_edges(layer, law)] += strain
        self.thickness = self._layers.sum(axis=0)

    def free_curvature(self) -> np.ndarray:
        """Free curvature by Timoshenko's formula [1/m], shape (n_edge,); 0 where there is one layer."""
        curvature = np.zeros(len(self.width))
        both = (self._layers > 0.0).all(axis=0) & (len(self._layers) == 2)
        if both.any():
            (bottom, top), moduli = self._layers[:, both], self._moduli[:, both]
            m, n = moduli[0] / moduli[1], bottom / top
            shape = 6.0 * (1.0 + n) ** 2 / (3.0 * (1.0 + n) ** 2 + (1.0 + m * n) * (n**2 + 1.0 / (m * n)))
            curvature[both] = shape * self.eigenstrain[:, both].sum(axis=0) / (bottom + top)
        return curvature
