"""Refusal of scenes whose rods start in each other."""

from __future__ import annotations

import numpy as np

from bilayer_core.errors import PenetrationError
from bilayer_core.model.model import Model
from bilayer_core.model.rod_surfaces import NearPairs

MOST_SHOWN = 1_000_000
"""Of places that overlap: among how many the deepest is looked for."""


def refuse_meeting_rods(model: Model) -> None:
    """Refuse a scene whose rods start in each other.

    Raises
    ------
    PenetrationError
        It names two places, and by how much they overlap.
    """
    rods = model.rod_search
    if not rods.exists:
        return
    position = model.start_position
    pairs = NearPairs(rods)
    pairs.find(position, model.scene.contact.barrier_distance, 0.0, most=MOST_SHOWN)
    if pairs.count == 0:
        return
    point, edge = pairs.search.point[: pairs.count], pairs.search.edge[: pairs.count]
    own, i, j = rods.point_edge[point], rods.edge_node[rods.point_edge[point]], rods.edge_node[edge]
    s, along = rods.point_fraction[point][:, None], position[j + 1] - position[j]
    between = (1.0 - s) * position[i] + s * position[i + 1] - position[j]
    t = np.clip((between * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    gap = np.linalg.norm(between - t[:, None] * along, axis=1) - rods.edge_radius[own] - rods.edge_radius[edge]
    worst = int(np.argmin(gap))
    places = [_place(model, own[worst], s[worst, 0]), _place(model, edge[worst], t[worst])]
    raise PenetrationError(
        f"{model.scene.name}: the scene starts in penetration: "
        f"{places[0]} is {-1e3 * gap[worst]:.4g} mm inside {places[1]}"
        "; all gaps must be positive at the start (contact.rods: false lets rods pass through each other)"
    )


def _place(model: Model, edge: int, fraction: float) -> str:
    """Return the name of a point of an edge for messages."""
    strand = next(s for s in model.strands if s.first_edge <= edge < s.first_edge + s.node_count - 1)
    return f"node {edge - strand.first_edge + int(round(fraction))} of {strand.name}"
