"""Where the nodes and edges of a layer stand among all of them.

A strand without ends, of a closed rod of N edges, is one with ends in memory: after its nodes 0 … N − 1 come copies
of the first two, N and N + 1, and after its edges a copy of the first, N. So every joint, at the nodes 1 … N, lies
between two edges that follow each other, and no force needs to know that the strand is closed. Of what is there twice
only one has mass, stiffness and contact: nodes 1 … N and edges 0 … N − 1. That copies move as what they are copies of
is left to the Newton matrix (`engine.linear.closed_rods`); they begin alike, take the same steps and stay so bit for
bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.model.unknown_order import ReadOnlyArrays

Array = np.ndarray


@dataclass(frozen=True)
class StrandArrays(ReadOnlyArrays):
    """One layer of one rod, or all of them: where its nodes and edges stand."""

    name: str
    rod: str
    layer: str
    first_station: int
    first_node: int
    node_count: int
    first_edge: int
    width: Array  # at its nodes [m], shape (node_count,)
    thickness: Array  # likewise
    offset: Array  # of the middle between its faces from its nodes, along m1 [m], likewise
    curvature: Array  # of its nodes' curve at the start [1/m], likewise
    closed: bool = False  # whether its last two nodes, and its last edge, are copies of the first
    round: bool = False  # whether its sections are
    strip: bool = False  # whether its sections bend
    layers: tuple[StrandArrays, ...] = ()  # of a strand that stands for several: each on those nodes where it is

    @property
    def shown(self) -> int:
        """Number of its nodes from the first to the last, which are at one place if it is closed: those that are drawn,
        and of which the edges between them are.
        """
        return self.node_count - int(self.closed)

    @property
    def last_node(self) -> int:
        """Node at its end, or where it closes."""
        return self.first_node + self.shown - 1
