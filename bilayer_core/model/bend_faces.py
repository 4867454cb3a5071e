"""Faces of rods at their bending elements: where fibres strain most."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from bilayer_core.model.model import Model

Array = np.ndarray


def bend_faces(model: Model) -> tuple[Array, Array]:
    """Return the heights of the two faces over the curve at each bend, and the thickness of the whole section there.

    Returns
    -------
    faces : ndarray
        Along m1, of the layer where each has a strand of its own [m], shape (n_bend, 2).
    thickness : ndarray
        Of all layers of the rod [m], shape (n_bend,).
    """
    faces = np.zeros((model.node_count, 2))
    for strand in model.strands:
        half = 0.5 * strand.thickness
        own = slice(strand.first_node, strand.first_node + strand.node_count)
        faces[own] = np.stack([strand.offset - half, strand.offset + half], axis=1)
    node = model.joint_node[: model.rods.bend_count]
    return faces[node], whole_section(model)[1][node]


def whole_section(model: Model) -> tuple[Array, Array]:
    """Return the width of the widest layer of its rod, and the thickness of all, at each node [m], shape (n_node,)."""
    (width, thickness), of_rods = np.zeros((2, model.node_count)), defaultdict(list)
    for strand in model.strands:
        of_rods[strand.rod].append(strand)
    for strands in of_rods.values():
        for strand in strands:
            station = strand.first_station + np.arange(strand.node_count)
            for other in strands:
                place = station - other.first_station
                there = np.flatnonzero((place >= 0) & (place < other.node_count))
                at, place = strand.first_node + there, place[there]
                thickness[at] += other.thickness[place]
                width[at] = np.maximum(width[at], other.width[place])
    return width, thickness
