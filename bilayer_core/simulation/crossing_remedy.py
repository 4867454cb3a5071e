"""Which edge goes through which surface, and how many stations keep it from that (`contact.crossing`)."""

from __future__ import annotations

import math

from bilayer_core.errors import Remedy
from bilayer_core.model.model import Model
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.model.validity import longest_edge

FINER = 2
"""Times as many edges as went through something, at least."""


def crossing(model: Model, number: int) -> str:
    """Describe which edge goes through which surface, by a number from `contact.crossing.crossing`."""
    surface, edge = divmod(number, model.rods.edge_count)
    return f"edge {edge_of_strand(model, edge)} goes through {model.surface_names[surface]} between its nodes"


def edge_of_strand(model: Model, edge: int) -> str:
    """Return an edge's number within its strand, and the strand, as text."""
    strand = _strand_of(model, edge)
    return f"{edge - strand.first_edge} of {strand.name}"


def _strand_of(model: Model, edge: int) -> StrandArrays:
    return next(s for s in reversed(model.strands) if s.first_edge <= edge)


def more_stations(model: Model, number: int) -> Remedy:
    """Return the remedy to use so many stations that small obstacles do not fit between them."""
    strand = _strand_of(model, number % model.rods.edge_count)
    rod = next(rod for rod in model.scene.rods if strand.rod in rod.copy_names)
    edges = max(FINER * (rod.stations - 1), math.ceil(rod.path.length / longest_edge(model.scene, rod)))
    key = f"rods.{rod.name}.stations"
    return Remedy(
        f"set `{key}` to {edges + 1}: what went through it is sharper than its contact points are dense",
        {key: str(edges + 1)},
    )
