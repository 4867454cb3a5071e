"""One curve for both layers of a rod: where it lies, and what it carries (`laminate_section` has the derivation)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..scene.config import SceneConfig
from ..scene.pattern import placed
from ..scene.profile import values_at
from ..scene.rod import Layer, Rod, RodCopy
from .immersed import add_fluid
from .laminate_section import LayerHalves, WholeSection, layer_halves, side
from .lit import add_lit_elements, is_light
from .section import Section, outline, sections
from .strand_arrays import StrandArrays
from .strands import Collected, StrandElements, add_strand, is_closed, stations_of, strand_shape, with_copies
from .validity import Figure

Array = np.ndarray
NAME = "laminate"
UNEVEN = 0.1
"""Part by which the distances of the two faces from the curve may differ without a warning."""


@dataclass(frozen=True)
class _Placed:
    """A layer at the middle of edges; shapes (n_edge,)."""

    section: Section
    present: Array
    length: Array  # of its middle at the start [m]
    height: Array  # of its middle over the path [m]

    @property
    def mass(self) -> Array:
        """[kg]"""
        return self.present * self.section.mass * self.length

    def spin_inertia(self, axis: float) -> Array:
        """About the curve [kg m²]."""
        return self.present * self.length * self.section.spin_inertia + self.mass * (self.height - axis) ** 2


def add_laminate(found: Collected, scene: SceneConfig, copy: RodCopy, body_index: dict[str, int]) -> None:
    """Add one copy of a rod: a strand with the stiffness and mass of its layers, and their drag."""
    rod, name = copy.rod, copy.name
    layers = _placed(scene, rod)
    axis = _axis_of(scene, rod)
    nodes = np.arange(stations_of(rod)[1] + 1)
    shape = strand_shape(rod, np.full(len(nodes), axis), 0, nodes[-1], copy.place)
    halves = [
        layer_halves(scene, rod, slot, axis, shape, layer.length / shape.lengths, layer.present)
        for slot, layer in enumerate(layers)
    ]
    whole = WholeSection(scene, rod, halves, shape)
    low, high = _faces(rod, axis)
    strand_name = rod.layers[0].name if len(rod.layers) == 1 else NAME
    strand = StrandArrays(
        name=f"{name}/{strand_name}",
        rod=name,
        layer=strand_name,
        first_station=0,
        first_node=found.node_count,
        node_count=len(nodes),
        first_edge=found.edge_count,
        width=outline(rod, nodes)[0],
        thickness=high - low,
        offset=0.5 * (high + low),
        curvature=shape.curvature,
        closed=shape.closed,
    )
    if len(rod.layers) > 1:
        strand = replace(strand, layers=_drawn_layers(rod, axis, strand))
    elements = StrandElements(
        edge_mass=sum(layer.mass for layer in layers),
        spin_inertia=sum(layer.spin_inertia(axis) for layer in layers),
        half_width=0.5 * layers[0].section.width,
        axial_stiffness=whole.axial_stiffness,
        rest_strain=whole.rest_strain,
        joint_stiffness=whole.joint_stiffness,
        joint_rest=whole.joint_rest,
        node_radius=np.maximum(high, -low),
        retardation_time=scene.materials[rod.layers[0].material].retardation_time,
    )
    moment = sum(layer.mass * (layer.height - axis) for layer in layers)
    moment[-1] *= not strand.closed
    found.add(mass_moment=moment)
    found.rods.append([(0, int(nodes[-1]), strand.first_node, strand.first_edge)])
    found.path_height.append(-axis)
    joints = add_strand(found, scene, rod, strand, shape, elements, body_index)
    coupling = whole.strain_coupling()
    coupled = coupling.any(axis=1) & (joints >= 0)
    found.add(coupled_joint=joints[coupled], strain_coupling=coupling[coupled])
    for layer, half in zip(rod.layers, halves, strict=True):
        _add_eigenstrain(found, scene, rod, layer, whole, half, strand.first_edge, axis, joints)
    add_fluid(found, scene.fluid, rod, found.rods[-1])


def _placed(scene: SceneConfig, rod: Rod) -> list[_Placed]:
    return scene.keep("layers in place", (rod,), lambda: _layers_in_place(scene, rod))


def _axis_of(scene: SceneConfig, rod: Rod) -> float:
    return scene.keep("axis", (rod,), lambda: _axis(_placed(scene, rod)))


def _layers_in_place(scene: SceneConfig, rod: Rod) -> list[_Placed]:
    last_node = stations_of(rod)[1]
    nodes, edges = rod.on_path(np.arange(last_node + 1)), np.arange(last_node)
    own = edges % (rod.stations - 1)
    layers = []
    for slot, layer in enumerate(rod.layers):
        first, last = rod.covered_stations(layer)
        height = side(rod, slot) * values_at(layer.thickness, rod.edge_length * nodes)
        section = sections(rod, layer, scene.materials[layer.material], edges + 0.5)
        layers.append(
            _Placed(
                section,
                (first <= own) & (own < last),
                strand_shape(rod, height, 0, last_node, placed()).lengths,
                side(rod, slot) * section.thickness,
            )
        )
    return layers


def _axis(layers: list[_Placed]) -> float:
    """Height over the path [m] of the neutral axis where most edges have the same layers, mean over these.

    B = 0 there: Σ (EA/λ) (y − y₀) = 0 with λ in proportion to the layers' lengths, whatever y₀ is.
    """
    present = np.array([layer.present for layer in layers])
    kinds, kind, count = np.unique(present, axis=1, return_inverse=True, return_counts=True)
    prevailing = max(range(len(count)), key=lambda k: (count[k], kinds[:, k].sum()))
    there = kind.reshape(-1) == prevailing
    weight = [(layer.present * layer.section.axial_stiffness / layer.length)[there] for layer in layers]
    moment = sum(np.vdot(w, layer.height[there]) for w, layer in zip(weight, layers, strict=True))
    return float(moment / np.sum(weight))


def _faces(rod: Rod, axis: float) -> tuple[Array, Array]:
    """Heights of the two faces over the curve at each node [m]."""
    _, layers = outline(rod, np.arange(stations_of(rod)[1] + 1))
    if len(layers) == 1:
        return -0.5 * layers[0] - axis, 0.5 * layers[0] - axis
    return -layers[0] - axis, layers[1] - axis


def _drawn_layers(rod: Rod, axis: float, strand: StrandArrays) -> tuple[StrandArrays, ...]:
    """Each layer on those nodes of a laminate's strand where it is."""
    _, thickness = outline(rod, np.arange(strand.node_count))
    layers = []
    for slot, layer in enumerate(rod.layers):
        first, last = stations_of(rod, layer)
        own = slice(first, last + 1)
        layers.append(
            replace(
                strand,
                name=f"{strand.rod}/{layer.name}",
                layer=layer.name,
                first_station=first,
                first_node=strand.first_node + first,
                node_count=last - first + 1,
                first_edge=strand.first_edge + first,
                width=strand.width[own],
                thickness=thickness[slot, own],
                offset=side(rod, slot) * thickness[slot, own] - axis,
                curvature=strand.curvature[own],
                closed=is_closed(rod, first, last),
            )
        )
    return tuple(layers)


def uneven_faces(rod: Rod, scene: SceneConfig) -> Iterator[Figure]:
    """Where contact of a rod with rods counts from a face that is not where the nearer one is."""
    rod = rod.copies[0].rod  # whose layers are those of all
    low, high = _faces(rod, _axis_of(scene, rod))
    difference = np.abs(high + low)
    if np.any(difference > UNEVEN * np.maximum(high, -low)):
        near, far = np.minimum(high, -low).min(), np.maximum(high, -low).max()
        yield Figure(
            f"rods.{rod.name}",
            "faces are",
            f"{1e3 * near:.3g} to {1e3 * far:.3g} mm from the laminate's curve",
            f"equal within {100 * UNEVEN:g} %",
            float((difference / np.maximum(high, -low)).max()) / UNEVEN,
            "contact with rods counts from the farther one on both sides: the nearer feels them up to "
            f"{1e3 * difference.max():.3g} mm too early",
        )


def _add_eigenstrain(
    found: Collected,
    scene: SceneConfig,
    rod: Rod,
    layer: Layer,
    whole: WholeSection,
    half: LayerHalves,
    first_edge: int,
    axis: float,
    joints: Array,
) -> None:
    """The rest strains of edges and joints that follow the laws of a layer, or where that is a light, of each edge."""
    for law in layer.eigenstrain:
        edges = np.array(rod.driven_edges(layer, law))
        if is_light(scene, law):
            heights = np.full(rod.stations - 1, axis)
            laws = add_lit_elements(found, scene, rod, layer, law, first_edge, heights)
            groups = [
                (number, with_copies(rod, own)) for number, own in zip(laws.tolist(), edges[:, None], strict=True)
            ]
        else:
            groups = [(found.law(scene, law), with_copies(rod, edges))]
        for number, driven in groups:
            of_edges, nodes, of_nodes = whole.driven(half, driven)
            bent = (of_nodes != 0.0) & (joints[nodes] >= 0)
            found.add(
                driven_edge=first_edge + driven,
                driven_law=np.full(len(driven), number),
                driven_weight=of_edges,
                driven_joint=joints[nodes[bent]],
                driven_joint_law=np.full(np.count_nonzero(bent), number),
                driven_joint_weight=of_nodes[bent],
            )
