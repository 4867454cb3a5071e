"""Ends of rods that bodies hold, at present."""

from __future__ import annotations

import numpy as np

from bilayer_core.simulation.views.present import ByName, Present

Array = np.ndarray


class ClampView:
    """An end of a rod that a body holds, as it is at present.

    Attributes
    ----------
    body : str
        What holds it.
    position : Array
        Middle of the nodes that are held [m], shape (3,).
    wrench : Array
        Force [N] that the end exerts on the body, and moment about `position` [N m], in the world's axes, shape (6,).
    """

    def __init__(self, present: Present, body: str, held: list[int]):
        self._present, self.body, self._held = present, body, held

    def __repr__(self) -> str:
        return f"clamp by {self.body} at {self.position.tolist()}"

    @property
    def position(self) -> Array:
        present = self._present
        return present.state.position[present.model.constrained.node[self._held]].mean(axis=0)

    @property
    def wrench(self) -> Array:
        present = self._present
        wrench = present.seen().clamp[self._held].sum(axis=0)
        body = present.model.constrained.body[self._held[0]]
        wrench[3:] -= np.cross(self.position - present.state.body_position[body], wrench[:3])
        return wrench


def clamp_views(present: Present) -> ByName[ClampView]:
    """Every held end of a rod, as ``ROD.start`` or ``ROD.end``."""
    model, ends = present.model, {}
    for strand in model.strands:
        ends[strand.first_node] = f"{strand.rod}.start"
        ends[strand.first_node + strand.node_count - 1] = f"{strand.rod}.end"
    held: dict[str, list[int]] = {}
    for index, node in enumerate(model.constrained.node.tolist()):
        held.setdefault(ends[node], []).append(index)
    names = model.bodies.names
    clamps = {end: ClampView(present, names[model.constrained.body[own[0]]], own) for end, own in held.items()}
    return ByName("clamps", clamps)
