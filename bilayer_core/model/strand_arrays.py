"""Where the nodes and edges of a layer stand among all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .layout import ReadOnlyArrays

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
    layers: tuple[StrandArrays, ...] = ()  # of a strand that stands for several: each on those nodes where it is
