"""Rods as surfaces for each other: points on their edges, and which points see which edges.

The points of an edge divide it evenly, or the segment between its rails (`contact.rails`), its first node among them
(and its last where a strand ends), no farther apart than the strand's radius, half its thickness: no other rod fits
between them, whatever the mesh. A point stands for the length between the
middles to its neighbours, at the ends for half of it.

A ribbon has few points along its middle and along either border, an edge or a quarter of its width apart, which stand
for a half and a quarter of its length each; as many across its ends as on a round rod; and as many along either border
for where borders meet, see `contact.segment`.

A point sees edges of its own rod from the arc distance `rod_exclusion` on, all layers alike: the larger of `FEW_EDGES`
edges and π/2 (H + d̂), with H the thickness of the rod. A rod that met itself nearer than that would be bent more
sharply than half of it.

Edges that are copies (`model.strand_arrays`) have no points, and belong to one rod more that meets nothing.
"""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np

from bilayer_core.contact.broad_phase import RodSearch, near_pairs, tree_size
from bilayer_core.contact.facet import BORDERS, INSIDE, WHOLE
from bilayer_core.errors import SceneError
from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.colliders import meets_with_borders
from bilayer_core.model.edge_figures import edge_figures
from bilayer_core.model.records.contacts import Rails
from bilayer_core.model.rod_pairs import rod_pairs
from bilayer_core.model.rod_rails import build_rails, start_rails
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.model.strands import Collected
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.rod import Rod

Array = np.ndarray
WITHIN = 1.0 - 1e-9
"""Of an arc distance: nodes that are exactly as far apart see each other, whatever rounding says."""
MOST_POINTS = 5_000_000
"""Of all rods: 80 bytes each while they are made, as measured."""
MOST_PAIRS = 10_000_000
"""Points near other rods: 26 bytes each."""
ACROSS = 0.25
"""Of its width: how far apart the few points of a ribbon are at most, along it."""
FEW_EDGES = 2  # that a point is away from the nearest edge of its own rod that it sees, at least


def build_rod_surfaces(scene: SceneConfig, found: Collected, in_plane: bool) -> tuple[RodSearch, Array, Rails]:
    """Return the search for rods that meet, absent if none can, the length of rod that its points stand for [m], and
    the rails along which they meet.

    Raises
    ------
    SceneError
        If rods are so thin that they have too many points.
    """
    decisions = [rod_pair for rod_pair in rod_pairs(scene) if rod_pair.active]
    if not decisions:
        return RodSearch.absent(), np.zeros(0), Rails.absent()
    copies = [(index, copy) for index, rod in enumerate(scene.rods) for copy in rod.copies]
    scene_index = np.array([index for index, _ in copies])  # of each rod with copies
    rods, numbers = [copy.rod for _, copy in copies], {copy.name: number for number, (_, copy) in enumerate(copies)}
    can_collide = np.zeros((len(rods), len(rods)), dtype=bool)
    for rod_pair in decisions:
        first, second = (np.flatnonzero(scene_index == index) for index in (rod_pair.first, rod_pair.second))
        meet = np.ones((len(first), len(second)), dtype=bool)
        if rod_pair.first == rod_pair.second:
            meet = np.eye(len(first), dtype=bool) != rod_pair.copies
        can_collide[np.ix_(first, second)] |= meet
        can_collide[np.ix_(second, first)] |= meet.T
    joined = _joined(scene, rods)
    flat = {copy.name for index, copy in copies if meets_with_borders(scene.rods[index]) and not in_plane}
    rails, rest_length = build_rails(found, flat), found.column("rest_length")
    node_radius = 0.5 * np.concatenate([strand.thickness for strand in found.strands])
    right = rails.right if rails.exists else np.full(found.edge_count, -1)
    thickness = [float(edge_figures(scene, rod).thickness.max()) for rod in scene.rods]
    thickest = [thickness[index] for index in scene_index]
    for strand in found.strands:
        number, own = numbers[strand.rod], slice(strand.first_node, strand.first_node + strand.node_count)
        thickest[number] = max(thickest[number], 2.0 * float(node_radius[own].max()))
    exclusion = [
        WITHIN * max(FEW_EDGES * rod.edge_length, 0.5 * math.pi * (thick + scene.contact.barrier_distance))
        for rod, thick in zip(rods, thickest, strict=True)
    ]
    parts: dict[str, list[Array]] = {}
    meets = can_collide.any(axis=1).tolist()

    def kind(strand: StrandArrays) -> tuple[object, ...]:
        """Return a key that strands share if they are copies of each other; a closed strand has its own."""
        number, edges = numbers[strand.rod], strand.shown - 1
        radius = float(node_radius[strand.first_node : strand.first_node + strand.node_count].max())
        longest = float(rest_length[strand.first_edge : strand.first_edge + edges].max())
        spacings, ends = [radius], ()
        if right[strand.first_edge] >= 0:
            spacings.append(max(radius, ACROSS * float(strand.width.min())))
            at_ends = (strand.first_node, strand.first_node + edges)
            ends = (3, 3) if strand.closed else tuple(_points_across(rails, node, radius) for node in at_ends)
        per_edge = tuple(max(1, math.ceil(longest / each * (1.0 - 1e-9))) for each in spacings)
        if not meets[number]:
            per_edge, ends = (0,), ()
        alone = strand.first_edge if strand.closed else -1
        return rods[number].edge_length, strand.first_station, edges, radius, per_edge, ends, alone

    total = 0
    for (spacing, start, edges, radius, per_edge, ends, _), alike in groupby(found.strands, kind):
        strands = list(alike)
        count = per_edge[0] * edges
        if ends:
            count = 2 * (count + 1) + 3 * (per_edge[1] * edges - 1) + sum(ends)  # of a closed strand five fewer
        total += count * len(strands)
        if total > MOST_POINTS:
            raise _too_thin(scene, strands[0], radius, total)
        order = np.array([[strand.first_edge] for strand in strands]) + np.arange(edges)
        own = _strand_points(spacing, start, rest_length[order], per_edge[0], strands[0].closed)
        if ends:
            few = _strand_points(spacing, start, rest_length[order], per_edge[1], strands[0].closed)
            own = _ribbon_points(few, own, len(strands), ends)
        else:
            count = len(own["point_fraction"])
            own |= {"point_across": np.zeros(count), "point_sees": np.full(count, WHOLE)}
        before, after = order - 1, order + 1
        before[:, 0], after[:, -1] = (order[0, -1], order[0, 0]) if strands[0].closed else (-1, -1)
        own |= {
            "edge_rod": np.repeat([numbers[strand.rod] for strand in strands], edges),
            "edge_first": np.tile(np.arange(edges) == 0, len(strands)),
            "edge_before": before.ravel(),
            "edge_after": after.ravel(),
            "edge_radius": np.full(order.size, radius),
            "point_edge": np.repeat(order, own["points_of_edge"]),
        }
        if strands[0].closed:
            own |= _with_copy(own, len(rods))
        for name, values in own.items():
            parts.setdefault(name, []).append(values)
    spare = int(any(strand.closed for strand in found.strands))  # the rod of copies
    can_collide, joined = np.pad(can_collide, (0, spare)), np.pad(joined, (0, spare))
    exclusion += [max(exclusion)] * spare
    arrays = {name: np.ascontiguousarray(np.concatenate(values)) for name, values in parts.items()}
    counts = arrays.pop("points_of_edge")
    weight = arrays.pop("point_weight")
    search = RodSearch.zeros(
        UNALLOCATED,
        start_position=start_rails(found, rails),
        edge_node=found.column("edge_node", np.int64),
        edge_right=right,
        **arrays,
        first_point=np.concatenate([[0], np.cumsum(counts)]),
        rod_can_collide=can_collide,
        rod_joined=joined,
        rod_exclusion=np.array(exclusion),
        rod_length=np.array([rod.path.length if rod.closed else math.inf for rod in rods] + [math.inf] * spare),
    )
    return search, weight, rails


def _too_thin(scene: SceneConfig, strand: StrandArrays, radius: float, total: float) -> SceneError:
    """Return the error that refuses a strand with which rods have too many points."""
    return SceneError(
        f"{scene.name}: rods.{strand.rod}: must be thicker or shorter for contact between rods: that is computed at "
        f"points {radius:.3g} m apart, half of the thickness of {strand.name}, which makes {total:.3g} points; allowed "
        f"are {MOST_POINTS} (contact.rods: false lets rods pass through each other)"
    )


def _with_copy(own: dict[str, Array], rod: int) -> dict[str, Array]:
    """Return arrays of a strand's edges with a copy of the first edge at the end, which belongs to a rod of its own."""
    found = {name: np.append(own[name], own[name][:1], axis=0) for name in ("edge_arc", "edge_radius")}
    of_copy = {"edge_rod": rod, "edge_first": False, "edge_before": -1, "edge_after": -1, "points_of_edge": 0}
    return found | {name: np.append(own[name], value) for name, value in of_copy.items()}


def _joined(scene: SceneConfig, rods: list[Rod]) -> Array:
    """Return whether one body holds two rods, or both ends of the same rod, shape (n_rod, n_rod)."""
    ends = [(rod.clamp_start, rod.clamp_end) for rod in rods]
    holds = np.array([[body.name in held for body in scene.bodies] for held in ends], dtype=np.float32)
    joined = holds @ holds.T > 0.0
    np.fill_diagonal(joined, [start is not None and start == end for start, end in ends])
    return joined


def _strand_points(spacing: float, start: int, length: Array, per_edge: int, closed: bool) -> dict[str, Array]:
    """Return the points of strands whose edges have the lengths `length` [m], shape (n_strand, n_edge), and lie
    `spacing` apart on the path, from station `start` on.
    """
    count, edges = length.shape
    arc = spacing * (start + np.arange(edges))
    fraction = np.concatenate([np.tile(np.arange(per_edge) / max(per_edge, 1), edges), [1.0]])
    edge = np.concatenate([np.repeat(np.arange(edges), per_edge), [edges - 1]])
    step = length / max(per_edge, 1)
    weight = step[:, edge]
    at_node = (np.arange(len(edge)) % max(per_edge, 1) == 0) & (edge > 0)
    weight[:, at_node] = 0.5 * (step[:, edge[at_node] - 1] + step[:, edge[at_node]])
    weight[:, 0], weight[:, -1] = 0.5 * step[:, 0], 0.5 * step[:, -1]
    points = np.full(edges, per_edge)
    if per_edge == 0:
        edge, fraction, weight = edge[:0], fraction[:0], weight[:, :0]
    elif closed:
        weight[:, 0] += weight[:, -1]
        edge, fraction, weight = edge[:-1], fraction[:-1], weight[:, :-1]
    else:
        points[-1] += 1
    return {
        "edge_arc": np.tile(np.stack([arc, arc + spacing], axis=1), (count, 1)),
        "point_fraction": np.tile(fraction, count),
        "point_arc": np.tile(arc[edge] + spacing * fraction, count),
        "point_weight": weight.ravel(),
        "points_of_edge": np.tile(points, count),
    }


def _points_across(rails: Rails, node: int, radius: float) -> int:
    """Return the number of points across the end of a ribbon: no farther apart than its radius, at least three."""
    return max(3, 1 + math.ceil(2.0 * abs(rails.arm[node, 1]) / radius * (1.0 - 1e-9)))


def _ribbon_points(
    few: dict[str, Array], many: dict[str, Array], count: int, ends: tuple[int, int]
) -> dict[str, Array]:
    """Return the points of alike ribbons from those on their curves, a few and many of them per edge.

    The few become three each, a quarter of the weight at either border, and as many as `ends` says across the ends. The
    many lie on both borders, with as much weight there.
    """
    copies = np.full(len(few["point_fraction"]) // count, 3)
    copies[0], copies[-1] = ends
    index = np.repeat(np.arange(len(copies)), copies)
    across = np.concatenate([np.linspace(0.0, 1.0, n) for n in copies])
    at_border = (across == 0.0) | (across == 1.0)
    share = np.where(at_border, 0.25, 0.5 / (copies[index] - 2.0))
    twice = np.repeat(np.arange(len(many["point_fraction"]) // count), 2)
    edges = len(few["points_of_edge"]) // count
    edge = np.concatenate([_edge_of_point(few, edges)[index], _edge_of_point(many, edges)[twice]])
    order = np.argsort(edge, kind="stable")

    def both(name: str, factor: Array | float = 1.0) -> Array:
        rows = [points[name].reshape(count, -1)[:, of] for points, of in ((few, index), (many, twice))]
        return (np.concatenate(rows, axis=1) * factor)[:, order].ravel()

    across = np.concatenate([across, np.arange(len(twice)) % 2])
    sees = np.concatenate([np.where(at_border, INSIDE, WHOLE), np.full(len(twice), BORDERS)])
    return few | {
        "point_fraction": both("point_fraction"),
        "point_arc": both("point_arc"),
        "point_weight": both("point_weight", np.concatenate([share, np.full(len(twice), 0.25)])),
        "point_across": np.tile(across[order], count),
        "point_sees": np.tile(sees[order], count),
        "points_of_edge": np.tile(np.bincount(edge, minlength=edges), count),
    }


def _edge_of_point(points: dict[str, Array], edges: int) -> Array:
    """Return the edge of each point of a strand of so many edges."""
    return np.repeat(np.arange(edges), points["points_of_edge"][:edges])


class NearPairs:
    """Points and segments of rods that are near each other.

    Attributes
    ----------
    search : RodSearch
        What `near_pairs` takes and writes; another object after `reserve`.
    """

    def __init__(self, search: RodSearch, capacity: int = 0):
        edges = len(search.edge_node)
        sizes = {"rail": len(search.start_position), "edge": edges, "tree": tree_size(edges), "near pair": capacity}
        self.search = search.allocated(sizes)

    @property
    def count(self) -> int:
        """Pairs in the list."""
        return int(self.search.count[0])

    @property
    def capacity(self) -> int:
        """For how many there is capacity."""
        return len(self.search.point)

    def reserve(self, capacity: int) -> None:
        """Make room for so many pairs, none of which is listed then."""
        kept = {name: getattr(self.search, name) for name in ("base", "tip", "box", "sweep", "met")}
        self.search = self.search.allocated({"near pair": capacity}, **kept)

    def find(
        self, base: Array, touch: float, search_distance: float, tip: Array | None = None, most: int = MOST_PAIRS
    ) -> None:
        """List the pairs with a gap below `search_distance` [m] where nodes are, or on their straight way from
        `base` to `tip` [m], shape (n_rail, 3), the first `most` of them; for `touch` see `near_pairs`.
        """
        self.search.base[:], self.search.tip[:] = base, base if tip is None else tip
        while (found := near_pairs(self.search, touch, search_distance)) > self.capacity and self.capacity < most:
            self.reserve(min(2 * found, most))
        self.search.count[0] = min(found, self.capacity)
