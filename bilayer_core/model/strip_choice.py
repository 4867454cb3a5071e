"""Which section a rod has, a beam's or a strip's, and by how much the two differ at rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bilayer_core.model.edge_figures import EdgeFigures, edge_figures
from bilayer_core.model.findings import Figure
from bilayer_core.model.plate_section import PlateSection, is_plate, plate_section
from bilayer_core.model.plate_strip import StripLaw, folding_ratio
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import strains_at
from bilayer_core.scene.profile import Profile
from bilayer_core.scene.rod import Rod

MOST = 0.01
"""Of curvature or stiffness at rest: difference from a beam above which `section: auto` is a strip."""
PLATE = 0.05
"""Likewise above which a beam is told to be wrong."""
THIN = 2.0
"""Width over thickness from which on layers of unlike Poisson's ratios hold each other across, as plates do."""
HELD = 0.2
"""Part of a strip within one width from its clamps that counts."""


@dataclass(frozen=True)
class Departure:
    """Difference of a strip from a beam, at the edge where it is largest.

    Attributes
    ----------
    of_curvature, swollen : float
        Of the curvature at rest of edges that swell alike in all directions, as a part of the beam's; their w²κ/H.
    of_stiffness, curved : float
        Likewise of the bending stiffness of edges that are curved by their path, or that swell along it alone.
    """

    of_curvature: float
    swollen: float
    of_stiffness: float
    curved: float


def law_of(scene: SceneConfig, rod: Rod) -> StripLaw:
    """Return the law of a strip with the section of a rod, bent to the side to which it swells."""
    plate = plate_section(scene, rod)
    return plate.bent(_swells_to(scene, rod, plate)[0] >= 0.0)


def _swells_to(scene: SceneConfig, rod: Rod, plate: PlateSection) -> tuple[float, float, float]:
    """Return the curvature and twist to which layers bring a narrow strip, all of which swell, and the largest
    curvature across to which some do [1/m].
    """
    found = np.zeros(3)
    for slot, layer in enumerate(rod.layers):
        natural = plate.natural(slot)
        for law in layer.eigenstrain:
            channel = scene.stimuli[law.stimulus]
            strain = max(strains_at(rod, layer, law, np.array([channel.minimum, channel.maximum])).ravel(), key=abs)
            found += strain * natural.along[0], strain * natural.twist[0], abs(strain * natural.across[0])
    return tuple(found.tolist())


def departure(scene: SceneConfig, rod: Rod, at_edges: EdgeFigures) -> Departure:
    """Return by how much a strip with the figures of a rod differs from a beam; nothing is said of one with fibres."""
    if any(layer.fibres for layer in rod.layers):
        return Departure(0.0, 0.0, 0.0, 0.0)
    curvature, law = at_edges.curvature(), law_of(scene, rod)
    ratio = at_edges.width**2 * curvature / at_edges.thickness
    swells = at_edges.free_curvature() > 0.5 * curvature
    if all(layer.swelling == "along" for layer in rod.layers if layer.eigenstrain):
        swells[:] = False
    change, swollen, stiffer, curl = 0.0, 0.0, 1.0, 1.0
    if is_plate(scene, rod) and (at_edges.width > THIN * at_edges.thickness).any():
        stiffer, curl = (float(plate_section(scene, rod).growth[part][0]) for part in (1, 3))
    if swells.any():
        ratios = curl * ratio[swells]
        changes = curl * law.curvature(ratios) - 1.0
        worst = int(np.abs(changes).argmax())
        change, swollen = float(changes[worst]), float(ratios[worst])
    curved = float(ratio[~swells].max(initial=0.0))
    of_stiffness = stiffer * float(law.stiffness(curved)) - 1.0 if curved else 0.0
    return Departure(change, swollen, of_stiffness, curved)


def refusal(scene: SceneConfig, rod: Rod) -> str:
    """Return why a rod of the laminate cannot be a strip; empty if it can."""
    if rod.radius is not None:
        return "needs a rectangular section, and it is round"
    if len({scene.materials[layer.material].retardation_time for layer in rod.layers}) > 1:
        return "needs layers with one retardation_time, since one curve relaxes at one rate"
    for layer in rod.layers:
        if rod.width_of(layer) != rod.width_of(rod.layers[0]):
            return "needs layers of one `width`, since a plate has one thickness across it"
        if layer.natural_twist != rod.layers[0].natural_twist:
            return "needs layers with one `natural_twist`: the borders of unlike ones are unlike in length"
    return ""


def section_of(scene: SceneConfig, rod: Rod, model: str = "laminate") -> str:
    """Return the section of a rod in a model, `beam` or `strip`; `auto` is a strip where a beam does not feel what
    layers have, and in the laminate where a strip differs from it by more than `MOST` and can be computed.
    """
    if rod.section != "auto":
        return rod.section
    if rod.feels_across:
        return "strip"
    if model == "two_rod" or rod.radius is not None:
        return "beam"
    found = departure(scene, rod, edge_figures(scene, rod))
    return (
        "strip" if max(abs(found.of_curvature), abs(found.of_stiffness)) > MOST and not refusal(scene, rod) else "beam"
    )


def plate_of(scene: SceneConfig, rod: Rod) -> PlateSection | None:
    """Return the section of a rod of the laminate if it is that of a laminated plate."""
    return plate_section(scene, rod) if is_plate(scene, rod) and section_of(scene, rod) == "strip" else None


def plates(scene: SceneConfig, model: str) -> Iterator[Figure]:
    """Yield how strips as wide as the rods of a scene differ from beams."""
    for rod in scene.rods:
        yield from plate_figures(scene, rod, edge_figures(scene, rod), model)


def plate_figures(scene: SceneConfig, rod: Rod, at_edges: EdgeFigures, model: str) -> Iterator[Figure]:
    """Yield how a strip as wide as a rod differs from a beam in a model, and, of a strip, when it may fold and how high
    its section rises.
    """
    if rod.radius is not None:
        return
    where, found, strip = f"rods.{rod.name}", departure(scene, rod, at_edges), section_of(scene, rod, model) == "strip"
    change, stiffer, told = found.of_curvature, found.of_stiffness, strip or rod.section == "beam"
    allowed = f"`section: {rod.section}`" if told else f"at most {100 * PLATE:g} %"
    if found.swollen > 0.0:
        why = refusal(scene, rod) or "takes the model laminate"
        outside = (
            f"its section bends as well; that of a beam does not, and a strip {why}; if its layers swell along it "
            "alone, give them `swelling: along`, or the rod `section: beam`, if a beam is meant"
        )
        yield Figure(
            where,
            f"a {'strip' if strip else 'plate'} as wide, swelling alike in all directions, "
            f"{'curls' if strip else 'would curl'}",
            f"{100 * abs(change):.2g} % {'less' if change < 0.0 else 'more'} than "
            f"{'a beam' if strip else 'computed'} (w²κ/H {found.swollen:.2g})",
            allowed,
            abs(change) / PLATE,
            outside if abs(change) > PLATE and not told else "",
        )
    if found.curved > 0.0:
        yield Figure(
            where,
            f"a {'strip' if strip else 'plate'} as wide and curved {'is' if strip else 'would be'} "
            "stiffer in bending by",
            f"{100 * stiffer:.2g} % (w²κ/H {found.curved:.2g})",
            allowed,
            stiffer / PLATE,
            "its section keeps its shape; that of a beam bends freely" if stiffer > PLATE and not told else "",
        )
    plate = plate_of(scene, rod) if strip else None
    if plate is not None and any(layer.fibres for layer in rod.layers):
        yield from _of_fibres(where, scene, rod, at_edges, plate)
    if not strip:
        return
    if found.swollen > 0.0:
        yield _of_folds(where, at_edges, found.swollen, folding_ratio(law_of(scene, rod)))
    if scene.contact is not None:
        yield from _of_height(where, scene, rod, at_edges, found.swollen)
    held = sum(bool(end) for end in (rod.clamp_start, rod.clamp_end)) * float(at_edges.width.max()) / rod.path.length
    if held > HELD:
        yield Figure(
            where,
            "within one width from clamps, which keep its section flat, is",
            f"{100 * held:.2g} % of it",
            f"at most {100 * HELD:g} %",
            held / HELD,
            "a strip curls across up to its clamps",
        )


def _of_fibres(
    where: str, scene: SceneConfig, rod: Rod, at_edges: EdgeFigures, plate: PlateSection
) -> Iterator[Figure]:
    """Yield to what layers with fibres bend and twist a narrow strip, and what part of its stiffness is left out."""
    bend, twist, _ = _swells_to(scene, rod, plate)
    held, pulled = rod.clamp_start and rod.clamp_end, abs(float(plate.pulled[0]))
    size = bend**2 + twist**2
    if size > 0.0:
        ratio = float((at_edges.width**2 / at_edges.thickness).max()) * size**0.5
        vary = any(layer.fibres and isinstance(layer.fibres.angle, Profile) for layer in rod.layers)
        most = "in its middle" if vary else "at most"
        helix = f"radius {1e3 * abs(bend) / size:.3g} mm and pitch {2e3 * np.pi * abs(twist) / size:.3g} mm"
        yield Figure(
            where,
            "its fibres bend and twist it, where it is narrow, to",
            f"{bend:.3g} and {twist:.3g} 1/m {most} (w²κ/H {ratio:.2g})",
            f"a helix of {helix}",
            0.0,
        )
    yield Figure(
        where,
        "a pull along it would twist it as well, which is left out:",
        f"{100 * pulled:.2g} % of the mean of both stiffnesses",
        f"at most {100 * PLATE:g} %, or an end that is free",
        pulled / PLATE,
        "curvature and twist are those without a pull" if held and pulled > PLATE else "",
    )


def _of_folds(where: str, at_edges: EdgeFigures, ratio: float, limit: float) -> Figure:
    strain = f" (an eigenstrain of {100 * float(at_edges.eigenstrain.max()) * limit / ratio:.3g} %)"
    return Figure(
        where,
        "as a strip it swells up to w²κ/H of",
        f"{ratio:.3g}",
        f"at most {limit:.3g}{strain if ratio > limit else ''}",
        ratio / limit,
        "beyond, held straighter it may fold in one place, as a tape spring does, where a run stops"
        if ratio > limit
        else "",
    )


def _of_height(where: str, scene: SceneConfig, rod: Rod, at_edges: EdgeFigures, ratio: float) -> Iterator[Figure]:
    """Yield the height of a section, κ_y w²/8, of that in which κ̄y is largest."""
    law, distance = law_of(scene, rod), scene.contact.barrier_distance
    curvature = at_edges.free_curvature(across=True)
    if is_plate(scene, rod):
        curvature[:] = _swells_to(scene, rod, plate_section(scene, rod))[2]
    free = float((curvature * at_edges.width**2).max()) / 8.0
    if 0.0 < ratio <= folding_ratio(law):  # beyond it may roll up across, where κ̄y is all there is
        ratios = np.linspace(0.0, ratio, 101)[1:]
        free *= float((law.curvature_across(ratios) * ratios).max()) / ratio
    if free > 0.0:
        yield Figure(
            where,
            "its section rises by",
            f"{1e3 * free:.3g} mm across",
            f"at most {1e3 * distance:g} mm, the barrier distance",
            free / distance,
            "contact takes it as flat across" if free > distance else "",
        )
