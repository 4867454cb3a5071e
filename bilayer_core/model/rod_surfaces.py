"""Rods as surfaces for each other: points on their edges, and which points see which edges."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..contact.broad_phase import near_pairs, scratch
from ..scene.config import SceneConfig
from .layout import ReadOnlyArrays
from .meeting import meetings
from .strands import Collected
from .validity import EdgeFigures

Array = np.ndarray
FEW_EDGES = 2  # that a point is away from the nearest edge of its own rod that it sees, at least


@dataclass(frozen=True)
class RodSurfaces(ReadOnlyArrays):
    """Points of rods that can meet, and the segments that they face.

    The points of an edge divide it evenly, its first node among them (and its last at the end of a strand), no farther
    apart than the strand's radius: no other rod fits between them, whatever the mesh. A point stands for the
    length between the middles to its neighbours, at the ends for half of it.

    A point sees edges of its own rod from the arc distance `rod_exclusion` on, all layers alike: the larger of
    `FEW_EDGES` edges and π/2 (H + d̂), with H the thickness of the rod. A rod that met itself nearer than that would be
    bent more sharply than half its thickness.
    """

    edge_rod: Array  # expanded rod of each edge, shape (n_edge,)
    edge_first: Array  # whether the edge is the first of its strand, shape (n_edge,)
    edge_arc: Array  # from and to along the path of its rod [m], shape (n_edge, 2)
    edge_radius: Array  # largest radius of its strand's nodes [m], shape (n_edge,)
    first_point: Array  # of each edge, shape (n_edge + 1,)
    point_edge: Array  # shape (n_point,)
    point_fraction: Array  # place on its edge, 0 … 1, shape (n_point,)
    point_arc: Array  # along the path of its rod [m], shape (n_point,)
    point_weight: Array  # Δl [m], shape (n_point,)
    rod_meets: Array  # whether two rods, or one and itself, can meet, shape (n_rod, n_rod)
    rod_joined: Array  # whether one body holds both, or both ends of one, shape (n_rod, n_rod)
    rod_exclusion: Array  # arc distance from which on a rod sees itself [m], shape (n_rod,)


def build_rod_surfaces(scene: SceneConfig, found: Collected) -> RodSurfaces | None:
    """The surfaces of rods, or None if none of them can meet."""
    decisions = [meeting for meeting in meetings(scene) if meeting.active]
    if not decisions:
        return None
    place = [index for index, rod in enumerate(scene.rods) for _ in rod.copies]  # of each expanded rod in the scene
    rods = [scene.rods[index] for index in place]
    names = [name for rod in scene.rods for name in rod.copies]
    meets = np.zeros((len(rods), len(rods)), dtype=bool)
    for meeting in decisions:
        for a in (i for i, p in enumerate(place) if p == meeting.first):
            for b in (i for i, p in enumerate(place) if p == meeting.second):
                if meeting.first != meeting.second or (a != b) == meeting.copies:
                    meets[a, b] = meets[b, a] = True
    joined = np.array(
        [[_joined(a, b, itself=i == j) for j, b in enumerate(rods)] for i, a in enumerate(rods)], dtype=bool
    )
    exclusion = [
        max(
            FEW_EDGES * rod.edge_length,
            0.5 * math.pi * (float(EdgeFigures(scene, rod).thickness.max()) + scene.contact.barrier_distance),
        )
        for rod in rods
    ]
    parts: dict[str, list[Array]] = {}
    node_radius = found.column("node_radius")
    for strand in found.strands:
        number = names.index(strand.rod)
        rod = rods[number]
        length = found.column("rest_length")[strand.first_edge : strand.first_edge + strand.node_count - 1]
        radius = float(node_radius[strand.first_node : strand.first_node + strand.node_count].max())
        per_edge = max(1, math.ceil(float(length.max()) / radius * (1.0 - 1e-9)))
        if not meets[number].any():
            per_edge = 0
        for name, values in _strand_points(rod.edge_length, strand.first_station, length, per_edge).items():
            parts.setdefault(name, []).append(values)
        edges = len(length)
        parts.setdefault("edge_rod", []).append(np.full(edges, number))
        parts.setdefault("edge_first", []).append(np.arange(edges) == 0)
        parts.setdefault("edge_radius", []).append(np.full(edges, radius))
        parts.setdefault("point_edge", []).append(
            strand.first_edge + np.repeat(np.arange(edges), parts["points_of_edge"][-1])
        )
    arrays = {name: np.ascontiguousarray(np.concatenate(values)) for name, values in parts.items()}
    counts = arrays.pop("points_of_edge")
    return RodSurfaces(
        **arrays,
        first_point=np.concatenate([[0], np.cumsum(counts)]),
        rod_meets=meets,
        rod_joined=joined,
        rod_exclusion=np.array(exclusion),
    )


def _joined(first, second, itself: bool) -> bool:
    """Whether one body holds two rods; or both ends, of the same rod."""
    ends = [{rod.clamp_start, rod.clamp_end} - {None} for rod in (first, second)]
    if itself:
        return first.clamp_start is not None and first.clamp_start == first.clamp_end
    return bool(ends[0] & ends[1])


def _strand_points(spacing: float, start: int, length: Array, per_edge: int) -> dict[str, Array]:
    """Points of a strand whose edges have the lengths `length` [m] and lie `spacing` apart on the path, from station
    `start` on.
    """
    edges = len(length)
    arc = spacing * (start + np.arange(edges))
    fraction = np.concatenate([np.tile(np.arange(per_edge) / max(per_edge, 1), edges), [1.0]])
    edge = np.concatenate([np.repeat(np.arange(edges), per_edge), [edges - 1]])
    step = length / max(per_edge, 1)
    weight = step[edge]
    at_node = (np.arange(len(edge)) % max(per_edge, 1) == 0) & (edge > 0)
    weight[at_node] = 0.5 * (step[edge[at_node] - 1] + step[edge[at_node]])
    weight[0], weight[-1] = 0.5 * step[0], 0.5 * step[-1]
    points = np.full(edges, per_edge)
    if per_edge == 0:
        edge, fraction, weight = edge[:0], fraction[:0], weight[:0]
    else:
        points[-1] += 1
    return {
        "edge_arc": np.stack([arc, arc + spacing], axis=1),
        "point_fraction": fraction,
        "point_arc": arc[edge] + spacing * fraction,
        "point_weight": weight,
        "points_of_edge": points,
    }


class NearPairs:
    """Points and segments of rods that are near each other.

    Attributes
    ----------
    counted : Array
        Number of pairs, as compiled loops share it, shape (1,).
    point, edge, before, after : Array
        The pairs, see `contact.broad_phase.near_pairs`; only the first `count` count.
    until : Array
        Path before which each stays beyond the barrier distance [m], see `contact.rod_list`.
    geometry : tuple
        What `near_pairs` takes of the rods, its scratch last.
    scratch : tuple of Array
    """

    def __init__(self, surfaces: RodSurfaces, edge_node: Array, room: int = 0):
        s = surfaces
        self.scratch = scratch(len(edge_node))
        self.geometry = (
            *(edge_node, s.edge_radius, s.edge_rod, s.edge_first, s.edge_arc),
            *(s.first_point, s.point_fraction, s.point_arc, s.rod_meets, s.rod_joined, s.rod_exclusion),
            *self.scratch,
        )
        self.counted = np.zeros(1, dtype=np.int64)
        self.make_room(room)

    @property
    def count(self) -> int:
        """Pairs in the list."""
        return int(self.counted[0])

    def make_room(self, room: int) -> None:
        """Have room for so many pairs, none of which is listed then."""
        self.point, self.edge = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
        self.before, self.after = np.empty(room, dtype=bool), np.empty(room, dtype=bool)
        self.until = np.empty(room)

    @property
    def outputs(self) -> tuple[Array, ...]:
        """The pairs, as `near_pairs` writes them."""
        return self.point, self.edge, self.before, self.after, self.until

    def find(self, position: Array, start_position: Array, touch: float, reach: float) -> None:
        """List the pairs with a gap below `reach` [m] at positions of nodes [m], shape (n_node, 3); for `touch` see
        `near_pairs`.
        """
        while True:
            self.counted[0] = near_pairs(
                position, position, start_position, touch, reach, *self.geometry, *self.outputs
            )
            if self.count <= len(self.point):
                return
            self.make_room(2 * self.count)
