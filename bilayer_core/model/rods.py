"""Rods: from paths, layers and sections to nodes, edges, joints and bonds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..kinematics.path import circle, rest_strains, spiral, straight
from ..kinematics.rotation import rotation_matrix
from ..scene.config import Fluid, SceneConfig
from ..scene.profile import values_at
from ..scene.rod import ArcPath, Layer, Rod, SpiralPath
from .model import StrandArrays
from .section import Section, bond, outline, sections


@dataclass
class Collected:
    """What grows while rods are added one after the other."""

    strands: list[StrandArrays] = field(default_factory=list)
    rods: list[list[tuple[int, int, int, int]]] = field(default_factory=list)
    columns: dict[str, list] = field(default_factory=dict)
    laws: list[tuple[float, ...]] = field(default_factory=list)
    """Channel, time constants rising and falling, gain, reference, saturation of each eigenstrain law."""
    node_count: int = 0
    edge_count: int = 0

    def add(self, **values) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(np.atleast_1d(value))

    def column(self, name: str, dtype=float, width: int | None = None) -> np.ndarray:
        parts = self.columns.get(name)
        if not parts:
            array = np.zeros((0,) if width is None else (0, width), dtype)
        else:
            array = np.concatenate(parts).astype(dtype)
        return np.ascontiguousarray(array)


Turn = Callable[..., np.ndarray]


def turn_of_copy(rod: Rod, copy: int) -> Turn:
    """Function that turns directions of a rod, or points with ``about=True``, to those of one of its copies."""
    if rod.pattern is None:
        return lambda vectors, about=False: vectors
    turn = rotation_matrix(2.0 * np.pi * copy / rod.pattern.count * np.array(rod.pattern.axis))
    turn[np.abs(turn) < 1e-15] = 0.0  # quarter turns are exact
    center = np.array(rod.pattern.center)

    def apply(vectors: np.ndarray, about: bool = False) -> np.ndarray:
        return (vectors - center) @ turn.T + center if about else vectors @ turn.T

    return apply


def add_rod(found: Collected, scene: SceneConfig, rod: Rod, name: str, turn: Turn, body_index: dict[str, int]) -> None:
    """Add one copy of a rod: its strands, their drag, and the bond between them."""
    spans = []
    for place, layer in enumerate(rod.layers):
        first, last = rod.covered_stations(layer)
        at_nodes, at_edges = _sections(scene, rod, layer, first, last)
        side = 0.0 if len(rod.layers) == 1 else (-0.5, 0.5)[place]
        shape = _strand_shape(rod, side * at_nodes.thickness, first, last, turn)
        spans.append((first, last, found.node_count, found.edge_count))
        strand = StrandArrays(
            f"{name}/{layer.name}",
            name,
            layer.name,
            found.node_count,
            last - first + 1,
            found.edge_count,
            at_nodes.width,
            at_nodes.thickness,
        )
        clamps = []
        if rod.clamp_start is not None and first == 0:
            clamps.append((body_index[rod.clamp_start], 0))
        if rod.clamp_end is not None and last == rod.stations - 1:
            clamps.append((body_index[rod.clamp_end], -1))
        _add_eigenstrain(found, scene, rod, layer, strand)
        _add_strand(found, scene, rod, layer, at_nodes, at_edges, strand, shape, clamps)
    found.rods.append(spans)
    if scene.fluid is not None:
        _add_drag(found, scene.fluid, rod, spans)
        if scene.fluid.added_mass is not None:
            _add_added_mass(found, scene.fluid, rod, spans)
    if len(spans) == 2:
        _add_bond(found, scene, rod, spans)


def _sections(scene: SceneConfig, rod: Rod, layer: Layer, first: int, last: int) -> tuple[Section, Section]:
    """Sections of a layer at the stations from first to last, and in the middle of the edges between them."""
    material = scene.materials[layer.material]
    stations = np.arange(first, last + 1)
    return sections(rod, layer, material, stations), sections(rod, layer, material, stations[:-1] + 0.5)


@dataclass(frozen=True)
class _Shape:
    """A strand at the start: its nodes, the frames of its edges, and those of the path at its two ends."""

    positions: np.ndarray
    lengths: np.ndarray
    tangents: np.ndarray
    normals: np.ndarray
    end_tangents: np.ndarray
    end_normals: np.ndarray


def _strand_shape(rod: Rod, height: np.ndarray, first: int, last: int, turn: Turn) -> _Shape:
    """Shape of the layer whose centreline lies `height` [m] from the path at the stations from first to last."""
    frame = (np.array(rod.path.start), np.array(rod.path.direction), np.array(rod.normal))

    def along(stations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        arc = rod.edge_length * stations
        if isinstance(rod.path, SpiralPath):
            side = 1.0 if rod.path.toward == "normal" else -1.0
            return spiral(*frame, rod.path.start_radius, rod.path.growth, side, rod.path.angle_at(arc))
        if isinstance(rod.path, ArcPath):
            return circle(*frame, rod.path.curvature, arc)
        return straight(*frame, arc)

    points, tangents, normals = along(np.arange(first, last + 1))
    _, _, middle_normals = along(np.arange(first, last) + 0.5)
    positions = turn(points + height[:, None] * normals, about=True)
    edges = np.diff(positions, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    edge_tangents = edges / lengths[:, None]
    ends = [0, -1]
    slopes = (height[[1, -1]] - height[[0, -2]]) / rod.edge_length  # of a layer whose thickness varies
    end_tangents = tangents[ends] + slopes[:, None] * normals[ends]
    end_tangents = turn(end_tangents / np.linalg.norm(end_tangents, axis=1, keepdims=True))
    return _Shape(
        positions,
        lengths,
        edge_tangents,
        _across(turn(middle_normals), edge_tangents),
        end_tangents,
        _across(turn(normals[ends]), end_tangents),
    )


def _across(normals: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """Normals made perpendicular to tangents, unit, shape (n, 3)."""
    normals = normals - np.einsum("ij,ij->i", normals, tangents)[:, None] * tangents
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _add_strand(
    found: Collected,
    scene: SceneConfig,
    rod: Rod,
    layer: Layer,
    at_nodes: Section,
    at_edges: Section,
    strand: StrandArrays,
    shape: _Shape,
    clamps: list[tuple[int, int]],
) -> None:
    nodes, edges = strand.node_count, strand.node_count - 1
    first_edge = strand.first_edge
    rest = shape.lengths
    voronoi = _halves_to_nodes(rest)
    index = np.arange(nodes)
    found.strands.append(strand)
    found.add(
        position=shape.positions,
        tangent=shape.tangents,
        director1=shape.normals,
        node_mass=_halves_to_nodes(at_edges.mass * rest),
        node_weight=voronoi,
        node_radius=0.5 * at_nodes.thickness,
        node_edges=first_edge + np.stack([np.maximum(index - 1, 0), np.minimum(index, edges - 1)], axis=1),
        node_axis=np.full(nodes, ["path", "normal", "across"].index(rod.friction_axis)),
        spin_inertia=at_edges.spin_inertia * rest,
        half_width=0.5 * at_edges.width,
        edge_node=strand.first_node + np.arange(edges),
        rest_length=rest,
        axial_stiffness=at_edges.axial_stiffness,
    )
    bend = np.stack([*at_nodes.bending_stiffness, at_nodes.twisting_stiffness], axis=1)
    natural = _natural_shape(rod, layer)
    inner = voronoi[1:-1]
    found.add(
        joint_a=first_edge + np.arange(edges - 1),
        joint_b=first_edge + np.arange(1, edges),
        joint_stiffness=bend[1:-1] / inner[:, None],
        joint_rest=_rest(
            natural[1:-1], inner, shape.tangents[:-1], shape.normals[:-1], shape.tangents[1:], shape.normals[1:]
        ),
        joint_node=strand.first_node + np.arange(1, nodes - 1),
        voronoi_length=inner,
    )
    for body, end in clamps:
        own = rotation_matrix(np.array(scene.bodies[body].rotation))  # columns: axes of the body's frame
        wall = -1 - sum(len(part) for part in found.columns.get("wall_tangent", []))
        node = strand.first_node if end == 0 else strand.first_node + nodes - 1
        edge = first_edge if end == 0 else first_edge + edges - 1
        fixed = (shape.end_tangents[[end]], shape.end_normals[[end]])
        moving = (shape.tangents[[end]], shape.normals[[end]])
        from_start = (*fixed, *moving) if end == 0 else (*moving, *fixed)
        found.add(
            wall_tangent=fixed[0] @ own,
            wall_director1=fixed[1] @ own,
            attached_node=node,
            attached_body=body,
            attached_position=(shape.positions[end] - np.array(scene.bodies[body].position))[None] @ own,
            joint_a=wall if end == 0 else edge,
            joint_b=edge if end == 0 else wall,
            joint_stiffness=(bend[end] / voronoi[end])[None],
            joint_rest=_rest(natural[[end]], voronoi[[end]], *from_start),
            joint_node=node,
            voronoi_length=voronoi[end],
        )
    found.node_count += nodes
    found.edge_count += edges


def _halves_to_nodes(of_edges: np.ndarray) -> np.ndarray:
    """What edges have, half of it at each of their nodes, shape (n_edge + 1,)."""
    of_nodes = np.zeros(len(of_edges) + 1)
    of_nodes[:-1] += 0.5 * of_edges
    of_nodes[1:] += 0.5 * of_edges
    return of_nodes


def _natural_shape(rod: Rod, layer: Layer) -> np.ndarray:
    """Natural curvature [1/m], NaN where it is the path's, and twist [rad/m] of a layer at its nodes, shape (n, 2)."""
    first, last = rod.covered_stations(layer)
    along = rod.edge_length * np.arange(first, last + 1)
    curvature = np.nan if layer.natural_curvature is None else layer.natural_curvature
    return np.stack([values_at(curvature, along), values_at(layer.natural_twist, along)], axis=1)


def _rest(natural: np.ndarray, voronoi: np.ndarray, *frames: np.ndarray) -> np.ndarray:
    """κ̄₁ κ̄₂ ψ̄ of elements [rad] with frames (t, m1) on either side:
    the layer's natural shape, by default that at the start.
    """
    rest = rest_strains(*frames)
    if not np.isnan(natural[:, 0]).any():
        rest[:, :2] = 0.0
        rest[:, 0] = natural[:, 0] * voronoi
    rest[:, 2] += natural[:, 1] * voronoi
    return rest


def _add_drag(found: Collected, fluid: Fluid, rod: Rod, spans: list[tuple[int, int, int, int]]) -> None:
    """Drag of the whole section at each station, shared by its layers in proportion to their thickness: it acts at
    the middle.
    """
    length = np.full(rod.stations, rod.edge_length)
    length[[0, -1]] *= 0.5
    width, layers = outline(rod, np.arange(rod.stations))
    thickness = layers.sum(axis=0)
    whole = np.stack([fluid.drag_along * width, fluid.drag_across * width, fluid.drag_across * thickness], axis=1)
    for (first, last, first_node, first_edge), own in zip(spans, layers, strict=True):
        station = np.arange(last - first + 1)
        covered = slice(first, last + 1)
        share = fluid.density * length[covered] * own[covered] / thickness[covered]
        edges = np.stack([np.maximum(station - 1, 0), np.minimum(station, last - first - 1)], axis=1)
        found.add(
            drag_node=first_node + station,
            drag_edge=first_edge + edges,
            drag_coefficient=share[:, None] * whole[covered],
        )


def _add_added_mass(found: Collected, fluid: Fluid, rod: Rod, spans: list[tuple[int, int, int, int]]) -> None:
    """Added mass of the whole section along each edge, shared by its layers in proportion to their thickness."""
    width, layers = outline(rod, np.arange(rod.stations - 1) + 0.5)
    thickness = layers.sum(axis=0)
    per_area, law = 0.25 * np.pi * fluid.density * rod.edge_length, fluid.added_mass
    through, sideways = law.through * width**2, law.sideways * thickness**2
    turning = law.turning * (width**2 - thickness**2) ** 2 / 32.0
    whole = per_area * np.stack([through, sideways, turning], axis=1)
    for (first, last, _, _), own in zip(spans, layers, strict=True):
        found.add(fluid_mass=((own / thickness)[:, None] * whole)[first:last])


def _add_eigenstrain(found: Collected, scene: SceneConfig, rod: Rod, layer: Layer, strand: StrandArrays) -> None:
    """The edges of a layer that follow its laws; equal laws are one."""
    first, _ = rod.covered_stations(layer)
    for law in layer.eigenstrain:
        channel = list(scene.stimuli).index(law.stimulus)
        numbers = (channel, *law.lags, law.gain, law.reference, law.limit)
        if numbers not in found.laws:
            found.laws.append(numbers)
        edges = strand.first_edge - first + np.array(rod.driven_edges(layer, law))
        found.add(driven_edge=edges, driven_law=np.full(len(edges), found.laws.index(numbers)))


def _add_bond(found: Collected, scene: SceneConfig, rod: Rod, spans: list[tuple[int, int, int, int]]) -> None:
    """Bonds of paired edges; the rest values are those of the initial shape."""
    bottom, top = spans
    first, last = max(bottom[0], top[0]), min(bottom[1], top[1])
    (_, below), (_, above) = (_sections(scene, rod, layer, first, last) for layer in rod.layers)
    law = bond(below, above, scene.coupling, rod.torsion)
    position, tangent, m1 = (found.column(name, width=3) for name in ("position", "tangent", "director1"))
    edges = [layer[3] + np.arange(first, last) - layer[0] for layer in (top, bottom)]
    nodes = [layer[2] + np.arange(first, last) - layer[0] for layer in (top, bottom)]
    middles = [0.5 * (position[start] + position[start + 1]) for start in nodes]
    frames = [(tangent[edge], m1[edge]) for edge in edges]
    between = middles[0] - middles[1]
    mean = [0.5 * (frames[0][1] + frames[1][1]), 0.5 * (frames[0][0] + frames[1][0])]  # m1 and the tangent
    across = 0.5 * (np.cross(*frames[0]) + np.cross(*frames[1]))
    length = found.column("rest_length")
    weight = 0.5 * (length[edges[0]] + length[edges[1]])
    found.add(
        bond_joint_a=edges[0],
        bond_joint_b=edges[1],
        bond_joint_stiffness=weight[:, None] * np.stack([law.bending, law.tilt, law.twist], axis=1),
        bond_joint_rest=rest_strains(*frames[0], *frames[1]),
        bond_joint_node=np.full(last - first, -1),
        pair_stiffness=weight * law.translation,
        pair_rest=np.stack([np.einsum("ij,ij->i", between, m) for m in (mean[0], across, mean[1])], axis=1),
    )
