"""Rails of rods that meet, where they are not round about their curves; see `contact.rails`."""

from __future__ import annotations

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.blocks import blocks
from bilayer_core.model.records.contacts import Rails
from bilayer_core.model.rod_points import NO_ARM
from bilayer_core.model.strands import Collected

Array = np.ndarray


def build_rails(found: Collected, ribbons: set[str]) -> Rails:
    """Return the record, absent if the rails are the nodes.

    The first rails of a closed strand are those of the copy of its first node (`model.strand_arrays`), which has an
    edge on either side.

    Parameters
    ----------
    found : Collected
    ribbons : set of str
        Names of rods that have borders.
    """
    node = np.arange(found.node_count)
    height, border = np.zeros((2, found.node_count))
    right = np.full(found.edge_count, -1)
    extra = []
    for strand in found.strands:
        own = slice(strand.first_node, strand.first_node + strand.node_count)
        height[own] = np.where(np.abs(strand.offset) <= NO_ARM * strand.thickness, 0.0, strand.offset)
        if strand.rod in ribbons:
            border[own] = np.maximum(0.5 * (strand.width - strand.thickness), 0.0)
            first = found.node_count + sum(map(len, extra))
            right[strand.first_edge : strand.first_edge + strand.node_count - 1] = first + np.arange(
                strand.node_count - 1
            )
            extra.append(node[own])
    arm = np.stack([height, -border], axis=1)
    if not arm.any():
        return Rails.absent()
    node = np.concatenate([node, *extra])
    arm = np.concatenate([arm, *([1.0, -1.0] * arm[own] for own in extra)])
    for strand in found.strands:
        if strand.closed:
            node[node == strand.first_node] = strand.last_node
    edges, size = found.column("node_edges", np.int64, 2), np.linalg.norm(arm, axis=1)
    slope = size / found.column("rest_length")[edges[node]].min(axis=1)
    turn = size / found.column("half_width")[edges[node]].min(axis=1)
    factor = float(np.max(1.0 + 4.0 * slope + turn))  # half of the lengths is left at least
    return Rails.zeros(
        UNALLOCATED,
        node=node,
        arm=arm,
        right=right,
        node_edges=edges,
        factor=factor,
        block=blocks(node, *edges[node].T),
        by_component=np.repeat(0.5 * arm.T[:, :, None], 3, axis=2),
    )


def start_rails(found: Collected, rails: Rails) -> Array:
    """Return the positions of rails at the start [m], shape (n_rail, 3)."""
    position = found.column("position", width=3)
    if not rails.exists:
        return position
    m1, tangent = found.column("director1", width=3), found.column("tangent", width=3)
    directions = np.stack([m1, cross(tangent, m1)], axis=1)[rails.node_edges[rails.node]].mean(axis=1)
    return position[rails.node] + np.einsum("rd,rdc->rc", rails.arm, directions)
