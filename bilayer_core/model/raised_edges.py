"""Edges with something that acts off the curve: masses, loads, and what a fluid does (`forces.raised`)."""

from __future__ import annotations

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.blocks import blocks
from bilayer_core.model.records.parts import Raised
from bilayer_core.model.strands import Collected

Array = np.ndarray


def halves_at(found: Collected, nodes: Array) -> tuple[Array, Array, Array]:
    """Return the edges before and after nodes, which half of each is at the node, and its part of what is at the node.

    Shapes (n_node, 2); at an end, the second of them has no part.
    """
    edges, edge_node = found.column("node_edges", np.int64, 2)[nodes], found.column("edge_node", np.int64)
    part = np.full(edges.shape, 0.5)
    part[edges[:, 0] == edges[:, 1]] = 1.0, 0.0
    return edges, (edge_node[edges] != nodes[:, None]).astype(np.int64), part


def directions_at(found: Collected, nodes: Array) -> tuple[Array, Array]:
    """Return two edges at nodes, and the parts of which directions there are mixed, shapes (n_node, 2): the mean of the
    edges before and after; at an end half an edge on from the last, as it is from the one beside that to it.
    """
    edges, _, parts = halves_at(found, nodes)
    edge_node = found.column("edge_node", np.int64)
    for own, part, node in zip(edges, parts, nodes, strict=True):
        if own[0] == own[1]:
            beside = own[0] + (1 if edge_node[own[0]] == node else -1)
            if 0 <= beside < len(edge_node) and abs(edge_node[beside] - edge_node[own[0]]) == 1:
                own[1], part[:] = beside, (1.5, -0.5)
    return edges, parts


def build_raised(found: Collected, loaded: Array, in_fluid: bool) -> tuple[Raised, Array, int]:
    """Return the record, absent where all acts on the curve, the number in it of each edge, −1 of the others, and how
    many directors states keep: those of all edges of which mass, path or middle are off the curve, so that states of
    scenes with other loads and other drag fit.

    Parameters
    ----------
    found : Collected
    loaded : ndarray
        Edges whose halves carry loads off the curve.
    in_fluid : bool
    """
    first, second, middle = found.column("first_moment", width=2), *map(found.column, ("second_moment", "middle"))
    number = np.full(found.edge_count, -1, dtype=np.int64)
    if not len(middle):  # rods of two strands, whose masses and paths lie on these
        return Raised.absent(), number, 0
    kept = np.cumsum(found.column("off_curve", bool))
    is_raised = (second > 0.0) | (middle != 0.0) & in_fluid
    is_raised[loaded] = True
    edge = np.flatnonzero(is_raised)
    if not len(edge):
        return Raised.absent(), number, int(kept[-1])
    number[edge] = np.arange(len(edge))
    slot, moments = kept[edge] - 1, np.column_stack([first[edge], second[edge]])
    raised = Raised.zeros(
        UNALLOCATED,
        first=0,
        slot=slot,
        edge=edge,
        first_moment=first[edge],
        second_moment=second[edge],
        middle=middle[edge],
        block=blocks(edge, found.column("edge_node", np.int64)[edge], slot),
        by_component=np.repeat(moments.T[:, :, None], 3, axis=2),
    )
    return raised, number, int(kept[-1])
