"""Bars across the width of ribbons, of all layers at once: where they are, and which colour they have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bilayer_core.observed.frame import Description, Frame, strain_at
from bilayer_core.record.colours import strain_colours
from bilayer_core.record.node_frames import NodeFrames, layer_rows

Array = np.ndarray


class Ribbons:
    """Bars of the layers of a model, written into arrays of messages.

    Parameters
    ----------
    description : Description
    nodes : NodeFrames
        Of the same model.
    strain_limit : float
        Strain of full colour.
    points, colours, spacings : sequence of ndarray
        Of each layer: ends of bars [m], shape (bars, 2, 3), their colours, shape (bars, 2, 4), and their mean distance
        [m], shape (1,).
    """

    def __init__(
        self,
        description: Description,
        nodes: NodeFrames,
        strain_limit: float,
        points: Sequence[Array],
        colours: Sequence[Array],
        spacings: Sequence[Array],
    ):
        self._nodes, self._limit = nodes, strain_limit
        self._points, self._colours, self._spacings = points, colours, spacings
        layers, own = description.layers, layer_rows(description)
        everywhere, rows = np.arange(description.node_count), np.arange(len(nodes.order))
        self._node = np.concatenate([everywhere[layer.nodes] for layer in layers])
        self._row = np.concatenate([rows[of] for of in own])
        offset, width, self._curvature = (
            np.concatenate([getattr(layer, name) for layer in layers]) for name in ("offset", "width", "curvature")
        )
        self._offset, self._half_width = offset[:, None], 0.5 * width[:, None]
        ends = np.cumsum([0, *(of.stop - of.start for of in own)]).tolist()
        self._parts = [slice(begin, end) for begin, end in zip(ends[:-1], ends[1:], strict=True)]
        self._edges = [slice(of.start, of.stop - 1) for of in own]

    def show(self, frame: Frame) -> None:
        """Write those of a frame, to which `nodes` was updated."""
        nodes, row, node = self._nodes, self._row, self._node
        middles = nodes.positions.take(row, axis=0)
        middles += self._offset * nodes.normals.take(row, axis=0)
        half = self._half_width * nodes.widths.take(row, axis=0)
        bars = np.empty((len(row), 2, 3))
        np.subtract(middles, half, out=bars[:, 0])
        np.add(middles, half, out=bars[:, 1])
        strain = strain_at(self._offset[:, 0], frame.strain.take(node), frame.curvature.take(node), self._curvature)
        colours = strain_colours(strain, self._limit)[:, None]
        steps = nodes.positions[1:] - nodes.positions[:-1]
        lengths = np.sqrt(np.einsum("ij,ij->i", steps, steps))
        for part, edges, points, shown, spacing in zip(
            self._parts, self._edges, self._points, self._colours, self._spacings, strict=True
        ):
            points[:] = bars[part]
            shown[:] = colours[part]
            spacing[0] = np.add.reduce(lengths[edges]) / (edges.stop - edges.start)
