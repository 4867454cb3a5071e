"""What does not change from frame to frame: where things stand in arrays, and constants of a model."""

from __future__ import annotations

import numpy as np

from ..engine.engine import Engine
from ..model.force_list import Kind, kinds
from ..model.force_slots import NAMES
from ..model.model import Model
from ..model.state import PARTS, State
from ..model.strand_arrays import StrandArrays

Array = np.ndarray


class FrameTables:
    """Of a model, for `simulation.observation`.

    Parameters
    ----------
    model : Model
    engine : Engine
        Of the same model.

    Attributes
    ----------
    nodes, before, after : Array
        Nodes of strands, and the edges before and after each; at an end both are its one edge, shape (n,).
    shut, twin : Array
        Nodes in memory that stand for others of a closed strand, and those that they stand for.
    end, neighbour : Array
        Free ends of strands, which have no bending element, and their neighbours, shape (n_end,).
    joint_a, joint_b, joint_node : Array
        Edges and node of each bending element, shape (n_bend,).
    energies : tuple of (str, int)
        Conservative forces of the model, with their places among the energies of forces.
    has_joints, has_mechanisms : bool
        Whether any between bodies exert something.
    """

    def __init__(self, model: Model, engine: Engine):
        count = sum(s.node_count for s in model.strands)
        self.nodes, self.before, self.after = (np.empty(count, dtype=np.intp) for _ in range(3))
        begin, closed, ends = 0, [], []
        for s in model.strands:
            self._place(s, slice(begin, begin + s.node_count))
            begin += s.node_count
            first, last = s.first_node, s.first_node + s.node_count - 1
            closed += [(first, last - 1), (last, first + 1)] if s.closed else []
            ends += [pair for pair in ((first, first + 1), (last, last - 1)) if pair[0] not in model.attached_node]
        self.shut, self.twin = np.array(closed, dtype=np.intp).reshape(-1, 2).T
        self.end, self.neighbour = np.array(ends, dtype=np.intp).reshape(-1, 2).T
        bends = slice(model.bend_count)
        self.joint_a, self.joint_b = model.joint_a[bends].astype(np.intp), model.joint_b[bends].astype(np.intp)
        self.joint_node = model.joint_node[bends].astype(np.intp)
        kind, place = kinds(), {name: index for index, name in enumerate(NAMES)}
        self.energies = tuple((name, place[name]) for name in model.forces if kind[name] is Kind.CONSERVATIVE)
        self.has_joints, self.has_mechanisms = engine.joints.exists, engine.mechanisms.exists
        self._places: tuple[int, dict[str, tuple[int, int, tuple[int, ...]]]] = 0, {}

    def _place(self, s: StrandArrays, own: slice) -> None:
        edges = np.arange(s.first_edge, s.first_edge + s.node_count - 1)
        self.nodes[own] = np.arange(s.first_node, s.first_node + s.node_count)
        self.before[own] = [edges[0], *edges]
        self.after[own] = [*edges, edges[-1]]

    def places_in(self, state: State) -> dict[str, tuple[int, int, tuple[int, ...]]]:
        """Of each part of a state by name, where it begins and ends in its values, and its shape."""
        size, places = self._places
        if size != state.values.size:
            ends = np.cumsum([0, *(getattr(state, name).size for name in PARTS)]).tolist()
            shapes = [getattr(state, name).shape for name in PARTS]
            places = dict(zip(PARTS, zip(ends[:-1], ends[1:], shapes, strict=True), strict=True))
            self._places = state.values.size, places
        return places
