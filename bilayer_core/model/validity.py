"""Where the validity of a rod model ends."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from bilayer_core.contact.between_stations import SAG
from bilayer_core.model.diffusion_times import diffusion_figures
from bilayer_core.model.edge_figures import EdgeFigures, edge_figures
from bilayer_core.model.findings import Figure
from bilayer_core.model.strip_choice import plate_figures
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.profile import extremes
from bilayer_core.scene.rod import Rod

LARGE_STRAIN = 0.1  # linear elasticity and the rectangular section lose meaning
SLENDER = 5.0  # least length over width
THICK_CURVATURE = 0.2  # curvature × thickness
SHEAR = 0.01  # of the deflection under a load across
FAR = 0.5  # barrier distance over thickness
COARSE = 2.0  # edge length over thickness and barrier distance, where something went through an edge


def validity_warnings(scene: SceneConfig, model: str = "laminate") -> Iterator[Figure]:
    """Return the figures that are out of their range, each with the range and what that means."""
    return (figure for figure in validity_figures(scene, model) if figure.outside)


def validity_figures(scene: SceneConfig, model: str = "laminate") -> Iterator[Figure]:
    """Yield all figures of a scene on which the validity of the model depends."""
    thinnest = {}
    for rod in scene.rods:
        at_edges = edge_figures(scene, rod)
        thinnest[rod.name] = at_edges.thickness.min()
        yield from _of_section(scene, rod, at_edges)
        yield from plate_figures(scene, rod, at_edges, model)
        yield from diffusion_figures(scene, rod)
    if scene.contact is not None:
        if model == "laminate":
            yield from _of_widths(scene)
        yield _of_barrier(*min(thinnest.items(), key=lambda item: item[1]), scene.contact.barrier_distance)


def _of_section(scene: SceneConfig, rod: Rod, at_edges: EdgeFigures) -> Iterator[Figure]:
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
    if bend > 0.0:
        yield Figure(
            where,
            "curvature × thickness up to",
            f"{bend:.2g}",
            f"at most {THICK_CURVATURE:g}",
            bend / THICK_CURVATURE,
            "it is no thin rod" if bend > THICK_CURVATURE else "",
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


def _of_widths(scene: SceneConfig) -> Iterator[Figure]:
    """Yield the figures of rods whose layers are of unlike width, which contact of a laminate does not see."""
    for rod in scene.rods:
        widths = [extremes(rod.width_of(layer)) for layer in rod.layers]
        least, most = min(width[0] for width in widths), max(width[1] for width in widths)
        beyond, distance = 0.5 * (most - least), scene.contact.barrier_distance
        if any(layer.width is not None for layer in rod.layers) and beyond > distance:
            yield Figure(
                f"rods.{rod.name}.layers",
                "are",
                f"{1e3 * least:.3g} to {1e3 * most:.3g} mm wide",
                "alike within twice the barrier distance",
                beyond / distance,
                "contact takes them as one rectangle as wide as the widest; two_rod takes the width of each",
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
