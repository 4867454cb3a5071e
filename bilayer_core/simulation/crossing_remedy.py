"""Which edge goes through which surface, and how many stations keep it from that (`contact.crossing`)."""

from __future__ import annotations

import math

from bilayer_core.errors import Remedy
from bilayer_core.model.model import Model
from bilayer_core.model.validity import longest_edge

FINER = 2
"""Times as many edges as went through something, at least."""


def crossed(model: Model, number: int) -> tuple[int, str]:
    """Return the edge, and the name of the surface, of a number from `contact.crossing.crossing`."""
    surface, edge = divmod(number, model.rods.edge_count)
    return edge, model.surface_names[surface]


def edge_of_strand(model: Model, edge: int) -> str:
    """Return an edge's number within its strand, and the strand, as text."""
    strand = next(s for s in reversed(model.strands) if s.first_edge <= edge)
    return f"{edge - strand.first_edge} of {strand.name}"


def more_stations(model: Model, number: int) -> Remedy:
    """Return the remedy to use so many stations that small obstacles do not fit between them."""
    edge, _ = crossed(model, number)
    strand = next(s for s in reversed(model.strands) if s.first_edge <= edge)
    rod = next(rod for rod in model.scene.rods if strand.rod in rod.copy_names)
    edges = max(FINER * (rod.stations - 1), math.ceil(rod.path.length / longest_edge(model.scene, rod)))
    key = f"rods.{rod.name}.stations"
    return Remedy(
        f"set `{key}` to {edges + 1}: what went through it is sharper than its contact points are dense",
        {key: str(edges + 1)},
    )
