"""The order of unknowns: the only file that turns a station and a layer into the number of an unknown.

Along each rod, station by station: positions of the layers present, then the angles of their edges that start there.
Rods follow each other.
Elements span three stations of one layer, and at most the middle one of the other with them, or two stations of both,
which bounds the half-bandwidth.
In a plane (`model.plane`) a node has two unknowns and an edge none.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bilayer_core.jit import Record
from bilayer_core.jit.record import shown

HALF_BANDWIDTH = {
    3: {1: 10, 2: 18},
    2: {1: 5, 2: 9},
}  # by dimension and number of layers: (x θ x θ x) of one layer spans 11 unknowns, 19 with the other's between
OF_RAILS = {3: {1: 14, 2: 26}, 2: {1: 7, 2: 9}}
"""Likewise with rails (`contact.rails`): those of an edge, (x θ x θ x θ x) of one layer, span 15 unknowns. In a plane
those of two layers are the nodes."""


class ReadOnlyArrays:
    """Base of frozen dataclasses whose arrays nobody writes to, either, and are shown by their shapes."""

    def __init_subclass__(cls) -> None:
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = ReadOnlyArrays.__repr__  # which dataclasses leave as it is

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={shown(value)}' for name, value in vars(self).items())})"

    def __post_init__(self):
        _lock(vars(self).values())


def _lock(values: Iterable[object]) -> None:
    """Describe an array by its type and shape, a tuple of parts by their number."""
    for value in values:
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        elif isinstance(value, tuple):
            _lock(value)
        elif isinstance(value, Record):
            _lock(getattr(value, name) for name in value.names if name not in value.shapes)


def columns(pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two columns of an (n, 2) array, contiguous and read-only: kernels are compiled for such arrays."""
    both = np.ascontiguousarray(pairs.T)
    both.flags.writeable = False
    return both[0], both[1]


@dataclass(frozen=True)
class Layout(ReadOnlyArrays):
    """Numbers of unknowns.

    Attributes
    ----------
    size : int
        Unknowns of nodes and edges.
    half_bandwidth : int
        Largest difference of two coupled unknowns; a compile-time constant of the solver.
    half_bandwidth_apart : int
        Likewise while no rods touch.
    dimension : int
        Unknowns of a node: 3, or 2 in a plane.
    node : ndarray
        First unknown of each node, shape (n_node,).
    edge : ndarray
        Unknown of each edge's angle, shape (n_edge,); (0,) in a plane.
    attached : ndarray
        First unknown of each node that a body holds, shape (n_attached,).
    attached_of_unknown : ndarray
        Attached node to which an unknown belongs, −1 for the others, shape (size,).
    """

    size: int
    half_bandwidth: int
    half_bandwidth_apart: int
    dimension: int
    node: np.ndarray
    edge: np.ndarray
    attached: np.ndarray
    attached_of_unknown: np.ndarray


def number_unknowns(
    rods: list[list[tuple[int, int, int, int]]],
    node_count: int,
    edge_count: int,
    attached_node: np.ndarray,
    dimension: int = 3,
    has_rails: bool = False,
) -> Layout:
    """Assign numbers to the unknowns of rods.

    Each rod is a list of layers (first station, last station, first node, first edge); with rails off the nodes, the
    matrix couples those of two neighbours.
    """
    turns = dimension == 3
    node = np.full(node_count, -1, dtype=np.int64)
    edge = np.full(edge_count if turns else 0, -1, dtype=np.int64)
    size = 0
    for layers in rods:
        begin, end = min(layer[0] for layer in layers), max(layer[1] for layer in layers) + 1
        before = np.zeros((2 * len(layers) + 1, end - begin), dtype=np.int64)  # unknowns at each station, added up
        for k, (first, last, _, _) in enumerate(layers):
            before[1 + k, first - begin : last + 1 - begin] = dimension
            before[1 + len(layers) + k, first - begin : last - begin] = turns
        before = before.cumsum(axis=0)
        before[:, 1:] += before[-1, :-1].cumsum()
        before += size
        for k, (first, last, first_node, first_edge) in enumerate(layers):
            node[first_node : first_node + last + 1 - first] = before[k, first - begin : last + 1 - begin]
            if turns:
                own = before[len(layers) + k, first - begin : last - begin]
                edge[first_edge : first_edge + last - first] = own
        size = int(before[-1, -1])
    attached = node[attached_node]
    attached_of_unknown = np.full(size, -1, dtype=np.int64)
    attached_of_unknown[(attached[:, None] + np.arange(dimension)).ravel()] = np.repeat(
        np.arange(len(attached)), dimension
    )
    most = max(len(layers) for layers in rods)
    apart = HALF_BANDWIDTH[dimension][most]
    touching = OF_RAILS[dimension][most] if has_rails else apart
    return Layout(size, touching, apart, dimension, node, edge, attached, attached_of_unknown)
