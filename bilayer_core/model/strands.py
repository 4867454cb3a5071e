"""Strands: chains of nodes, edges and joints, whatever they stand for, and the place where rods are collected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..kinematics.rest_strains import cross, rest_strains
from ..kinematics.rotation import rotation_matrix
from ..scene.config import SceneConfig
from ..scene.eigenstrain import Eigenstrain
from ..scene.pattern import Placement
from ..scene.rod import Layer, Rod
from .imperfection import departure
from .strand_arrays import StrandArrays

Array = np.ndarray
Span = tuple[int, int, int, int]
"""First and last station, first node, first edge of a strand."""


@dataclass
class Collected:
    """What grows while rods are added one after the other."""

    strands: list[StrandArrays] = field(default_factory=list)
    rods: list[list[Span]] = field(default_factory=list)
    path_height: list[float] = field(default_factory=list)
    """Of the path of each rod over its only strand [m]; 0 where two strands lie on either side of it."""
    columns: dict[str, list] = field(default_factory=dict)
    laws: list[tuple[float, ...]] = field(default_factory=list)
    """Channel, time constants rising and falling, gain, reference, saturation of each eigenstrain law."""
    node_count: int = 0
    edge_count: int = 0
    joint_count: int = 0

    def add(self, **values) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(np.atleast_1d(value))

    def column(self, name: str, dtype=float, width: int | None = None) -> Array:
        parts = self.columns.get(name)
        if not parts:
            array = np.zeros((0,) if width is None else (0, width), dtype)
        else:
            array = np.concatenate(parts).astype(dtype)
        return np.ascontiguousarray(array)

    def law(self, scene: SceneConfig, law: Eigenstrain) -> int:
        """Number of an eigenstrain law; equal laws are one."""
        numbers = _numbers_of(scene, law)
        if numbers not in self.laws:
            self.laws.append(numbers)
        return self.laws.index(numbers)

    def laws_of_elements(self, scene: SceneConfig, law: Eigenstrain, count: int) -> Array:
        """Numbers of laws of their own for so many elements of a layer, which light reaches differently."""
        first = len(self.laws)
        self.laws += [_numbers_of(scene, law)] * count
        return first + np.arange(count)


def _numbers_of(scene: SceneConfig, law: Eigenstrain) -> tuple[float, ...]:
    return (list(scene.stimuli).index(law.stimulus), *law.lags, law.gain, law.reference, law.limit)


@dataclass(frozen=True)
class StrandShape:
    """A strand at the start: its nodes [m], the lengths [m] and frames of its edges, the frames of the path at its two
    ends, and what an imperfection adds to the rest values of a layer that are not those of the start.
    """

    positions: Array  # shape (n_node, 3)
    lengths: Array  # shape (n_edge,)
    tangents: Array  # shape (n_edge, 3)
    normals: Array  # likewise
    end_tangents: Array  # shape (2, 3)
    end_normals: Array  # likewise
    imperfection: Array  # κ₁ κ₂ ψ [rad], shape (n_node, 3)
    handedness: float  # −1 of a mirror image, 1 of any other
    closed: bool = False  # see `model.strand_arrays`

    @property
    def voronoi(self) -> Array:
        """Half the lengths of the edges at each node [m], shape (n_node,)."""
        return self._round(halves_to_nodes(self.lengths))

    def _round(self, of_nodes: Array) -> Array:
        """What nodes have, that of a closed strand's first and last node as that of the nodes that they stand for."""
        if self.closed:
            of_nodes[0], of_nodes[-1] = of_nodes[-2], of_nodes[1]
        return of_nodes

    @property
    def curvature(self) -> Array:
        """χ at each node [1/m], shape (n_node,)."""
        return self._strains[:, 0] / self.voronoi

    def strains(self) -> Array:
        """κ₁ κ₂ ψ [rad] at each node: between the edges at it, at the ends between path and edge, shape (n_node, 3)."""
        return self._strains.copy()

    @cached_property
    def _strains(self) -> Array:
        tangents = np.concatenate([self.end_tangents[:1], self.tangents, self.end_tangents[1:]])
        normals = np.concatenate([self.end_normals[:1], self.normals, self.end_normals[1:]])
        return self._round(rest_strains(tangents[:-1], normals[:-1], tangents[1:], normals[1:]))


def stations_of(rod: Rod, layer: Layer | None = None) -> tuple[int, int]:
    """First and last station of the strand of a layer, or of the whole rod: one beyond those of the path if it is
    closed.
    """
    first, last = (0, rod.stations - 1) if layer is None else rod.covered_stations(layer)
    return first, last + int(is_closed(rod, first, last))


def is_closed(rod: Rod, first: int, last: int) -> bool:
    """Whether the strand over these stations of a rod has no ends."""
    return rod.closed and first == 0 and last >= rod.stations - 1


def with_copies(rod: Rod, edges: Array) -> Array:
    """Edges of the path of a rod, and the copy of the first one of a closed rod if that is among them."""
    return np.append(edges, rod.stations - 1) if rod.closed and 0 in edges else edges


def strand_shape(rod: Rod, height: Array, first: int, last: int, place: Placement) -> StrandShape:
    """Shape of the strand that lies `height` [m] over the path at the stations from first to last."""
    shape = _shape(rod, height, first, last, place, Rod.frames_at)
    if rod.imperfection is None:
        return shape
    imperfect = _shape(rod, height, first, last, place, _imperfect_frames)
    return replace(imperfect, imperfection=imperfect.strains() - shape.strains())


def _imperfect_frames(rod: Rod, arc: Array) -> tuple[Array, Array, Array]:
    """Those of the path with the imperfection: points x + f n + g t×n."""
    points, tangents, normals = rod.frames_at(arc)
    (f, g), slopes = (part.T[..., None] for part in departure(rod, arc))
    along = _tangents_beside(rod, arc, tangents, normals, (f, g), slopes)
    return points + f * normals + g * cross(tangents, normals), along, _across(normals, along)


def _tangents_beside(
    rod: Rod, arc: Array, tangents: Array, normals: Array, offset: tuple[Array, Array], slopes: tuple[Array, Array]
) -> Array:
    """Unit tangents of a curve at the offset (f, g) from the path, x + f n + g t×n: those of

    (1 − χ f − ξ g) t + (f′ − τ g) n + (g′ + τ f) t×n
    """
    (f, g), (slope_f, slope_g) = offset, slopes
    towards, across, twist = rod.curvatures_at(arc).T[..., None]
    along = (1.0 - towards * f - across * g) * tangents + (slope_f - twist * g) * normals
    along = along + (slope_g + twist * f) * cross(tangents, normals)
    return along / np.linalg.norm(along, axis=1, keepdims=True)


def _shape(
    rod: Rod,
    height: Array,
    first: int,
    last: int,
    place: Placement,
    frames_at: Callable[[Rod, Array], tuple[Array, Array, Array]],
) -> StrandShape:
    arc = rod.edge_length * rod.on_path(np.arange(first, last + 1))
    points, tangents, normals = frames_at(rod, arc)
    _, _, middle_normals = frames_at(rod, rod.edge_length * rod.on_path(np.arange(first, last) + 0.5))
    positions = place.points(points + height[:, None] * normals)
    closed = is_closed(rod, first, last)
    if closed:  # to the last digit
        positions[-2:], middle_normals[-1] = positions[:2], middle_normals[0]
    edges = np.diff(positions, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    edge_tangents = edges / lengths[:, None]
    ends = [0, -1]
    away = height[ends, None]
    slopes = (height[[1, -1]] - height[[0, -2]])[:, None] / rod.edge_length  # of a layer whose thickness varies
    end_tangents = place.directions(
        _tangents_beside(rod, arc[ends], tangents[ends], normals[ends], (away, 0.0 * away), (slopes, 0.0 * away))
    )
    return StrandShape(
        positions,
        lengths,
        edge_tangents,
        _across(place.directions(middle_normals), edge_tangents),
        end_tangents,
        _across(place.directions(normals[ends]), end_tangents),
        np.zeros((len(positions), 3)),
        place.handedness,
        closed,
    )


def _across(normals: Array, tangents: Array) -> Array:
    """Normals made perpendicular to tangents, unit, shape (n, 3)."""
    normals = normals - np.einsum("ij,ij->i", normals, tangents)[:, None] * tangents
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@dataclass(frozen=True)
class StrandElements:
    """Inertia and stiffness of a strand's edges, and of its joints as if there was one at every node."""

    edge_mass: Array  # [kg], shape (n_edge,)
    spin_inertia: Array  # [kg m²], shape (n_edge,)
    half_width: Array  # [m], shape (n_edge,)
    axial_stiffness: Array  # EA [N], shape (n_edge,)
    rest_strain: Array  # without stimuli, shape (n_edge,)
    joint_stiffness: Array  # k₁ k₂ k₃ [N m], shape (n_node, 3)
    joint_rest: Array  # κ̄₁ κ̄₂ ψ̄ [rad] without stimuli, shape (n_node, 3)
    node_radius: Array  # from which contact counts [m], shape (n_node,)
    retardation_time: float  # [s]


def add_strand(
    found: Collected,
    scene: SceneConfig,
    rod: Rod,
    strand: StrandArrays,
    shape: StrandShape,
    elements: StrandElements,
    body_index: dict[str, int],
) -> Array:
    """Add a strand: joints at inner nodes, and where a body holds an end of the rod that the strand reaches.

    Returns
    -------
    ndarray
        The joint of each node, −1 for free ends, shape (n_node,).
    """
    nodes, edges = strand.node_count, strand.node_count - 1
    first_edge, first_node = strand.first_edge, strand.first_node
    voronoi, index = shape.voronoi, np.arange(nodes)
    own_nodes, own_edges = np.ones(nodes), np.ones(edges)
    if strand.closed:
        own_nodes[[0, -1]] = own_edges[-1] = 0.0
        found.add(
            joined_node=first_node + np.array([[0, nodes - 2], [1, nodes - 1]]),
            joined_edge=np.array([[first_edge, first_edge + edges - 1]]),
        )
    found.strands.append(strand)
    found.add(
        position=shape.positions,
        tangent=shape.tangents,
        director1=shape.normals,
        edge_mass=own_edges * elements.edge_mass,
        node_mass=own_nodes * halves_to_nodes(elements.edge_mass),
        node_length=own_nodes * voronoi,
        node_radius=elements.node_radius,
        node_edges=first_edge + np.stack([np.maximum(index - 1, 0), np.minimum(index, edges - 1)], axis=1),
        node_axis=np.full(nodes, {"path": 0, "normal": 1, "across": 2 * int(shape.handedness)}[rod.friction_axis]),
        spin_inertia=own_edges * elements.spin_inertia,
        half_width=elements.half_width,
        edge_node=first_node + np.arange(edges),
        rest_length=shape.lengths,
        axial_stiffness=own_edges * elements.axial_stiffness,
        rest_strain=elements.rest_strain,
        edge_time=np.full(edges, elements.retardation_time),
    )
    joints = np.full(nodes, -1)
    inner = np.arange(1, nodes - 1)

    def add_joints(at: Array, first: Array, second: Array) -> None:
        joints[at] = found.joint_count + np.arange(len(at))
        found.joint_count += len(at)
        found.add(
            joint_a=first,
            joint_b=second,
            joint_stiffness=elements.joint_stiffness[at],
            joint_rest=elements.joint_rest[at],
            joint_time=np.full((len(at), 3), elements.retardation_time),
            joint_node=first_node + at,
            voronoi_length=voronoi[at],
        )

    add_joints(inner, first_edge + inner - 1, first_edge + inner)
    last = strand.first_station + nodes - 1
    reaches = ((rod.clamp_start, strand.first_station == 0, 0), (rod.clamp_end, last == rod.stations - 1, -1))
    for clamp, reached, end in reaches:
        if clamp is None or not reached:
            continue
        body = body_index[clamp]
        own = rotation_matrix(np.array(scene.bodies[body].rotation))  # columns: axes of the body's frame
        clamp_edge = -1 - len(found.columns.get("clamp_edge_tangent", []))
        node = end % nodes
        pair = (clamp_edge, first_edge) if end == 0 else (first_edge + edges - 1, clamp_edge)
        found.add(
            clamp_edge_tangent=shape.end_tangents[[end]] @ own,
            clamp_edge_director1=shape.end_normals[[end]] @ own,
            attached_node=first_node + node,
            attached_body=body,
            attached_position=(shape.positions[end] - np.array(scene.bodies[body].position))[None] @ own,
        )
        add_joints(np.array([node]), *(np.array([edge]) for edge in pair))
    found.node_count += nodes
    found.edge_count += edges
    return joints


def halves_to_nodes(of_edges: Array) -> Array:
    """What edges have, half of it at each of their nodes, shape (n_edge + 1,)."""
    of_nodes = np.zeros(len(of_edges) + 1)
    of_nodes[:-1] += 0.5 * of_edges
    of_nodes[1:] += 0.5 * of_edges
    return of_nodes
