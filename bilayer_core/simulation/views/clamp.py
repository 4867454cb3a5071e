"""Ends of rods that bodies hold, at present."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.simulation.views.present import ByName, Present

Array = np.ndarray


class ClampView:
    """An end of a rod that a body holds, as it is at present.

    Attributes
    ----------
    body : str
        What holds it.
    position : Array
        Point of the path at the end [m], shape (3,): that between the layers, where there are two.
    wrench : Array
        Force [N] that the end exerts on the body, and moment about `position` [N m], in the world's axes, shape (6,).
    """

    def __init__(self, present: Present, body: str, held: list[int], heights: list[float]):
        self._present, self.body, self._held, self._heights = present, body, held, np.array(heights)

    def __repr__(self) -> str:
        return f"clamp by {self.body} at {self.position.tolist()}"

    @property
    def position(self) -> Array:
        state, held = self._present.state, self._present.model.constrained
        body = held.body[self._held[0]]
        first = self._present.model.rods.edge_count
        normal = held.clamp_edge_director1[[first + k for k in self._held]] @ state.body_rotation[body].T
        return (state.position[held.node[self._held]] + self._heights[:, None] * normal).mean(axis=0)

    @property
    def wrench(self) -> Array:
        present = self._present
        wrench = present.seen().clamp[self._held].sum(axis=0)
        body = present.model.constrained.body[self._held[0]]
        wrench[3:] -= np.cross(self.position - present.state.body_position[body], wrench[:3])
        return wrench


def clamp_views(present: Present) -> ByName[ClampView]:
    """Return every held end of a rod, as ``ROD.start`` or ``ROD.end``."""
    model, ends = present.model, {}
    layers = {copy: [layer.name for layer in rod.layers] for rod in model.scene.rods for copy in rod.copy_names}
    for strand in model.strands:
        last, of_rod = strand.first_node + strand.node_count - 1, layers[strand.rod]
        ends[strand.first_node] = f"{strand.rod}.start", _path_over(strand, strand.first_node, of_rod)
        ends[last] = f"{strand.rod}.end", _path_over(strand, last, of_rod)
    held: dict[str, tuple[list[int], list[float]]] = {}
    for index, node in enumerate(model.constrained.node.tolist()):
        end, height = ends[node]
        indices, heights = held.setdefault(end, ([], []))
        indices.append(index)
        heights.append(height)
    names = model.bodies.names
    clamps = {
        end: ClampView(present, names[model.constrained.body[own[0]]], own, heights)
        for end, (own, heights) in held.items()
    }
    return ByName("clamps", clamps)


def _path_over(strand: StrandArrays, node: int, layers: list[str]) -> float:
    """Return the height of the path over a node of a strand [m]: at the inner face of either of two layers."""
    if len(layers) == 1:
        return 0.0
    there = next(own for own in strand.layers or (strand,) if 0 <= node - own.first_node < own.node_count)
    place = node - there.first_node
    inward = 0.5 if there.layer == layers[0] else -0.5
    return float(there.offset[place] + inward * there.thickness[place])
