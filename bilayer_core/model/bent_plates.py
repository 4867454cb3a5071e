"""How much stiffer a plate as wide as a beam would be, when loads bend the beam during a run.

A plate that is bent flattens across, the more so the larger w²κ/H, and is stiffer for it by up to ν²/(1 − ν²)
(`StripLaw.bent_stiffness`). Before a run nobody knows how far loads will bend a rod.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.model.bend_faces import whole_section
from bilayer_core.model.edge_figures import edge_figures
from bilayer_core.model.model import Model
from bilayer_core.model.plate_strip import stiff_ratio
from bilayer_core.model.strip_choice import PLATE, law_of, refusal
from bilayer_core.scene.rod import Rod

Array = np.ndarray
BENT_PLATE = (
    f"loads bend a rod so far that a plate as wide would be {100 * PLATE:g} % stiffer: its section bends as well"
)


def _rods(model: Model) -> dict[str, Rod]:
    """Return the rod of the scene of each copy that is judged: no strip, not round, and no beam by choice."""
    of_copies = {copy.name: rod for rod in model.scene.rods for copy in rod.copies if rod.section != "beam"}
    return {strand.rod: of_copies.get(strand.rod) for strand in model.strands if not (strand.strip or strand.round)}


def _limit(model: Model, rod: Rod) -> float:
    return stiff_ratio(law_of(model.scene, rod), PLATE)


def plates_of_bends(model: Model) -> tuple[Array, Array]:
    """Return how the curvature by loads of each bend is judged.

    Returns
    -------
    plate : ndarray
        By which that curvature makes 1 where a plate would be stiffer by `PLATE`; 0 where it is not judged [m], shape
        (n_bend,).
    free : ndarray
        Curvature beyond the rest of a strand that swelling makes by itself, since it strains two strands; 0 where that
        is part of the rest [1/m], likewise.
    """
    (width, thickness), rods = whole_section(model), _rods(model)
    limit, free = np.full(model.node_count, np.inf), np.zeros(model.node_count)
    for strand in model.strands:
        if rod := rods.get(strand.rod):
            own = slice(strand.first_node, strand.first_node + strand.node_count)
            limit[own] = _limit(model, rod)
            if model.bonds.exists:
                figures = edge_figures(model.scene, rod)
                free[own] = (figures.free_curvature() + np.abs(figures.natural_change())).max()
    node = model.joint_node[: model.rods.bend_count]
    return (width**2 / thickness / limit)[node], free[node]


def bent_plate(model: Model, kind: str, times_limit: float, joint: int) -> str:
    """Return what is wrong with the beam of a joint, in a kind of model, that loads bent to so many times its limit."""
    node = model.joint_node[joint]
    (name,) = (s.rod for s in model.strands if s.first_node <= node < s.first_node + s.node_count)
    rod = _rods(model)[name]
    ratio = times_limit * _limit(model, rod)
    stiffer = float(law_of(model.scene, rod).bent_stiffness(ratio)) - 1.0
    cure = "takes the model laminate" if kind == "two_rod" else "can be had by `section: strip`"
    why = refusal(model.scene, rod) or cure
    return (
        f"rods.{name}: loads bend it to w²κ/H {ratio:.2g}, where a plate as wide is stiffer by {100 * stiffer:.2g} % "
        f"(at most {100 * PLATE:g} %): its section bends as well; that of a beam does not, and a strip {why}; "
        "`section: beam` says that a beam is meant"
    )
