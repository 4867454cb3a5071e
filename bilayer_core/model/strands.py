"""Strands: chains of nodes, edges and joints, whatever they stand for, and the place where rods are collected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bilayer_core.kinematics.frame_strains import cross, rest_strains
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.imperfect_shapes import departure
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.diffusion_modes import Response, VariedModes, responses
from bilayer_core.scene.eigenstrain import Following
from bilayer_core.scene.pattern import Placement
from bilayer_core.scene.rod import Layer, Rod

Array = np.ndarray
Span = tuple[int, int, int, int]
"""First and last station, first node, first edge of a strand."""


@dataclass
class Collected:
    """Strands, rods, laws and arrays, which grow while rods are added one after the other."""

    strands: list[StrandArrays] = field(default_factory=list)
    rods: list[list[Span]] = field(default_factory=list)
    path_height: list[float] = field(default_factory=list)
    """Of the path of each rod over its only strand [m]; 0 where two strands lie on either side of it."""
    columns: dict[str, list] = field(default_factory=dict)
    fields: list[tuple[int, tuple[tuple[float, float], ...], VariedModes | None]] = field(default_factory=list)
    """Channel, time constants rising and falling of the modes, and what varies, of all that follows a stimulus."""
    laws: list[tuple[int, tuple[float, ...], float, float, float]] = field(default_factory=list)
    """Field, weights of its modes, gain, reference, saturation of each eigenstrain law."""
    moduli: list[int] = field(default_factory=list)
    """Law of each multiple of elastic moduli (`forces.moduli`)."""
    node_count: int = 0
    edge_count: int = 0
    joint_count: int = 0
    clamp_count: int = 0

    def add(self, **values) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(np.atleast_1d(value))

    def column(self, name: str, dtype=float, width: int | None = None) -> Array:
        parts = self.columns.get(name)
        if not parts:
            return np.zeros((0,) if width is None else (0, width), dtype)
        return np.concatenate(parts).astype(dtype, order="C", copy=False)

    def law(self, scene: SceneConfig, law: Following, response: Response, alone: bool = False) -> tuple[int, int]:
        """Return the numbers of new laws for mean and gradient of a response, the latter −1 without one; laws follow
        the same field where they may, unless this one is for one element `alone`, which light reaches differently.
        """
        followed = list(scene.stimuli).index(law.stimulus), response.lags, response.varied
        laws = [(response.mean, law.gain, response.mean_reference, law.limit)]
        if response.gradient:
            laws.append((response.gradient, law.gain, response.gradient_reference, law.limit))
        shared = not alone and followed in self.fields
        field = self.fields.index(followed) if shared else len(self.fields)
        if not shared:
            self.fields.append(followed)
        self.laws += [(field, *own) for own in laws]
        return len(self.laws) - len(laws), len(self.laws) - 1 if response.gradient else -1

    def modulus(self, scene: SceneConfig, rod: Rod, layer: Layer) -> int:
        """Return the number of the multiple of a layer's elastic moduli, −1 where these stay; equal ones are one."""
        if layer.stiffness_change is None:
            return -1
        (response,) = responses(rod, layer, layer.stiffness_change)
        law, _ = self.law(scene, layer.stiffness_change, replace(response, gradient=()))
        equal = [number for number, other in enumerate(self.moduli) if self.laws[other] == self.laws[law]]
        if equal:
            self.laws.pop()
            return equal[0]
        self.moduli.append(law)
        return len(self.moduli) - 1


@dataclass(frozen=True)
class StrandShape:
    """A strand at the start: its nodes [m], the lengths [m] and frames of its edges, the frames of the path at its two
    ends, and what an imperfection adds to the rest values of a layer that are not those of the start.

    Of several copies of a rod at once, all arrays have one index more, the first.
    """

    positions: Array  # shape (n_node, 3)
    lengths: Array  # shape (n_edge,)
    tangents: Array  # shape (n_edge, 3)
    normals: Array  # likewise
    end_tangents: Array  # shape (2, 3)
    end_normals: Array  # likewise
    imperfection: Array  # κ₁ κ₂ ψ [rad], shape (n_node, 3)
    handedness: Array | float  # −1 of a mirror image, 1 of any other
    closed: bool = False  # see `model.strand_arrays`

    @cached_property
    def voronoi(self) -> Array:
        """Half the lengths of the edges at each node [m], shape (n_node,)."""
        voronoi = halves_to_nodes(self.lengths)
        self._close(voronoi)
        return voronoi

    def _close(self, of_nodes: Array) -> None:
        """Let the first and last node of a closed strand have what the nodes have that they stand for; of nodes is the
        last index.
        """
        if self.closed:
            of_nodes[..., 0], of_nodes[..., -1] = of_nodes[..., -2], of_nodes[..., 1]

    @property
    def curvature(self) -> Array:
        """χ at each node [1/m], shape (n_node,)."""
        return self._strains[..., 0] / self.voronoi

    def strains(self) -> Array:
        """Return κ₁ κ₂ ψ [rad] at each node: between the edges at it, at the ends between path and edge, shape (n_node,
        3).
        """
        return self._strains.copy()

    @cached_property
    def _strains(self) -> Array:
        frames = []
        for ends, of_edges in ((self.end_tangents, self.tangents), (self.end_normals, self.normals)):
            all_edges = np.concatenate([ends[..., :1, :], of_edges, ends[..., 1:, :]], axis=-2)
            frames.append([part.reshape(-1, 3) for part in (all_edges[..., :-1, :], all_edges[..., 1:, :])])
        (tangents, next_tangents), (normals, next_normals) = frames
        strains = rest_strains(tangents, normals, next_tangents, next_normals).reshape(self.positions.shape)
        self._close(strains.swapaxes(-1, -2))
        return strains


def stations_of(rod: Rod, layer: Layer | None = None) -> tuple[int, int]:
    """Return the first and last station of the strand of a layer, or of the whole rod: one beyond those of the path if
    it is closed.
    """
    first, last = (0, rod.stations - 1) if layer is None else rod.covered_stations(layer)
    return first, last + int(is_closed(rod, first, last))


def is_closed(rod: Rod, first: int, last: int) -> bool:
    """Return whether the strand over these stations of a rod has no ends."""
    return rod.closed and first == 0 and last >= rod.stations - 1


def with_copies(rod: Rod, edges: Array) -> Array:
    """Return the edges of the path of a rod, and the copy of the first one of a closed rod if that is among them."""
    return np.append(edges, rod.stations - 1) if rod.closed and 0 in edges else edges


def strand_shape(rod: Rod, height: Array, first: int, last: int, place: Placement) -> StrandShape:
    """Return the shape of the strand that lies `height` [m] over the path at the stations from first to last; of
    several places at once (`scene.pattern.stacked`), that in each of them.
    """
    shape = _shape(rod, height, first, last, place, Rod.frames_at)
    if rod.imperfection is None:
        return shape
    imperfect = _shape(rod, height, first, last, place, _imperfect_frames)
    return replace(imperfect, imperfection=imperfect.strains() - shape.strains())


def strand_lengths(rod: Rod, heights: Array, last: int) -> Array:
    """Return the lengths [m] of the edges of strands over the path from its start to a station, shape (n_strand,
    n_edge); `heights` [m] is theirs over the path, shape (n_strand, n_node).
    """
    arc = rod.edge_length * rod.on_path(np.arange(last + 1))
    points, _, normals = rod.frames_at(arc) if rod.imperfection is None else _imperfect_frames(rod, arc)
    return _edges(points + heights[..., None] * normals, is_closed(rod, 0, last))[1]


def _edges(positions: Array, closed: bool) -> tuple[Array, Array]:
    """Return the vectors and lengths [m] of edges between nodes; of a closed strand the last two nodes become the
    first, to the last digit.
    """
    if closed:
        positions[..., -2:, :] = positions[..., :2, :]
    edges = positions[..., 1:, :] - positions[..., :-1, :]
    return edges, np.linalg.norm(edges, axis=-1)


def _imperfect_frames(rod: Rod, arc: Array) -> tuple[Array, Array, Array]:
    """Return the frames of the path with the imperfection: points x + f n + g t×n."""
    points, tangents, normals = rod.frames_at(arc)
    (f, g), slopes = (part.T[..., None] for part in departure(rod, arc))
    along = _tangents_beside(rod, arc, tangents, normals, (f, g), slopes)
    return points + f * normals + g * cross(tangents, normals), along, _across(normals, along)


def _tangents_beside(
    rod: Rod, arc: Array, tangents: Array, normals: Array, offset: tuple[Array, Array], slopes: tuple[Array, Array]
) -> Array:
    """Return the unit tangents of a curve at the offset (f, g) from the path, x + f n + g t×n.

    They are along (1 − χ f − ξ g) t + (f′ − τ g) n + (g′ + τ f) t×n.
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
    edges, lengths = _edges(positions, closed)
    if closed:
        middle_normals[-1] = middle_normals[0]
    edge_tangents = edges / lengths[..., None]
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
        np.zeros_like(positions),
        place.handedness,
        closed,
    )


def _across(normals: Array, tangents: Array) -> Array:
    """Return normals made perpendicular to tangents, unit, shape (..., n, 3)."""
    normals = normals - np.einsum("...j,...j->...", normals, tangents)[..., None] * tangents
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@dataclass(frozen=True)
class StrandElements:
    """Inertia and stiffness of a strand's edges, and of its joints as if there was one at every node; where copies
    differ, with one index more, the first.
    """

    edge_mass: Array  # [kg], shape (n_edge,)
    spin_inertia: Array  # [kg m²], shape (n_edge,)
    half_width: Array  # [m], shape (n_edge,)
    axial_stiffness: Array  # EA [N], shape (n_edge,)
    rest_strain: Array  # without stimuli, shape (n_edge,)
    joint_stiffness: Array  # k₁ k₂ k₃ [N m], shape (n_node, 3)
    joint_rest: Array  # κ̄₁ κ̄₂ ψ̄ [rad] without stimuli, shape (n_node, 3)
    node_radius: Array  # from which contact counts [m], shape (n_node,)
    retardation_time: float  # [s]
    modulus: int  # number of the multiple of elastic moduli, −1 without one


def add_strands(
    found: Collected,
    scene: SceneConfig,
    rod: Rod,
    strands: Sequence[StrandArrays],
    shape: StrandShape,
    elements: StrandElements,
    body_index: dict[str, int],
) -> Array:
    """Add strands that differ in their places alone: joints at inner nodes, and where a body holds an end of the rod
    that the strand reaches.

    Returns
    -------
    ndarray
        The joint of each node, −1 for free ends, shape (n_strand, n_node).
    """
    strand, count = strands[0], len(strands)
    nodes, edges = strand.node_count, strand.node_count - 1
    first_node, first_edge = (
        np.array([[getattr(own, name)] for own in strands]) for name in ("first_node", "first_edge")
    )
    index = np.arange(nodes)
    own_nodes, own_edges = np.ones(nodes), np.ones(edges)
    if strand.closed:
        own_nodes[[0, -1]] = own_edges[-1] = 0.0
        found.add(
            joined_node=(first_node[..., None] + np.array([[0, nodes - 2], [1, nodes - 1]])).reshape(-1, 2),
            joined_edge=first_edge + np.array([0, edges - 1]),
        )
    found.strands += strands

    def of_all(values: Array) -> Array:
        """Return the numbers of nodes or edges, those of each strand or the same of all, one strand after the other."""
        return values.ravel() if values.ndim == 2 else np.concatenate([values] * count)

    around = np.stack([np.maximum(index - 1, 0), np.minimum(index, edges - 1)], axis=1)
    forward = {"path": 0, "normal": 1}.get(rod.friction_axis, 2 * np.asarray(shape.handedness, dtype=np.int64))
    found.add(
        position=shape.positions.reshape(-1, 3),
        tangent=shape.tangents.reshape(-1, 3),
        director1=shape.normals.reshape(-1, 3),
        edge_mass=of_all(own_edges * elements.edge_mass),
        node_mass=of_all(own_nodes * halves_to_nodes(elements.edge_mass)),
        node_length=of_all(own_nodes * shape.voronoi),
        node_radius=of_all(elements.node_radius),
        node_edges=(first_edge[..., None] + around).reshape(-1, 2),
        node_axis=np.repeat(np.resize(forward, count), nodes),
        spin_inertia=of_all(own_edges * elements.spin_inertia),
        half_width=of_all(elements.half_width),
        edge_node=(first_node + index[:-1]).ravel(),
        rest_length=of_all(shape.lengths),
        axial_stiffness=of_all(own_edges * elements.axial_stiffness),
        rest_strain=of_all(elements.rest_strain),
        edge_time=np.full(count * edges, elements.retardation_time),
        edge_modulus=np.full(count * edges, elements.modulus),
    )
    at = index[1:-1]
    pairs = np.stack([first_edge + at - 1, first_edge + at])
    clamps = _clamps(rod, strand)
    if clamps:
        clamp_edge = -1 - found.clamp_count - np.arange(count * len(clamps)).reshape(count, -1)
        at = np.append(at, [end % nodes for _, end in clamps])
        own = zip(clamp_edge.T[..., None], clamps, strict=True)
        held = [(clamp, first_edge) if end == 0 else (first_edge + edges - 1, clamp) for clamp, (_, end) in own]
        pairs = np.concatenate([pairs, *map(np.array, held)], axis=2)
        _add_clamps(found, scene, [(body_index[body], end) for body, end in clamps], shape, first_node)
    numbers = found.joint_count + np.arange(count * len(at)).reshape(count, -1)
    joints = np.full((count, nodes), -1)
    joints[:, at] = numbers
    found.joint_count += numbers.size
    stiffness, rest = (of.reshape(-1, nodes, 3) for of in (elements.joint_stiffness, elements.joint_rest))
    found.add(
        joint_a=pairs[0].ravel(),
        joint_b=pairs[1].ravel(),
        joint_stiffness=stiffness[:, at].reshape(-1, 3),
        joint_rest=rest[:, at].reshape(-1, 3),
        joint_time=np.full((numbers.size, 3), elements.retardation_time),
        joint_modulus=np.full(numbers.size, elements.modulus),
        joint_node=(first_node + at).ravel(),
        voronoi_length=shape.voronoi.reshape(-1, nodes)[:, at].ravel(),
    )
    found.node_count += count * nodes
    found.edge_count += count * edges
    return joints


def _clamps(rod: Rod, strand: StrandArrays) -> list[tuple[str, int]]:
    """Return the bodies that hold an end of a strand, and which: 0 or −1."""
    last = strand.first_station + strand.node_count - 1
    ends = ((rod.clamp_start, strand.first_station == 0, 0), (rod.clamp_end, last == rod.stations - 1, -1))
    return [(body, end) for body, reached, end in ends if body is not None and reached]


def _add_clamps(
    found: Collected, scene: SceneConfig, clamps: list[tuple[int, int]], shape: StrandShape, first_node: Array
) -> None:
    """Add what bodies hold of strands: each body by its number, with the end that it holds."""
    parts: list[tuple[Array, Array, Array]] = []
    tangents, normals = (of.reshape(-1, 2, 3) for of in (shape.end_tangents, shape.end_normals))
    positions = shape.positions.reshape(len(first_node), -1, 3)
    for body, end in clamps:
        own = rotation_matrix(np.array(scene.bodies[body].rotation))  # columns: axes of the body's frame
        at = positions[:, [end]] - np.array(scene.bodies[body].position)
        parts.append((tangents[:, [end]] @ own, normals[:, [end]] @ own, at @ own))
    tangent, normal, position = (np.concatenate(part, axis=1).reshape(-1, 3) for part in zip(*parts, strict=True))
    found.add(
        clamp_edge_tangent=tangent,
        clamp_edge_director1=normal,
        attached_node=(first_node + np.array([end % positions.shape[1] for _, end in clamps])).ravel(),
        attached_body=np.tile([body for body, _ in clamps], len(first_node)),
        attached_position=position,
    )
    found.clamp_count += len(tangent)


def halves_to_nodes(of_edges: Array) -> Array:
    """Return the sum at each node of half the values of its edges, shape (..., n_edge + 1)."""
    of_nodes = np.zeros((*of_edges.shape[:-1], of_edges.shape[-1] + 1))
    half = 0.5 * of_edges
    of_nodes[..., :-1] += half
    of_nodes[..., 1:] += half
    return of_nodes
