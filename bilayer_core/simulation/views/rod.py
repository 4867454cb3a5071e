"""Rods and their layers at present."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.observed.frame import Strand
from bilayer_core.simulation import observation as observe
from bilayer_core.simulation.strip_sections import across_at_nodes
from bilayer_core.simulation.views.present import ByName, Present

Array = np.ndarray


class RodView:
    """A rod as it is at present; every attribute is a copy.

    A rod of the laminate is one curve. Where each layer is a rod of its own (model ``two_rod``), arrays hold their
    nodes layer by layer, as those of the simulator do; what does not depend on the model is `middle_line` and `layers`.

    Attributes
    ----------
    name : str
    nodes, edges : Array
        Indices in the arrays of the simulator and of frames, shape (nodes,), (edges,).
    arc_length : Array
        Of each node from the start of its curve, without load and eigenstrain [m], shape (nodes,).
    middle_line : Array
        Positions midway between the faces of the rod [m], a row for each station in both models, shape (stations, 3).
    positions, velocities : Array
        [m], [m/s], shape (nodes, 3).
    directors : Array
        Director m1 of each edge, through the thickness from bottom to top, unit, shape (edges, 3).
    strain : Array
        Axial strain at each node, eigenstrain included, shape (nodes,).
    curvature : Array
        Curvature χ through the thickness at each node [1/m], shape (nodes,).
    section_curvature : Array
        Mean curvature of the section across the width at each node [1/m], positive where the borders rise along m1,
        shape (nodes,); 0 in a beam. The section rises by about an eighth of it times the width squared.
    contact_forces : Array
        Barrier and friction force on each node [N], shape (nodes, 3).
    layers : ByName
        Each `LayerView` by name.
    """

    def __init__(self, present: Present, name: str):
        self._present, self.name = present, name

    def __repr__(self) -> str:
        layers, tip = ", ".join(self.layers), self.middle_line[-1].tolist()
        return f"rod {self.name} (layers {layers}): {len(self.nodes)} nodes, the last at {tip}"

    @property
    def _strands(self) -> list[StrandArrays]:
        return [s for s in self._present.model.strands if s.rod == self.name]

    @property
    def nodes(self) -> Array:
        return np.concatenate([np.arange(s.first_node, s.first_node + s.shown) for s in self._strands])

    @property
    def edges(self) -> Array:
        return np.concatenate([np.arange(s.first_edge, s.first_edge + s.shown - 1) for s in self._strands])

    @property
    def arc_length(self) -> Array:
        rest = self._present.model.rods.rest_length
        lengths = [rest[s.first_edge : s.first_edge + s.shown - 1] for s in self._strands]
        return np.concatenate([np.concatenate([[0.0], np.cumsum(of_strand)]) for of_strand in lengths])

    @property
    def middle_line(self) -> Array:
        return self._present.quantity(f"rod/{self.name}/position")

    @property
    def positions(self) -> Array:
        return self._present.state.position[self.nodes]

    @property
    def velocities(self) -> Array:
        return self._present.state.velocity[self.nodes]

    @property
    def directors(self) -> Array:
        return self._present.state.director1[self.edges]

    @property
    def strain(self) -> Array:
        return self._present.seen().strain[self.nodes]

    @property
    def curvature(self) -> Array:
        return self._present.seen().curvature[self.nodes]

    @property
    def section_curvature(self) -> Array:
        return across_at_nodes(self._present.model, self._present.state)[self.nodes]

    @property
    def contact_forces(self) -> Array:
        return self._present.seen().contact_force[self.nodes]

    @property
    def layers(self) -> ByName[LayerView]:
        views = {name: LayerView(self._present, self.name, name) for name in layers_of(self._strands)}
        return ByName(f"layers of {self.name}", views)


class LayerView:
    """A layer of a rod as it is at present, in both models alike; every attribute is a copy.

    Attributes
    ----------
    name : str
        ``ROD/LAYER``.
    strain : Array
        Axial strain in the middle of the layer at each of its nodes, eigenstrain included, shape (nodes,).
    curvature : Array
        Curvature χ through the thickness of the curve that carries it [1/m], shape (nodes,).
    width, thickness : Array
        Of its section [m], shape (nodes,).
    """

    def __init__(self, present: Present, rod: str, layer: str):
        self._present, self._of, self.name = present, (rod, layer), f"{rod}/{layer}"

    def __repr__(self) -> str:
        strain = self.strain
        return f"layer {self.name}: {len(strain)} nodes, strain {strain.min():.4g} to {strain.max():.4g}"

    @property
    def _layer(self) -> Strand:
        rod, layer = self._of
        return layers_of(s for s in self._present.model.strands if s.rod == rod)[layer]

    @property
    def strain(self) -> Array:
        nodes, seen = self._layer.nodes, self._present.seen()
        return self._layer.strain_of(seen.strain[nodes], seen.curvature[nodes])

    @property
    def curvature(self) -> Array:
        return self._present.seen().curvature[self._layer.nodes]

    @property
    def width(self) -> Array:
        return self._layer.width.copy()

    @property
    def thickness(self) -> Array:
        return self._layer.thickness.copy()


def rod_views(present: Present) -> ByName[RodView]:
    """Return every rod by name; copies of a pattern are rods of their own."""
    names = dict.fromkeys(s.rod for s in present.model.strands)
    return ByName("rods", {name: RodView(present, name) for name in names})


def layers_of(strands: Iterable[StrandArrays]) -> dict[str, Strand]:
    """Return the layers of strands by name."""
    return {layer.layer: layer for s in strands for of in [observe.strand(s)] for layer in of.layers or (of,)}
