"""Where the validity of a rod model ends."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np

from bilayer_core.contact.near import SAG
from bilayer_core.model.diffusion_times import diffusion_figures
from bilayer_core.model.findings import Figure
from bilayer_core.model.plate_strip import curved_stiffness, folds, swollen_curvature
from bilayer_core.model.points_between import demand_of, spacing
from bilayer_core.model.section import outline
from bilayer_core.model.shape_numbers import shape_of
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import strain_at
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.profile import values_at
from bilayer_core.scene.rod import Layer, Rod

LARGE_STRAIN = 0.1  # linear elasticity and the rectangular section lose meaning
SLENDER = 5.0  # least length over width
THICK_CURVATURE = 0.2  # curvature × thickness
PLATE = 0.05  # of curvature or stiffness, that of a plate beside the computed one
SHEAR = 0.01  # of the deflection under a load across
FAR = 0.5  # barrier distance over thickness
COARSE = 2.0  # edge length over thickness and barrier distance, where something went through an edge
GAUSS_POINTS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(3)  # exact for the squares of parabolas


def validity_warnings(scene: SceneConfig) -> Iterator[Figure]:
    """Return the figures that are out of their range, each with the range and what that means."""
    return (figure for figure in validity_figures(scene) if figure.outside)


def validity_figures(scene: SceneConfig) -> Iterator[Figure]:
    """Yield all figures of a scene on which the validity of the model depends."""
    thinnest = {}
    for rod in scene.rods:
        at_edges = edge_figures(scene, rod)
        thinnest[rod.name] = at_edges.thickness.min()
        yield from _of_section(rod, at_edges)
        yield from diffusion_figures(scene, rod)
        if scene.contact is not None:
            yield from _of_points(scene, rod, at_edges)
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
    yield from _of_shear(rod, at_edges)
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
    yield from _of_plate(where, at_edges, curvature)


def _of_plate(where: str, at_edges: EdgeFigures, curvature: np.ndarray) -> Iterator[Figure]:
    """Return what a plate of the width of a rod would do otherwise (`plate_strip`)."""
    poisson, ratio = at_edges.poisson_ratio, at_edges.width**2 * curvature / at_edges.thickness
    swells = at_edges.free_curvature() > 0.5 * curvature
    if swells.any():
        change = swollen_curvature(ratio[swells], poisson) - 1.0
        worst = int(np.abs(change).argmax())
        off, at = abs(float(change[worst])), float(ratio[swells][worst])
        outside = (
            "its section bends as well; that of a beam does not. Layers that swell along the strip alone curl it as "
            "computed"
        )
        if folds(at, poisson):
            outside += "; held straighter it may fold in one place, as a tape spring does"
        yield Figure(
            where,
            "a plate as wide, swelling alike in all directions, would curl",
            f"{100 * off:.2g} % {'less' if change[worst] < 0.0 else 'more'} than computed (w²κ/H {at:.2g})",
            f"at most {100 * PLATE:g} %",
            off / PLATE,
            outside if off > PLATE or folds(at, poisson) else "",
        )
    at = float(ratio[~swells].max(initial=0.0))
    if at > 0.0:
        off = float(curved_stiffness(at, poisson)) - 1.0
        yield Figure(
            where,
            "a plate as wide and curved would be stiffer in bending by",
            f"{100 * off:.2g} % (w²κ/H {at:.2g})",
            f"at most {100 * PLATE:g} %",
            off / PLATE,
            "its section keeps its shape; that of a beam bends freely" if off > PLATE else "",
        )


def _of_shear(rod: Rod, at_edges: EdgeFigures) -> Iterator[Figure]:
    """Return the share of shear in the deflection of a rod under a load across, if it is to be named.

    Of a cantilever with a load at its end it is 3 D c/L², D the bending stiffness and c the deflection by shear per
    force and length; a rod whose two ends are held is four of them in a row under a load in its middle.
    """
    length = rod.path.length * (0.25 if rod.clamp_start and rod.clamp_end else 1.0)
    share = float((3.0 * at_edges.shear_over_bending() / length**2).max())
    share /= 1.0 + share
    if share >= SHEAR:
        yield Figure(
            f"rods.{rod.name}",
            "shear makes",
            f"{100 * share:.2g} % of the deflection under a load across",
            f"below {100 * SHEAR:g} %",
            share / SHEAR,
            "a rod does not shear, so it is computed that much too stiff",
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
    """Return the length of edges between whose nodes nothing comes that is not small beside the rod [m]."""
    return COARSE * float(edge_figures(scene, rod).thickness.min() + scene.contact.barrier_distance)


def bend_of(scene: SceneConfig, rod: Rod) -> float:
    """Return the least radius to which a rod bends between stations so that a plane comes nearer there than at them by
    more than the part `SAG` of the barrier distance [m], −1 if it does not.

    An edge of length l that is bent by κ sags by ⅛ κ l². The curvature is the largest without loads.
    """
    deepest = 8.0 * SAG * (scene.contact.barrier_distance if scene.contact else inf)
    curvature = edge_figures(scene, rod).curvature()
    largest = float(curvature[curvature * rod.edge_length**2 > deepest].max(initial=0.0))
    return 1.0 / largest if largest > 0.0 else -1.0


def _of_points(scene: SceneConfig, rod: Rod, at_edges: EdgeFigures) -> Iterator[Figure]:
    """Return how far apart a rod's contact points are for the surface that may sink deepest between them."""
    shaped = [(body.name, body.surface) for body in scene.bodies if body.surface is not None]
    shaped += [(obstacle.name, obstacle) for obstacle in scene.obstacles]
    radius, distance, worst = 0.5 * float(at_edges.thickness.min()), scene.contact.barrier_distance, None
    area, bend = float(at_edges.width.max()) * rod.path.length, bend_of(scene, rod)
    for name, surface in shaped:
        demand = demand_of(shape_of(surface), area, bend)
        if demand[0] < 0.0:  # a plane that meets stations
            continue
        apart = spacing(demand, radius, distance)
        sag = apart**2 / (4.0 * (demand[0] + radius))
        if worst is None or sag > worst[0]:
            worst = sag, apart, name
    if worst is not None:
        sag, apart, name = worst
        yield Figure(
            f"rods.{rod.name}",
            f"contact points that meet {name} are at most",
            f"{1e3 * apart:.2g} mm apart, between which it sinks by {1e3 * sag:.2g} mm",
            f"at most {1e3 * distance:g} mm, the barrier distance",
            sag / distance,
            "its edges come into the rod between them: round them, or make its faces smaller" if sag > distance else "",
        )


def _eigenstrain_range(scene: SceneConfig, rod: Rod, layer: Layer, laws: tuple[Eigenstrain, ...]) -> np.ndarray:
    """Return the largest magnitude, least and largest eigenstrain over the channels' ranges, shape (3, n_edge)."""
    found = np.zeros((3, rod.stations - 1))
    for law in laws:
        channel = scene.stimuli[law.stimulus]
        least, most = np.sort(strain_at(rod, layer, law, np.array([channel.minimum, channel.maximum])))
        driven = rod.covered_parts(np.arange(rod.stations - 1), layer, law) > 0.0
        found[:, driven] += np.array([[max(abs(least), abs(most))], [least], [most]])
    return found


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
        Largest magnitude in each layer over its channels' ranges, shape (n_layer, n_edge).
    eigenstrain_range : ndarray
        Least and largest, likewise, shape (2, n_layer, n_edge).
    poisson_ratio : float
        Of its layers, mean by thickness.
    """

    def __init__(self, scene: SceneConfig, rod: Rod):
        stations = np.arange(rod.stations - 1) + 0.5
        self.width, self._layers = outline(rod, stations)
        self._hole = None  # inner over outer radius of round sections
        if rod.radius is not None:
            self._hole = 2.0 * values_at(rod.inner_radius, rod.edge_length * stations) / self.width
        self._moduli, self._shear_moduli = np.zeros_like(self._layers), np.zeros_like(self._layers)
        self.eigenstrain = np.zeros_like(self._layers)
        self.eigenstrain_range = np.zeros((2, *self._layers.shape))
        for index, layer in enumerate(rod.layers):
            stiffness = values_at(layer.stiffness, rod.edge_length * stations)
            material = scene.materials[layer.material]
            self._moduli[index] = stiffness * material.youngs_modulus
            self._shear_moduli[index] = self._moduli[index] / (2.0 * (1.0 + material.poisson_ratio))
            of_copies = dict.fromkeys(tuple(variant.layers[index].eigenstrain) for variant in rod.variants)
            ranges = np.array([_eigenstrain_range(scene, rod, layer, laws) for laws in of_copies])
            self.eigenstrain[index] = ranges[:, 0].max(axis=0)
            self.eigenstrain_range[:, index] = ranges[:, 1].min(axis=0), ranges[:, 2].max(axis=0)
        self.thickness = self._layers.sum(axis=0)
        ratios = np.array([scene.materials[layer.material].poisson_ratio for layer in rod.layers])
        self.poisson_ratio = float(ratios @ self._layers.sum(axis=1) / self._layers.sum())
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

    def shear_over_bending(self) -> np.ndarray:
        """Return the bending stiffness times the deflection by shear per force and length [m²], shape (n_edge,).

        D c with c = w ∫ Q²/(G D²) dz and Q(z) = ∫ E z dz from the face to z, heights being over the neutral axis: a
        section's shear stress V Q/D, and its energy ½ c V². It is 6 EI/(5 GA) for one layer, and for a round one
        EI/(k GA) with Cowper's k = 6 (1 + ν)(1 + m²)²/((7 + 6ν)(1 + m²)² + (20 + 12ν) m²), m = r/R (1966).
        """
        if self._hole is not None:
            nu, m = self.poisson_ratio, self._hole
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
