"""Two bonded rods: each layer of a rod is a strand of its own, and bonds join them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bilayer_core.kinematics.frame_strains import rest_strains
from bilayer_core.model.findings import Figure
from bilayer_core.model.immersed import add_fluid
from bilayer_core.model.lit_elements import add_lit_elements, is_light
from bilayer_core.model.section import Section, bond, outline, sections
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.model.strands import (
    Collected,
    Span,
    StrandElements,
    StrandShape,
    add_strands,
    stations_of,
    strand_shape,
    with_copies,
)
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import responses
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.profile import means_between
from bilayer_core.scene.rod import Layer, Rod, RodCopy

Array = np.ndarray
_OUTWARD = (-1.0, 1.0)
"""Which way along the normal the outer face of each of two layers looks."""


def add_bonded_rods(found: Collected, scene: SceneConfig, rod: Rod, body_index: dict[str, int]) -> None:
    """Add all copies of a rod: their strands, their drag, and the bonds between them."""
    for copy in rod.copies:
        _add_copy(found, scene, copy, body_index)


def _add_copy(found: Collected, scene: SceneConfig, copy: RodCopy, body_index: dict[str, int]) -> None:
    rod, name = copy.rod, copy.name
    strands: list[_Bonded] = []
    for slot, layer in enumerate(rod.layers):
        first, last = stations_of(rod, layer)
        at_nodes, at_edges = _sections(scene, rod, layer, first, last)
        side = 0.0 if len(rod.layers) == 1 else 0.5 * _OUTWARD[slot]
        shape = strand_shape(rod, side * at_nodes.thickness, first, last, copy.place)
        strand = StrandArrays(
            name=f"{name}/{layer.name}",
            rod=name,
            layer=layer.name,
            first_station=first,
            first_node=found.node_count,
            node_count=last - first + 1,
            first_edge=found.edge_count,
            width=at_nodes.width,
            thickness=at_nodes.thickness,
            offset=np.zeros(last - first + 1),
            curvature=shape.curvature,
            closed=shape.closed,
            round=rod.radius is not None,
        )
        time, modulus = scene.materials[layer.material].retardation_time, found.modulus(scene, rod, layer)
        elements = _elements(rod, layer, at_nodes, at_edges, shape, time, modulus)
        joints = add_strands(found, scene, rod, [strand], shape, elements, body_index)[0]
        _add_eigenstrain(found, scene, rod, slot, strand, shape, joints)
        strands.append(_Bonded(first, strand.first_node, strand.first_edge, shape, elements, joints))
    found.rods.append([strand.span for strand in strands])
    found.path_height.append(0.0)
    add_fluid(found, scene.fluid, rod, found.rods[-1:])
    if len(strands) == 2:
        _add_bond(found, scene, rod, *strands)


def snapped_layers(scene: SceneConfig) -> Iterator[Figure]:
    """Yield the layers that end between stations, where two rods begin and end at stations."""
    for rod in scene.rods:
        for layer in rod.layers:
            span, stations = rod.span_of(layer), rod.covered_stations(layer)
            off = rod.edge_length * max(abs(a - b) for a, b in zip(span, stations, strict=True))
            if off > SNAPPED * rod.path.length:
                begin, end = (1e3 * rod.edge_length * station for station in stations)
                yield Figure(
                    f"rods.{rod.name}.layers.{layer.name}",
                    "two rods have it",
                    f"from {begin:.4g} to {end:.4g} mm",
                    f"interval: from {1e3 * layer.interval[0]:.4g} to {1e3 * layer.interval[1]:.4g} mm",
                    off,
                    "its stiffness, mass and natural curvature go from station to station (its eigenstrain has the "
                    "length of the interval); `model: laminate`, or stations at its ends, have all as they are",
                )


SNAPPED = 1e-6
"""Of the path: an end as near as this to a station is there."""


@dataclass(frozen=True)
class _Bonded:
    """A layer's strand: its first station, node and edge, and what `add_strand` was given and has returned."""

    first: int
    first_node: int
    first_edge: int
    shape: StrandShape
    elements: StrandElements
    joints: Array

    @property
    def last(self) -> int:
        """Its last station."""
        return self.first + len(self.joints) - 1

    @property
    def span(self) -> Span:
        return self.first, self.last, self.first_node, self.first_edge


def _sections(scene: SceneConfig, rod: Rod, layer: Layer, first: int, last: int) -> tuple[Section, Section]:
    """Return the sections of a layer at the stations from first to last, and in the middle of the edges between
    them.
    """
    material = scene.materials[layer.material]
    stations = np.arange(first, last + 1)
    return sections(rod, layer, material, stations), sections(rod, layer, material, stations[:-1] + 0.5)


def _elements(
    rod: Rod, layer: Layer, at_nodes: Section, at_edges: Section, shape: StrandShape, time: float, modulus: int
) -> StrandElements:
    stiffness = np.stack([*at_nodes.bending_stiffness, at_nodes.twisting_stiffness], axis=1)
    return StrandElements(
        edge_mass=at_edges.mass * shape.lengths,
        spin_inertia=at_edges.spin_inertia * shape.lengths,
        half_width=0.5 * at_edges.width,
        axial_stiffness=at_edges.axial_stiffness,
        rest_strain=np.zeros(len(shape.lengths)),
        joint_stiffness=stiffness / shape.voronoi[:, None],
        joint_rest=_rest(rod, layer, shape),
        node_radius=0.5 * at_nodes.thickness,
        retardation_time=time,
        modulus=modulus,
    )


def _rest(rod: Rod, layer: Layer, shape: StrandShape) -> Array:
    """Return κ̄₁ κ̄₂ ψ̄ of a layer at its nodes [rad]: its natural shape, by default that at the start, shape (n_node,
    3).
    """
    first, last = stations_of(rod, layer)
    along, rest, voronoi = rod.on_path(np.arange(first, last + 1)), shape.strains(), shape.voronoi
    begin, end = along - 0.5, along + 0.5
    if not shape.closed:
        begin, end = np.maximum(begin, first), np.minimum(end, last)
    for axis, sign, own in (
        (0, 1.0, layer.natural_curvature),
        (1, shape.handedness, layer.natural_curvature_across),
        (2, shape.handedness, layer.natural_twist),
    ):
        if own is None:
            continue
        natural = sign * means_between(own, rod.edge_length * begin, rod.edge_length * end) * voronoi
        rest[:, axis] = natural + (rest if axis == 2 else shape.imperfection)[:, axis]
    return rest


def _add_eigenstrain(
    found: Collected,
    scene: SceneConfig,
    rod: Rod,
    slot: int,
    strand: StrandArrays,
    shape: StrandShape,
    joints: Array,
) -> None:
    """Add the edges of a layer that follow its laws, and the joints that follow the gradient of a field in it."""
    layer = rod.layers[slot]
    first_edge = strand.first_edge - strand.first_station
    for law, hat in (
        part
        for given in layer.eigenstrain
        for part in ([(given, None)] if is_light(scene, given) else given.at_points(rod.path.length))
    ):
        edges, weight = _driven(rod, layer, law, strand)
        if hat is not None:
            begin, end = rod.span_of(layer, law)
            begin, end = np.maximum(edges, begin), np.minimum(edges + 1.0, end)
            weight = weight * means_between(hat, rod.edge_length * begin, rod.edge_length * end)
        if is_light(scene, law):
            _, thickness = outline(rod, np.arange(rod.stations - 1) + 0.5)
            axis = 0.0 * thickness[0] if len(rod.layers) == 1 else _OUTWARD[slot] * 0.5 * thickness[slot]
            groups = [(add_lit_elements(found, scene, rod, layer, law, edges, first_edge, axis), weight)]
        else:
            groups = [
                (
                    np.tile(found.law(scene, law, response), (len(edges), 1)),
                    weight if response.along is None else weight * response.along[edges],
                )
                for response in responses(rod, layer, law)
            ]
        driven = with_copies(rod, edges) if strand.closed else edges
        for laws, weight in groups:
            laws, weight = (np.concatenate([of, of[edges == 0]])[: len(driven)] for of in (laws, weight))
            found.add(driven_edge=first_edge + driven, driven_law=laws[:, 0], driven_weight=weight)
            if laws[0, 1] >= 0:
                own = driven - strand.first_station
                turned = -0.5 * weight * shape.lengths[own] / layer.thickness  # of a half edge
                for at in (own, own + 1):
                    held = joints[at] >= 0
                    found.add(
                        driven_joint=joints[at][held],
                        driven_joint_law=laws[held, 1],
                        driven_joint_weight=turned[held],
                    )


def _driven(rod: Rod, layer: Layer, law: Eigenstrain, strand: StrandArrays) -> tuple[Array, Array]:
    """Return the edges of the path that a law drives in a strand, and the part of its eigenstrain that each has.

    A strand goes from station to station. What the law drives beyond its ends, less than half an edge, is added to
    the last edges, so that the layer grows by as much as the scene says.
    """
    first, last = strand.first_station, strand.first_station + strand.shown - 1
    begin, end = rod.span_of(layer, law)
    edges = np.arange(first, last)
    weight = rod.covered_parts(edges, layer, law)
    weight[0] += max(0.0, min(end, first) - begin)
    weight[-1] += max(0.0, end - max(begin, last))
    return edges[weight > 0.0], weight[weight > 0.0]


def _add_bond(found: Collected, scene: SceneConfig, rod: Rod, bottom: _Bonded, top: _Bonded) -> None:
    """Add the bonds of paired edges; the rest values are those of the initial shape."""
    first, last = max(bottom.first, top.first), min(bottom.last, top.last, rod.stations - 1)
    (_, below), (_, above) = (_sections(scene, rod, layer, first, last) for layer in rod.layers)
    law = bond(below, above, scene.coupling, rod.torsion)
    position, tangent, m1 = (found.column(name, width=3) for name in ("position", "tangent", "director1"))
    edges = [layer.first_edge + np.arange(first, last) - layer.first for layer in (top, bottom)]
    nodes = [layer.first_node + np.arange(first, last) - layer.first for layer in (top, bottom)]
    middles = [0.5 * (position[start] + position[start + 1]) for start in nodes]
    frames = [(tangent[edge], m1[edge]) for edge in edges]
    between = middles[0] - middles[1]
    mean = [0.5 * (frames[0][1] + frames[1][1]), 0.5 * (frames[0][0] + frames[1][0])]  # m1 and the tangent
    across = 0.5 * (np.cross(*frames[0]) + np.cross(*frames[1]))
    length = found.column("rest_length")
    weight = 0.5 * (length[edges[0]] + length[edges[1]])
    times = [strand.elements.retardation_time for strand in (bottom, top)]
    shear = [section.shear_modulus * section.thickness for section in (below, above)]
    shear_time = (times[0] * shear[1] + times[1] * shear[0]) / (shear[0] + shear[1])
    bonds = len(found.column("bond_joint_a")) + np.arange(last - first)
    rest = np.stack([np.einsum("ij,ij->i", between, m) for m in (mean[0], across, mean[1])], axis=1)
    found.add(
        bond_joint_a=edges[0],
        bond_joint_b=edges[1],
        bond_joint_stiffness=weight[:, None] * np.stack([law.bending, law.tilt, law.twist], axis=1),
        bond_joint_time=np.stack([0.0 * weight, shear_time, 0.0 * weight], axis=1),
        bond_joint_rest=rest_strains(*frames[0], *frames[1]),
        bond_joint_node=np.full(last - first, -1),
        bond_share=shear[1] / (shear[0] + shear[1]),
        pair_modulus=np.full(last - first, -1),
        pair_joint=-1 - bonds,
        pair_node=np.stack([nodes[0], nodes[0] + 1, nodes[1], nodes[1] + 1], axis=1),
        pair_weight=np.full((last - first, 2), 0.5),
        pair_stiffness=np.repeat((weight * law.translation)[:, None], 3, axis=1),
        pair_rest=rest,
        pair_time=np.zeros((last - first, 3)),
    )
    if bottom.shape.closed and top.shape.closed:
        return
    for station, pair, side in ((first, 0, 1.0), (last, -1, -1.0)):
        for slot in range(2):
            _add_end(found, (top, bottom), slot, station, bonds[pair], rest[pair, 0], side)


def _add_end(
    found: Collected, pair: tuple[_Bonded, _Bonded], slot: int, station: int, bond: int, distance: float, side: float
) -> None:
    """Add the bending and twist of a layer in the half edges at a station where it or the other one ends
    (`forces.bond`).

    Parameters
    ----------
    pair : tuple
        Top and bottom layer, of which `slot` is meant.
    bond : int
        Of the paired edges there, which are `distance` [m] apart.
    side : float
        1 where the bonded part begins, −1 where it ends.
    """
    layer = pair[slot]
    own, last_edge = station - layer.first, len(layer.joints) - 2
    if 0 < own <= last_edge:
        joint, edges, weight, natural = layer.joints[own], [own - 1, own], np.ones(2), np.zeros(3)
    elif layer.joints[own] >= 0:
        return  # clamped
    else:
        joint, edges, weight = -1 - bond, [min(own, last_edge)], np.eye(2)[slot]
        natural = side * (layer.elements.joint_rest[own] - layer.shape.strains()[own])
    tangent, m1 = layer.shape.tangents[edges], layer.shape.normals[edges]
    top, bottom = (strand.first_node + station - strand.first for strand in pair)
    position = found.column("position", width=3)
    start = np.array(
        [frame.sum(axis=0) @ (position[top] - position[bottom]) for frame in (m1, np.cross(tangent, m1), tangent)]
    )
    bend, _, twist = layer.elements.joint_stiffness[own] / distance**2
    found.add(
        end_joint=joint,
        end_node=[[top, top, bottom, bottom]],
        end_weight=weight[None],
        end_stiffness=[[0.0, twist, bend]],
        end_time=np.full((1, 3), layer.elements.retardation_time),
        end_modulus=layer.elements.modulus,
        end_rest=[start + distance * np.array([0.0, -natural[2], natural[0]])],
    )
