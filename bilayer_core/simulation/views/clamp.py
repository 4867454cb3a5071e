"""Ends of rods that bodies hold, at present."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.model import Model
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

    def __init__(self, present: Present, body: str, held: list[int]):
        self._present, self.body, self._held = present, body, held

    def __repr__(self) -> str:
        return f"clamp by {self.body} at {self.position.tolist()}"

    @property
    def position(self) -> Array:
        state, model = self._present.state, self._present.model
        held, first = model.constrained, model.rods.edge_count
        body, nodes = held.body[self._held[0]], held.node[self._held]
        heights = np.array([_path_over(model, node) for node in nodes.tolist()])
        normal = held.clamp_edge_director1[[first + k for k in self._held]] @ state.body_rotation[body].T
        return (state.position[nodes] + heights[:, None] * normal).mean(axis=0)

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
    for strand in model.strands:
        ends[strand.first_node] = f"{strand.rod}.start"
        ends[strand.first_node + strand.node_count - 1] = f"{strand.rod}.end"
    held: dict[str, list[int]] = {}
    for index, node in enumerate(model.constrained.node.tolist()):
        held.setdefault(ends[node], []).append(index)
    names, body = model.bodies.names, model.constrained.body
    clamps = {end: ClampView(present, names[body[own[0]]], own) for end, own in held.items()}
    return ByName("clamps", clamps)


def _path_over(model: Model, node: int) -> float:
    """Return the height of the path over a node [m]: at the inner face of either of two layers."""
    strand = next(s for s in model.strands if 0 <= node - s.first_node < s.node_count)
    layers = next(rod.layers for rod in model.scene.rods if strand.rod in rod.copy_names)
    if len(layers) == 1:
        return 0.0
    there = next(own for own in strand.layers or (strand,) if 0 <= node - own.first_node < own.node_count)
    place = node - there.first_node
    inward = 0.5 if there.layer == layers[0].name else -0.5
    return float(there.offset[place] + inward * there.thickness[place])
