"""Material frames at nodes, from the directors of edges."""

from __future__ import annotations

import numpy as np

from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import combine, cross, dot, row, scaled
from bilayer_core.simulation.frame import Description, Frame


@kernel
def _frames_at_nodes(
    positions, directors, edge_before, edge_after, start_node, quaternions_out, normals_out, widths_out
):
    """Frame of each node: m3 the mean tangent of its edges, m1 their mean director made normal to it, m2 = m3 × m1.

    The quaternion x y z w is that of the matrix with columns m1, m2, m3, by the largest of its components.
    """
    for node in range(positions.shape[0]):
        before, after = edge_before[node], edge_after[node]
        m3 = _unit(combine(1.0, _tangent(positions, start_node[before]), 1.0, _tangent(positions, start_node[after])))
        m1 = combine(1.0, row(directors, before), 1.0, row(directors, after))
        m1 = _unit(combine(1.0, m1, -dot(m1, m3), m3))
        m2 = cross(m3, m1)
        trace = m1[0] + m2[1] + m3[2]
        if trace >= max(m1[0], m2[1], m3[2]):
            x, y, z, w = m2[2] - m3[1], m3[0] - m1[2], m1[1] - m2[0], 1.0 + trace
        elif m1[0] >= max(m2[1], m3[2]):
            x, y, z, w = 1.0 + m1[0] - m2[1] - m3[2], m2[0] + m1[1], m3[0] + m1[2], m2[2] - m3[1]
        elif m2[1] >= m3[2]:
            x, y, z, w = m2[0] + m1[1], 1.0 + m2[1] - m3[2] - m1[0], m3[1] + m2[2], m3[0] - m1[2]
        else:
            x, y, z, w = m3[0] + m1[2], m3[1] + m2[2], 1.0 + m3[2] - m1[0] - m2[1], m1[1] - m2[0]
        scale = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
        quaternions_out[node, 0] = scale * x
        quaternions_out[node, 1] = scale * y
        quaternions_out[node, 2] = scale * z
        quaternions_out[node, 3] = scale * w
        normals_out[node, 0], normals_out[node, 1], normals_out[node, 2] = m1
        widths_out[node, 0], widths_out[node, 1], widths_out[node, 2] = m2


@kernel
def _unit(a):
    """a/|a|"""
    return scaled(1.0 / np.sqrt(dot(a, a)), a)


@kernel
def _tangent(positions, start):
    """Unit tangent of the edge from node `start` to the next."""
    return _unit(combine(1.0, row(positions, start + 1), -1.0, row(positions, start)))


def node_order(description: Description) -> np.ndarray:
    """Index in a `Frame` of every node of a strand, strand by strand, shape (strand nodes,)."""
    nodes = np.arange(description.node_count)
    return np.concatenate([nodes[strand.nodes] for strand in description.strands])


def layer_rows(description: Description) -> list[slice]:
    """Where the nodes of each of the description's `layers` stand in this order."""
    rows, count = [], 0
    for strand in description.strands:
        for layer in strand.layers or (strand,):
            first = count + layer.nodes.start - strand.nodes.start
            rows.append(slice(first, first + layer.nodes.stop - layer.nodes.start))
        count += strand.nodes.stop - strand.nodes.start
    return rows


class NodeFrames:
    """Positions and material frames of the nodes of all strands, strand by strand.

    Attributes
    ----------
    order : ndarray
        Index in a `Frame` of each node in this order, shape (nodes,).
    positions, quaternions, normals, widths : ndarray
        Of the frame last given to `update`: position [m], x y z w of the frame m1 m2 m3, and its axes m1 and m2; shapes
        (nodes, 3), (nodes, 4), (nodes, 3), (nodes, 3).
    """

    def __init__(self, description: Description):
        edges = np.arange(description.edge_count)
        self.order = node_order(description)
        self._edge_order = np.concatenate([edges[strand.edges] for strand in description.strands])
        before, after, start = [], [], []
        node_count = edge_count = 0
        for strand in description.strands:
            size = len(edges[strand.edges]) + 1
            own = edge_count + np.arange(size - 1)
            before += [own[0], *own]
            after += [*own, own[-1]]
            start += list(node_count + np.arange(size - 1))
            node_count += size
            edge_count += size - 1
        self._edge_before, self._edge_after, self._start_node = (np.array(part) for part in (before, after, start))
        self._directors = np.empty((edge_count, 3))
        self.positions = np.empty((node_count, 3))
        self.quaternions = np.empty((node_count, 4))
        self.normals = np.empty((node_count, 3))
        self.widths = np.empty((node_count, 3))
        self._frame: Frame | None = None

    def update(self, frame: Frame) -> None:
        """Compute all of these for `frame`, once for several calls with the same one."""
        if frame is self._frame:
            return
        np.take(frame.positions, self.order, axis=0, out=self.positions)
        np.take(frame.directors, self._edge_order, axis=0, out=self._directors)
        _frames_at_nodes(
            self.positions,
            self._directors,
            self._edge_before,
            self._edge_after,
            self._start_node,
            self.quaternions,
            self.normals,
            self.widths,
        )
        self._frame = frame
