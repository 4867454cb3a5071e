"""Where rods feel surfaces: at their nodes, or at points with arms from them.

A section touches with the middle between its faces, half its thickness away from both. Where the node is not there, as
in a laminate whose layers differ, the contact point has an arm along m1. In space a section that is wider than thick
touches with its borders, too: points at ± (width − thickness)/2 along m2 with a quarter of the weight each, and half
of it in the middle. So a ribbon that lies flat rests where it would with its middle alone, and a ball sinks no deeper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.strands import Collected

Array = np.ndarray
OF_BORDER = 0.25
"""Part of the weight of a section that each of its borders has."""
NO_ARM = 1e-9
"""Of the thickness: shorter arms are none."""


@dataclass(frozen=True)
class RodPoints:
    """Contact points of rods: their nodes, and points with arms.

    Attributes
    ----------
    node_weight : Array
        Δl of the barrier at nodes [m], 0 where a node is no contact point, shape (n_node,).
    node_radius : Array
        [m], likewise.
    node : Array
        Of each point with an arm, ascending, shape (n_rod_point,).
    arm : Array
        Along m1 and m2 [m], shape (n_rod_point, 2).
    weight, radius : Array
        [m], shape (n_rod_point,).
    position : Array
        At the start [m], shape (n_rod_point, 3).
    section : Array
        Half the thickness, distance of a border from the middle, its height over the node, and Δl of the path, which is
        0 of copies of other nodes [m], shape (n_node, 4).
    """

    node_weight: Array
    node_radius: Array
    node: Array
    arm: Array
    weight: Array
    radius: Array
    position: Array
    section: Array


def rod_points(found: Collected, in_plane: bool) -> RodPoints:
    """Return the contact points of all rods; in a plane none is across the width."""
    length = found.column("node_length")
    thickness, width, offset = (
        np.concatenate([getattr(strand, name) for strand in found.strands]) for name in ("thickness", "width", "offset")
    )
    half = 0.5 * thickness
    border = np.zeros_like(half) if in_plane else 0.5 * width - half
    border[border <= NO_ARM * thickness] = 0.0
    height = np.where(np.abs(offset) <= NO_ARM * thickness, 0.0, offset)
    middle, own = np.where(border > 0.0, 1.0 - 2.0 * OF_BORDER, 1.0), length > 0.0  # not a copy of another node
    raised, wide = np.flatnonzero(own & (height != 0.0)), np.flatnonzero(own & (border > 0.0))
    parts = [
        (raised, 0.0, middle),
        (wide, -border, np.full_like(border, OF_BORDER)),
        (wide, border, np.full_like(border, OF_BORDER)),
    ]
    node = np.concatenate([nodes for nodes, _, _ in parts])
    across = np.concatenate([np.broadcast_to(side, half.shape)[nodes] for nodes, side, _ in parts])
    weight = np.concatenate([(share * length)[nodes] for nodes, _, share in parts])
    order = np.argsort(node, kind="stable")
    node, arm = node[order], np.stack([height[node], across], axis=1)[order]
    return RodPoints(
        np.where(height == 0.0, middle * length, 0.0),
        half,
        node,
        arm,
        weight[order],
        half[node],
        _at_start(found, node, arm),
        np.stack([half, border, height, length], axis=1),
    )


def _at_start(found: Collected, node: Array, arm: Array) -> Array:
    """Return the positions of points with arms [m], shape (n_rod_point, 3)."""
    edges = found.column("node_edges", np.int64, 2)[node]
    m1, tangent = found.column("director1", width=3), found.column("tangent", width=3)
    directions = np.stack([m1, cross(tangent, m1)], axis=1)[edges].mean(axis=1)
    return found.column("position", width=3)[node] + np.einsum("kd,kdc->kc", arm, directions)
