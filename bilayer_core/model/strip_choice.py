"""Which section a rod has, a beam's or a strip's, and by how much the two differ at rest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bilayer_core.model.edge_figures import EdgeFigures, edge_figures
from bilayer_core.model.plate_strip import curved_stiffness, folds, swollen_curvature
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.profile import Profile
from bilayer_core.scene.rod import Rod

MOST = 0.01
"""Of curvature or stiffness at rest: difference from a beam above which `section: auto` is a strip."""
BROADEST = 100.0
"""w²κ/H up to which strips are asked whether they fold."""
BISECTIONS = 20


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


def departure(rod: Rod, at_edges: EdgeFigures) -> Departure:
    """Return by how much a strip with the figures of a rod differs from a beam."""
    curvature, poisson = at_edges.curvature(), at_edges.poisson_ratio
    ratio = at_edges.width**2 * curvature / at_edges.thickness
    swells = at_edges.free_curvature() > 0.5 * curvature
    if all(layer.swelling == "along" for layer in rod.layers if layer.eigenstrain):
        swells[:] = False
    change, swollen = 0.0, 0.0
    if swells.any():
        changes = swollen_curvature(ratio[swells], poisson) - 1.0
        worst = int(np.abs(changes).argmax())
        change, swollen = float(changes[worst]), float(ratio[swells][worst])
    curved = float(ratio[~swells].max(initial=0.0))
    return Departure(change, swollen, float(curved_stiffness(curved, poisson)) - 1.0 if curved else 0.0, curved)


def refusal(scene: SceneConfig, rod: Rod) -> str:
    """Return why a rod of the laminate cannot be a strip; empty if it can."""
    ratios = sorted({scene.materials[layer.material].poisson_ratio for layer in rod.layers})
    if len(ratios) > 1:
        told = " and ".join(f"{ratio:g}" for ratio in ratios)
        return f"needs layers with one poisson_ratio, has {told}: unlike ones curl across by themselves"
    for layer in rod.layers:
        if layer.interval is not None:
            return f"needs layers that cover all of it, and {layer.name} has an `interval`"
        if layer.natural_twist != 0.0:
            return f"takes its twist from its path, and {layer.name} has a `natural_twist`"
        for key in ("thickness", "stiffness"):
            if isinstance(getattr(layer, key), Profile):
                return f"needs one {key} all along it, and that of {layer.name} is a profile"
    return ""


def section_of(scene: SceneConfig, rod: Rod) -> str:
    """Return the section of a rod in the laminate, `beam` or `strip`; `auto` is a strip where that differs from a beam
    by more than `MOST` and can be computed.
    """
    if rod.section != "auto":
        return rod.section
    found = departure(rod, edge_figures(scene, rod))
    return "strip" if max(abs(found.of_curvature), found.of_stiffness) > MOST and not refusal(scene, rod) else "beam"


@lru_cache(maxsize=32)
def folding_ratio(poisson: float) -> float:
    """Return w²κ̄/H from which on strips that swell alike in all directions have negative tangents; infinite if none
    has.
    """
    low, high = 0.0, BROADEST
    if not folds(high, poisson):
        return np.inf
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if folds(middle, poisson) else (middle, high)
    return high
