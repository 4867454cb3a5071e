"""Refusal of scenes whose rods start in each other."""

from __future__ import annotations

import numpy as np

from ..contact.segment import facing_contacts
from ..errors import PenetrationError
from .model import Model
from .rod_surfaces import NearPairs


def refuse_meeting_rods(model: Model) -> None:
    """Refuse a scene whose rods start in each other.

    Raises
    ------
    PenetrationError
        It names two places, and by how much they overlap.
    """
    surfaces = model.rod_surfaces
    if surfaces is None:
        return
    position = np.array(model.start_position)
    pairs = NearPairs(surfaces, model.edge_node)
    pairs.find(position, position, model.scene.contact.barrier_distance, 0.0)
    if pairs.count == 0:
        return
    room = 2 * pairs.count
    point, edge, times = (np.empty(room, dtype=np.int64) for _ in range(3))
    fraction, gap, inner = np.empty(room), np.empty(room), np.empty(room, dtype=bool)
    found, _, _ = facing_contacts(
        position,
        pairs.count,
        *pairs.outputs,
        0.0,
        model.edge_node,
        surfaces.edge_radius,
        surfaces.point_edge,
        surfaces.point_fraction,
        0.0,
        point,
        edge,
        fraction,
        inner,
        times,
        gap,
    )
    worst = int(np.argmin(gap[:found]))
    places = [_place(model, surfaces.point_edge[point[worst]], surfaces.point_fraction[point[worst]])]
    places.append(_place(model, edge[worst], fraction[worst]))
    raise PenetrationError(
        f"{model.scene.name}: the scene starts in penetration: "
        f"{places[0]} is {-1e3 * gap[worst]:.4g} mm inside {places[1]}"
        "; all gaps must be positive at the start (contact.rods: false lets rods pass through each other)"
    )


def _place(model: Model, edge: int, fraction: float) -> str:
    """What a point of an edge is called in messages."""
    strand = next(s for s in model.strands if s.first_edge <= edge < s.first_edge + s.node_count - 1)
    return f"node {edge - strand.first_edge + int(round(fraction))} of {strand.name}"
