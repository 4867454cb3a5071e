"""Bars across the width of ribbons, of all layers at once: where they are, and which colour they have."""

from __future__ import annotations

import numpy as np

from bilayer_core.kinematics.marker_lines import place_bars
from bilayer_core.log.messages.cdr import Template
from bilayer_core.log.messages.colours import strain_colours
from bilayer_core.log.messages.node_frames import NodeFrames, layer_rows
from bilayer_core.observed.frame import Description, Frame, strain_at


class Ribbons:
    """Bars of the layers of a model, written into messages.

    Parameters
    ----------
    description : Description
    nodes : NodeFrames
        Of the same model.
    strain_limit : float
        Strain of full colour.
    template : Template
        Of the message: of layer i it has the fields ``points{i}``, ends of bars [m], ``colours{i}``, one for each end,
        and ``spacing{i}``, the mean distance of bars [m].
    """

    def __init__(self, description: Description, nodes: NodeFrames, strain_limit: float, template: Template):
        self._nodes, self._limit = nodes, strain_limit
        layers, own = description.layers, layer_rows(description)
        everywhere, rows = np.arange(description.node_count), np.arange(len(nodes.order))
        self._node = np.concatenate([everywhere[layer.nodes] for layer in layers])
        self._row = np.concatenate([rows[of] for of in own])
        self._offset, width, self._curvature = (
            np.concatenate([getattr(layer, name) for layer in layers]) for name in ("offset", "width", "curvature")
        )
        self._half_width = 0.5 * width
        self._first_bar = np.cumsum([0, *(of.stop - of.start for of in own)])
        self._first_row = np.array([of.start for of in own])
        self._doubles, self._singles = template.numbers("<f8"), template.numbers("<f4")
        fields = ("points", "spacing", "colours")
        self._places = np.array([[template.place(f"{name}{i}") for name in fields] for i in range(len(own))])
        self._place(np.zeros((0, 4), np.float32), self._first_row[:0])  # compiled now, as in `NodeFrames`

    def show(self, frame: Frame) -> None:
        """Write those of a frame, to which `nodes` was updated."""
        node = self._node
        strain = strain_at(self._offset, frame.strain.take(node), frame.curvature.take(node), self._curvature)
        self._place(strain_colours(strain, self._limit), self._first_row)

    def _place(self, colours: np.ndarray, first_row: np.ndarray) -> None:
        """Those of as many layers as there are first rows."""
        nodes = self._nodes
        place_bars(
            *(nodes.positions, nodes.normals, nodes.widths, self._row, self._offset, self._half_width, colours),
            *(self._first_bar, first_row, self._places, self._doubles, self._singles),
        )
