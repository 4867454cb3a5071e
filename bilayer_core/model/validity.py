"""Where the validity of a rod model ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bilayer_core.model.section import outline
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Layer, Rod

LARGE_STRAIN = 0.1  # linear elasticity and the rectangular section lose meaning
SLENDER = 5.0  # least length over width
THICK_CURVATURE = 0.2  # curvature × thickness
PLATE_RANGE = (0.5, 3.0)  # of w²κ/H: between beam and plate
FAR = 0.5  # barrier distance over thickness
COARSE = 2.0  # edge length over thickness and barrier distance


@dataclass(frozen=True)
class Figure:
    """A figure of a scene on which the validity of the model depends.

    Attributes
    ----------
    where : str
        Key path.
    what, value, limit : str
        The quantity, its value with the unit, and the range in which the model is meant to be used.
    severity : float
        A number to compare figures of one quantity by: 1 at the limit, more beyond.
    outside : str
        What it means that the value is out of the range; empty while it is within.
    """

    where: str
    what: str
    value: str
    limit: str
    severity: float
    outside: str = ""

    @property
    def kind(self) -> tuple[str, bool]:
        """The quantity, and whether it is out of its range."""
        return self.what, bool(self.outside)

    @property
    def superlative(self) -> str:
        """Phrase that describes this figure when it has the largest severity among several."""
        return "worst" if self.outside else "nearest to the limit"

    def line(self, where: str) -> str:
        """Return the figure, with the text that names the place."""
        text = f"{where}: {self.what} {self.value} ({self.limit})"
        return f"{text}: {self.outside}" if self.outside else text

    def __str__(self) -> str:
        return self.line(self.where)


def validity_warnings(scene: SceneConfig) -> Iterator[Figure]:
    """Return the figures that are out of their range, each with the range and what that means."""
    return (figure for figure in validity_figures(scene) if figure.outside)


def validity_figures(scene: SceneConfig) -> Iterator[Figure]:
    """All figures of a scene on which the validity of the model depends."""
    thinnest = {}
    for rod in scene.rods:
        at_edges = edge_figures(scene, rod)
        thinnest[rod.name] = at_edges.thickness.min()
        yield from _of_section(rod, at_edges)
        if scene.contact is not None:
            yield _of_edges(rod, longest_edge(scene, rod))
    if scene.contact is not None:
        yield _of_barrier(*min(thinnest.items(), key=lambda item: item[1]), scene.contact.barrier_distance)


def _of_section(rod: Rod, at_edges: EdgeFigures) -> Iterator[Figure]:
    where, width, thickness = f"rods.{rod.name}", at_edges.width, at_edges.thickness
    curvature = at_edges.curvature()
    slenderness = rod.path.length / width.max()
    yield Figure(
        where,
        "length/width",
        f"{slenderness:.2g}",
        f"at least {SLENDER:g}",
        SLENDER / slenderness,
        "it is a plate more than a rod" if slenderness < SLENDER else "",
    )
    strain = at_edges.eigenstrain.max()
    if strain > 0.0:
        yield Figure(
            where,
            "eigenstrain up to",
            f"{100 * strain:.3g} %",
            f"at most {100 * LARGE_STRAIN:g} %",
            strain / LARGE_STRAIN,
            "the law of the material is linear" if strain > LARGE_STRAIN else "",
        )
    bend = max((curvature * thickness).max(), at_edges.bend_of_layers().max())
    if bend == 0.0:
        return
    yield Figure(
        where,
        "curvature × thickness up to",
        f"{bend:.2g}",
        f"at most {THICK_CURVATURE:g}",
        bend / THICK_CURVATURE,
        "it is no thin rod" if bend > THICK_CURVATURE else "",
    )
    ratio = width**2 * curvature / thickness
    least, most = PLATE_RANGE
    between = ratio[(ratio >= least) & (ratio <= most)]
    told = float((between if len(between) else ratio).max())
    yield Figure(
        where,
        "w²κ/H up to",
        f"{told:.2g}",
        f"below {least:g} or above {most:g}",
        min(told / least, most / told),
        "between beam and plate an experiment may be up to 1/(1−ν²) stiffer and its swelling curvature 1+ν higher than "
        "computed, and agreement within 30 % means nothing"
        if len(between)
        else "",
    )


def _of_barrier(name: str, thin: float, distance: float) -> Figure:
    """Return the figure of the barrier distance; rod `name` has the least thickness, `thin` [m]."""
    return Figure(
        "contact.barrier_distance",
        f"{1e3 * distance:g} mm is",
        f"{distance / thin:.2g} of the least thickness, that of rods.{name}",
        f"at most {FAR:g}",
        distance / (FAR * thin),
        "surfaces float visibly apart; 0.1 to 0.2 mm is closer" if distance > FAR * thin else "",
    )


def longest_edge(scene: SceneConfig, rod: Rod) -> float:
    """Length of edges between whose nodes nothing comes that is not small beside the rod [m]."""
    return COARSE * float(edge_figures(scene, rod).thickness.min() + scene.contact.barrier_distance)


def _of_edges(rod: Rod, longest: float) -> Figure:
    """Return the figure of the edge length of a rod, which should be at most `longest` [m]."""
    return Figure(
        f"rods.{rod.name}",
        "edge length",
        f"{1e3 * rod.edge_length:.3g} mm",
        f"at most {1e3 * longest:.3g} mm, {COARSE:g} times least thickness and barrier distance together",
        rod.edge_length / longest,
        "only nodes feel surfaces, and a small obstacle fits between them; more stations bring them closer"
        if rod.edge_length > longest
        else "",
    )


def _eigenstrain_range(scene: SceneConfig, rod: Rod, layer: Layer, laws: tuple[Eigenstrain, ...]) -> np.ndarray:
    """Largest magnitude, least and largest eigenstrain over the channels' ranges, shape (3, n_edge)."""
    found = np.zeros((3, rod.stations - 1))
    for law in laws:
        channel = scene.stimuli[law.stimulus]
        least, most = np.sort(law.strain_at(np.array([channel.minimum, channel.maximum])))
        driven = rod.covered_parts(np.arange(rod.stations - 1), layer, law) > 0.0
        found[:, driven] += np.array([[max(abs(least), abs(most))], [least], [most]])
    return found


def edge_figures(scene: SceneConfig, rod: Rod) -> EdgeFigures:
    """Figures of a rod of a scene."""
    return scene.keep("edge figures", (rod,), lambda: EdgeFigures(scene, rod))


class EdgeFigures:
    """Figures of a rod at the middle of each of its edges; of several copies, those of the one with the most.

    Attributes
    ----------
    width, thickness : ndarray
        Of the whole section [m], shape (n_edge,).
    eigenstrain : ndarray
        Largest magnitude in each layer over its channels' ranges, shape (n_layer, n_edge).
    eigenstrain_range : ndarray
        Least and largest, likewise, shape (2, n_layer, n_edge).
    """

    def __init__(self, scene: SceneConfig, rod: Rod):
        stations = np.arange(rod.stations - 1) + 0.5
        self.width, self._layers = outline(rod, stations)
        self._moduli = np.zeros_like(self._layers)
        self.eigenstrain = np.zeros_like(self._layers)
        self.eigenstrain_range = np.zeros((2, *self._layers.shape))
        for index, layer in enumerate(rod.layers):
            stiffness = values_at(layer.stiffness, rod.edge_length * stations)
            self._moduli[index] = stiffness * scene.materials[layer.material].youngs_modulus
            of_copies = dict.fromkeys(tuple(variant.layers[index].eigenstrain) for variant in rod.variants)
            ranges = np.array([_eigenstrain_range(scene, rod, layer, laws) for laws in of_copies])
            self.eigenstrain[index] = ranges[:, 0].max(axis=0)
            self.eigenstrain_range[:, index] = ranges[:, 1].min(axis=0), ranges[:, 2].max(axis=0)
        self.thickness = self._layers.sum(axis=0)
        along = rod.edge_length * stations
        self._path = rod.curvatures_at(along)[:, 0]
        self._natural = np.array(
            [
                self._path if layer.natural_curvature is None else values_at(layer.natural_curvature, along)
                for layer in rod.layers
            ]
        )

    def curvature(self) -> np.ndarray:
        """Largest curvature without loads [1/m], shape (n_edge,): that of the path, or that to which the layers'
        natural curvatures bend it, together with what eigenstrains add at most.
        """
        return np.maximum(np.abs(self._path), np.abs(self._path + self.natural_change())) + self.free_curvature()

    def bend_of_layers(self) -> np.ndarray:
        """Natural curvature times thickness of each layer by itself, shape (n_layer, n_edge)."""
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

    def free_curvature(self) -> np.ndarray:
        """Return the most that eigenstrains add to the curvature without loads [1/m], shape (n_edge,).

        It follows Timoshenko's formula, and is 0 where there is one layer.
        """
        curvature = np.zeros(len(self.width))
        both = (self._layers > 0.0).all(axis=0) & (len(self._layers) == 2)
        if both.any():
            (bottom, top), moduli = self._layers[:, both], self._moduli[:, both]
            m, n = moduli[0] / moduli[1], bottom / top
            shape = 6.0 * (1.0 + n) ** 2 / (3.0 * (1.0 + n) ** 2 + (1.0 + m * n) * (n**2 + 1.0 / (m * n)))
            curvature[both] = shape * self.eigenstrain[:, both].sum(axis=0) / (bottom + top)
        return curvature
