"""Bars across the width of ribbons, of all layers at once: where they are, and which colour they have."""

from __future__ import annotations

import numpy as np

from bilayer_core.kinematics.marker_lines import BarArrays, place_bars
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
        self._limit = strain_limit
        layers, own = description.layers, layer_rows(description)
        everywhere, rows = np.arange(description.node_count), np.arange(len(nodes.order))
        self._node = np.concatenate([everywhere[layer.nodes] for layer in layers])
        self._offset, width, self._curvature = (
            np.concatenate([getattr(layer, name) for layer in layers]) for name in ("offset", "width", "curvature")
        )
        fields = ("points", "spacing", "colours")
        self._bars = BarArrays(
            position=nodes.positions,
            normal=nodes.normals,
            width=nodes.widths,
            row=np.concatenate([rows[of] for of in own]),
            offset=self._offset,
            half_width=0.5 * width,
            colour=np.zeros((len(width), 4), np.float32),
            first_bar=np.cumsum([0, *(of.stop - of.start for of in own)]),
            first_row=np.array([of.start for of in own]),
            place=np.array([[template.place(f"{name}{i}") for name in fields] for i in range(len(own))]),
            doubles=template.numbers("<f8"),
            singles=template.numbers("<f4"),
        )
        _ = place_bars.address  # loaded now, as in `NodeFrames`

    def show(self, frame: Frame) -> None:
        """Write those of a frame, to which `nodes` was updated."""
        node = self._node
        strain = strain_at(self._offset, frame.strain.take(node), frame.curvature.take(node), self._curvature)
        self._bars.colour[:] = strain_colours(strain, self._limit)
        place_bars(self._bars)
