"""Figures of a rod at the middle of each of its edges: strains and curvatures that stimuli reach, and shear."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.plate_section import free_strain
from bilayer_core.model.section import outline
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import strain_at, strains_at
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Layer, Rod

GAUSS_POINTS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(3)  # exact for the squares of parabolas


def _eigenstrain_range(scene: SceneConfig, rod: Rod, layer: Layer, laws: tuple[Eigenstrain, ...]) -> np.ndarray:
    """Return the largest magnitude, least and largest eigenstrain over the channels' ranges, shape (3, n_edge)."""
    found = np.zeros((3, rod.stations - 1))
    for law in laws:
        channel = scene.stimuli[law.stimulus]
        ends = strains_at(rod, layer, law, np.array([channel.minimum, channel.maximum]))
        least, most = ends.min(), ends.max()
        driven = rod.covered_parts(np.arange(rod.stations - 1), layer, law) > 0.0
        found[:, driven] += np.array([[max(abs(least), abs(most))], [least], [most]])
    return found


def _multiples(scene: SceneConfig, rod: Rod, index: int) -> tuple[float, float]:
    """Return the least and the largest multiple of the moduli of a layer over its channel's range."""
    found = [1.0] if rod.layers[index].stiffness_change is None else []
    for variant in rod.variants:
        layer = variant.layers[index]
        if (law := layer.stiffness_change) is not None:
            channel = scene.stimuli[law.stimulus]
            found += (1.0 + strain_at(variant, layer, law, np.array([channel.minimum, channel.maximum]))).tolist()
    return min(found), max(found)


def edge_figures(scene: SceneConfig, rod: Rod) -> EdgeFigures:
    """Return the figures of a rod of a scene."""
    return scene.keep("edge figures", (rod,), lambda: EdgeFigures(scene, rod))


class EdgeFigures:
    """Figures of a rod at the middle of each of its edges; of several copies, those of the one with the most.

    Attributes
    ----------
    width, thickness : ndarray
        Of the whole section [m], shape (n_edge,).
    eigenstrain : ndarray
        Largest magnitude along the path in each layer over its channels' ranges, shape (n_layer, n_edge).
    eigenstrain_across : ndarray
        Likewise across the path.
    eigenstrain_range : ndarray
        Least and largest, likewise, shape (2, n_layer, n_edge).
    multiple_range : ndarray
        Least and largest multiple of each layer's moduli over its channel's range, shape (2, n_layer).
    """

    def __init__(self, scene: SceneConfig, rod: Rod):
        stations = np.arange(rod.stations - 1) + 0.5
        self.width, self._layers = outline(rod, stations)
        self._hole = None  # inner over outer radius of round sections
        if rod.radius is not None:
            self._hole = 2.0 * values_at(rod.inner_radius, rod.edge_length * stations) / self.width
        self._moduli, self._shear_moduli = np.zeros_like(self._layers), np.zeros_like(self._layers)
        self.eigenstrain, self.eigenstrain_across = np.zeros_like(self._layers), np.zeros_like(self._layers)
        self.eigenstrain_range = np.zeros((2, *self._layers.shape))
        self.multiple_range = np.array([_multiples(scene, rod, index) for index in range(len(rod.layers))]).T
        for index, layer in enumerate(rod.layers):
            along = rod.edge_length * stations
            stiffness = values_at(layer.stiffness, along) * values_at(rod.width_of(layer), along) / self.width
            material = scene.materials[layer.material]
            self._moduli[index] = stiffness * material.youngs_modulus
            self._shear_moduli[index] = self._moduli[index] / (2.0 * (1.0 + material.poisson_ratio))
            of_copies = dict.fromkeys(tuple(variant.layers[index].eigenstrain) for variant in rod.variants)
            ranges = np.array([_eigenstrain_range(scene, rod, layer, laws) for laws in of_copies])
            along, across, _ = free_strain(layer, along).T
            self.eigenstrain_across[index] = abs(across) * ranges[:, 0].max(axis=0)
            self.eigenstrain[index] = abs(along) * ranges[:, 0].max(axis=0)
            ends = along * np.stack([ranges[:, 1].min(axis=0), ranges[:, 2].max(axis=0)])
            self.eigenstrain_range[:, index] = np.sort(ends, axis=0)
        self.thickness = self._layers.sum(axis=0)
        self._poisson = scene.materials[rod.layers[0].material].poisson_ratio  # of the one layer of a round rod
        along = rod.edge_length * stations
        self._path = rod.curvatures_at(along)[:, 0]
        self._natural = np.array(
            [
                self._path if layer.natural_curvature is None else values_at(layer.natural_curvature, along)
                for layer in rod.layers
            ]
        )

    def curvature(self) -> np.ndarray:
        """Return the largest curvature without loads [1/m], shape (n_edge,): that of the path, or that to which the
        layers' natural curvatures bend it, together with what eigenstrains add at most.
        """
        return np.maximum(np.abs(self._path), np.abs(self._path + self.natural_change())) + self.free_curvature()

    def bend_of_layers(self) -> np.ndarray:
        """Return the natural curvature times thickness of each layer by itself, shape (n_layer, n_edge)."""
        return np.abs(self._natural) * self._layers

    def natural_change(self) -> np.ndarray:
        """Return the curvature that the layers' natural curvatures add to that of the path [1/m], shape (n_edge,).

        Σ EI (χ̄ − χ_path)/D, positive towards the normal, with D the bending stiffness of the bonded section.
        """
        own = self._moduli * self._layers**3 / 12.0
        both = own.sum(axis=0)
        if len(self._layers) == 2:
            axial = self._moduli * self._layers
            both = both + axial[0] * axial[1] / axial.sum(axis=0) * (0.5 * self.thickness) ** 2
        return (own * (self._natural - self._path)).sum(axis=0) / both

    def free_curvature(self, across: bool = False) -> np.ndarray:
        """Return the most that eigenstrains add to the curvature without loads [1/m], along the path or, of a free
        plate, across, shape (n_edge,).

        It follows Timoshenko's formula, and is 0 where there is one layer.
        """
        curvature, eigenstrain = np.zeros(len(self.width)), self.eigenstrain_across if across else self.eigenstrain
        both = (self._layers > 0.0).all(axis=0) & (len(self._layers) == 2)
        if both.any():
            (bottom, top), moduli = self._layers[:, both], self._moduli[:, both]
            m, n = moduli[0] / moduli[1], bottom / top
            (least, at_least), (most, at_most) = self.multiple_range
            m = np.clip(1.0 / n**2, m * least / at_most, m * most / at_least)  # where it is largest
            shape = 6.0 * (1.0 + n) ** 2 / (3.0 * (1.0 + n) ** 2 + (1.0 + m * n) * (n**2 + 1.0 / (m * n)))
            curvature[both] = shape * eigenstrain[:, both].sum(axis=0) / (bottom + top)
        return curvature

    def shear_over_bending(self) -> np.ndarray:
        """Return the bending stiffness times the deflection by shear per force and length [m²], shape (n_edge,).

        D c with c = w ∫ Q²/(G D²) dz and Q(z) = ∫ E z dz from the face to z, heights being over the neutral axis: a
        section's shear stress V Q/D, and its energy ½ c V². It is 6 EI/(5 GA) for one layer, and for a round one
        EI/(k GA) with Cowper's k = 6 (1 + ν)(1 + m²)²/((7 + 6ν)(1 + m²)² + (20 + 12ν) m²), m = r/R (1966).
        """
        if self._hole is not None:
            nu, m = self._poisson, self._hole
            whole = (1.0 + m**2) ** 2
            second_over_area = self.width**2 * (1.0 + m**2) / 16.0
            k = 6.0 * (1.0 + nu) * whole / ((7.0 + 6.0 * nu) * whole + (20.0 + 12.0 * nu) * m**2)
            return self._moduli[0] / self._shear_moduli[0] * second_over_area / k
        moduli, edges = self._moduli, np.zeros((len(self._layers) + 1, len(self.width)))
        edges[1:] = np.cumsum(self._layers, axis=0)
        middle = 0.5 * (edges[1:] + edges[:-1])
        axial = moduli * self._layers
        edges = edges - (axial * middle).sum(axis=0) / axial.sum(axis=0)
        flow, bending, shear = np.zeros_like(self.width), np.zeros_like(self.width), np.zeros_like(self.width)
        for e, g, low, high in zip(moduli, self._shear_moduli, edges[:-1], edges[1:], strict=True):
            points = 0.5 * (high + low) + 0.5 * (high - low) * GAUSS_POINTS[:, None]
            along = flow + 0.5 * e * (points**2 - low**2)
            shear += 0.5 * (high - low) * (GAUSS_WEIGHTS[:, None] * along**2).sum(axis=0) / g
            bending += e * (high**3 - low**3) / 3.0
            flow = flow + 0.5 * e * (high**2 - low**2)
        return shear / bending
