"""Rails of rods that meet, where their curves are not in the middle between their faces; see `contact.rails`."""

from __future__ import annotations

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.records.contacts import Rails
from bilayer_core.model.rod_points import NO_ARM
from bilayer_core.model.strands import Collected

Array = np.ndarray


def rail_heights(found: Collected) -> Array:
    """Return the heights of the middle between the faces over the nodes [m], shape (n_node,).

    Closed strands have none: there rods meet round their curve, up to the farther face.
    """
    heights = [
        np.where(strand.closed | (np.abs(strand.offset) <= NO_ARM * strand.thickness), 0.0, strand.offset)
        for strand in found.strands
    ]
    return np.concatenate(heights)


def build_rails(found: Collected) -> Rails:
    """Return the record, absent if the rails are the nodes."""
    height = rail_heights(found)
    if not height.any():
        return Rails.absent()
    edges = found.column("node_edges", np.int64, 2)
    slope = np.abs(height) / found.column("rest_length")[edges].min(axis=1)
    turn = np.abs(height) / found.column("half_width")[edges].min(axis=1)
    factor = float(np.max(1.0 + 4.0 * slope + turn))  # half of the lengths is left at least
    return Rails.zeros(UNALLOCATED, height=height, node_edges=edges, factor=factor)


def start_rails(found: Collected, rails: Rails) -> Array:
    """Return the positions of rails at the start [m], shape (n_node, 3)."""
    position = found.column("position", width=3)
    if not rails.exists:
        return position
    m1 = found.column("director1", width=3)[rails.node_edges].mean(axis=1)
    return position + rails.height[:, None] * m1
