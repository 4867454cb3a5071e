"""Material frames at nodes, from the directors of edges."""

from __future__ import annotations

import numpy as np

from bilayer_core.kinematics.node_frames import NodeFrameArrays, frames_at_nodes
from bilayer_core.observed.frame import Description, Frame


def node_order(description: Description) -> np.ndarray:
    """Return the index in a `Frame` of every node of a strand, strand by strand, shape (strand nodes,)."""
    nodes = np.arange(description.node_count)
    return np.concatenate([nodes[:0], *(nodes[strand.nodes] for strand in description.strands)])


def layer_rows(description: Description) -> list[slice]:
    """Return where the nodes of each of the description's `layers` stand in this order."""
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
            before += [own[-1] if strand.closed else own[0], *own]
            after += [*own, own[0] if strand.closed else own[-1]]
            start += list(node_count + np.arange(size - 1))
            node_count += size
            edge_count += size - 1
        edge_before, edge_after, start_node = (np.array(part) for part in (before, after, start))
        self._directors = np.empty((edge_count, 3))
        self.positions = np.empty((node_count, 3))
        self.quaternions = np.empty((node_count, 4))
        self.normals = np.empty((node_count, 3))
        self.widths = np.empty((node_count, 3))
        self._arrays = NodeFrameArrays(
            position=self.positions,
            director=self._directors,
            edge_before=edge_before,
            edge_after=edge_after,
            start_node=start_node,
            quaternion=self.quaternions,
            normal=self.normals,
            width=self.widths,
        )
        self._frame: Frame | None = None
        _ = frames_at_nodes.address  # loaded now, and not where a log's first frame waits for it

    def update(self, frame: Frame) -> None:
        """Compute all of these for `frame`, once for several calls with the same one."""
        if frame is self._frame:
            return
        np.take(frame.positions, self.order, axis=0, out=self.positions)
        np.take(frame.directors, self._edge_order, axis=0, out=self._directors)
        frames_at_nodes(self._arrays)
        self._frame = frame
