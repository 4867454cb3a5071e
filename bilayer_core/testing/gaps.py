"""The smallest gap of a scene, and whether anything passed through anything: found anew from positions alone.

Nothing here is shared with the solver but the geometry of the scene: what has which thickness, which radius, which
half edges. All pairs are looked at, without lists of near ones, but for robots of hundreds of edges, whose near pairs
scipy's k-d tree finds anew at every look; distances are computed by other formulas. Rods may meet unless the scene has
`contact.rods: false`, whether or not the model expects it.

- Surfaces are met by ribbons as they are (`testing.ribbons`), by balls, and by corners and rims of bodies and obstacles
  (`testing.surfaces`).
- Rods meet rods as ribbons straight between stations, and those up to twice as wide as thick as round ones about the
  middle between their faces. On one rod, edges count that are at least two edges apart along it, and half the
  circumference of a bend that closes the barrier distance in.

The model keeps points apart, not all between them: surfaces may be nearer than it knows by `UNSURE` of the barrier
distance, and rods, whose points are no farther apart than their radius, by √(4 + 1/4) − 2 of that where two cross.

What the solver says touches must be near as well: contact does not act across air. It may act between neighbours on
one rod that are no pair here, where the rod folds; these count for that alone.

A look at the ends of a step cannot see what passed through something thin within it. So the straight way from the last
look is gone through in parts, none of which moves anything by more than half of the smallest radius: what is deeper
than half way inside another in between has *crossed* it. What moves in one step by more than twelve times its size goes
another way than the straight one: of that nothing is said. Nor is it of two parts of one rod that move against each
other by more than half of the length between them: where that straightens and bends the other way, they swing past.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from bilayer_core.model.model import Model
from bilayer_core.observed.frame import Frame
from bilayer_core.testing.ribbons import Ribbons, Sheet
from bilayer_core.testing.surfaces import BodyPoints, SceneSurface, surfaces_of

Array = np.ndarray
MOST_EDGES = 300
"""Of which all pairs are listed."""
FAR = 10.0
"""Barrier distances up to which near pairs are found."""
ROUND = 2.0
"""Width over thickness up to which sections meet each other as round ones."""
MOST_PARTS = 24
"""Into which the way of a step is cut at most."""
LARGEST_TURN = 0.3
"""Of a surface from look to look [rad], up to which straight lines stand for the ways about it."""
UNSURE = 0.05, math.sqrt(4.25) - 2.0
"""Part of the barrier distance, and of the radius of rods, by which things may be nearer than points of the model."""
DEEP = 0.5
"""Part of a radius, or of a half edge, from which on something is inside."""


@dataclass(frozen=True)
class Moment:
    """Where everything is at one time."""

    sections: Array  # of ribbons: `Ribbons.sections`, shape (2, n_node, 3)
    points: Array  # of bodies, `BodyPoints` [m], shape (n_point, 3)
    surface_position: Array  # [m], shape (n_surface, 3)
    surface_rotation: Array  # columns are its axes, shape (n_surface, 3, 3)


class GapCheck:
    """Checks the gaps of a model in frames of its run.

    Attributes
    ----------
    unsure : float
        By how much the smallest gap may be less than what the model knows [m].
    """

    def __init__(self, model: Model):
        self._model = model
        self._pairs = PairsOfEdges(model) if model.scene.contact and model.scene.contact.rods is not False else None
        self._points, self._ribbons = BodyPoints(model.scene), Ribbons(model)
        self._surfaces = surfaces_of(model.scene) if model.scene.contact is not None else []
        self._touching = [self._points.meeting(surface) for surface in self._surfaces]
        self._nodes = [self._nodes_meeting(surface) for surface in self._surfaces]
        edge = model.rods.edge_node
        wide = _wide_rods(model)
        self._has_width, self._rod_of_edge = np.zeros(len(edge)), np.empty(len(edge), dtype=object)
        self._station_of_edge = np.zeros(len(edge), dtype=np.int64)
        for strand in model.strands:
            own = slice(strand.first_edge, strand.first_edge + strand.node_count - 1)
            self._has_width[own], self._rod_of_edge[own] = strand.rod in wide, strand.rod
            self._station_of_edge[own] = strand.first_station + np.arange(strand.node_count - 1)
        self._meeting = [np.flatnonzero(nodes[edge] & nodes[edge + 1]) for nodes in self._nodes]
        self._smallest_radius = float(self._ribbons.radius[model.node_length > 0.0].min())
        if self._pairs:
            self._leave_out_joined(self._ribbons.sections_of(model.start_position, model.start_director1))
        contact = model.scene.contact
        self.unsure = UNSURE[0] * contact.barrier_distance if contact is not None else 0.0
        if model.rod_search.exists:
            self.unsure = max(self.unsure, UNSURE[1] * float(self._ribbons.radius.max()))
        self._before: Moment | None = None

    def _leave_out_joined(self, start: Array) -> None:
        """Leave out pairs of edges that touch at the start, of rods that one body holds side by side, and at sharp
        corners of a rod.
        """
        first, second = self._pairs.at(start[0])
        gaps, _ = self._rod_gaps(self._ribbons.sheet(start).straight(self._has_width), first, second)
        joined = self._pairs.joined(first, second) & (gaps < self._model.scene.contact.barrier_distance)
        self._pairs.leave_out(start[0], joined | (self._pairs.of_one_rod(first, second) & (gaps <= 0.0)))

    def _nodes_meeting(self, surface: SceneSurface) -> Array:
        """Return which nodes of rods can meet a surface, shape (n_node,)."""
        model, bodies = self._model, self._model.bodies
        base = np.append(bodies.start_position, np.zeros((1, 3)), axis=0)[surface.body]
        turned = np.append(bodies.start_rotation, np.eye(3)[None], axis=0)[surface.body]
        middle, half = self._ribbons.sections_of(model.start_position[: model.node_count], model.start_director1)
        places = np.stack([middle - half, middle, middle + half]) - base - turned @ surface.position
        gaps = surface.distance((places @ turned @ surface.rotation).reshape(-1, 3)).reshape(3, -1).min(axis=0)
        return self._points.nodes_meeting(model, surface, gaps - self._ribbons.radius)

    @property
    def checks_anything(self) -> bool:
        """True if the scene has anything that could meet."""
        return bool((self._pairs and self._pairs.count) or self._surfaces)

    def moment(self, frame: Frame) -> Moment:
        """Return the places of nodes, points and surfaces to be looked at in a frame."""
        poses = [
            (position, Rotation.from_quat(quaternion).as_matrix())
            for position, quaternion in zip(frame.body_positions, frame.body_quaternions, strict=True)
        ]
        poses.append((np.zeros(3), np.eye(3)))  # the world
        return Moment(
            self._ribbons.sections(frame),
            self._points.places(poses),
            np.array([poses[s.body][0] + poses[s.body][1] @ s.position for s in self._surfaces]).reshape(-1, 3),
            np.array([poses[s.body][1] @ s.rotation for s in self._surfaces]).reshape(-1, 3, 3),
        )

    def smallest(self, at: Moment) -> float:
        """Return the smallest gap [m]; infinite if nothing can meet."""
        sheet, gaps = self._ribbons.sheet(at.sections), [math.inf]
        if self._pairs:
            cores = sheet.straight(self._has_width)
            unit, (first, second) = self._model.scene.contact.barrier_distance, self._pairs.at(at.sections[0])
            bound, _ = cores.apart_at_least(first, second)
            near = bound < unit
            far = math.inf if self._pairs.has_all else FAR * unit
            gaps += [float(bound[~near].min(initial=far)), cores.apart(first[near], second[near], unit, unit)]
        return min(gaps + self._surface_gaps(sheet, at, math.inf))

    def floating(self, at: Moment, contacts: Sequence[tuple[str, str]]) -> str:
        """Describe something that feels a rod farther off than the barrier distance; empty if nothing does.

        Parameters
        ----------
        at : Moment
        contacts : sequence of (str, str)
            Names of what the solver says touches, as in `Frame.contacts`.
        """
        if not contacts:
            return ""
        sheet, most = self._ribbons.sheet(at.sections), self._farthest(at)
        for one, other in contacts:
            gap = self._gap_between(sheet, at, one, other, most)
            if gap > most:
                return f"{one} and {other} touch across {1e3 * gap:.3g} mm of air"
        return ""

    def _farthest(self, at: Moment) -> float:
        """Return from how far contact may act [m]: the barrier distance, with what the shape between stations leaves
        open, a quarter of the second differences of sections.
        """
        bend = 0.0
        for strand in self._model.strands:
            own = at.sections[:, strand.first_node : strand.first_node + strand.node_count]
            of_middle, of_border = np.linalg.norm(np.diff(own, 2, axis=1), axis=2)
            bend = max(bend, float((of_middle + of_border).max(initial=0.0)))
        return self._model.scene.contact.barrier_distance + self.unsure + 0.25 * bend

    def _gap_between(self, sheet: Sheet, at: Moment, one: str, other: str, most: float) -> float:
        """Return the gap of a rod and a surface or another rod [m], infinite if that is above `most`; 0 of what else
        touches.
        """
        edges, unit = np.flatnonzero(self._rod_of_edge == one), self._model.scene.contact.barrier_distance
        for number, surface in enumerate(self._surfaces):
            if surface.name == other and edges.size:
                place = at.surface_position[number], at.surface_rotation[number]
                meeting = np.intersect1d(edges, self._meeting[number])
                return sheet.least_gap(meeting, surface, place, unit, math.inf) if meeting.size else 0.0
        others = np.flatnonzero(self._rod_of_edge == other)
        if not edges.size or not others.size:
            return 0.0
        first, second = (of.ravel() for of in np.meshgrid(edges, others))
        if one == other:  # of itself, all that do not share a station: where it folds, neighbours touch
            station = self._station_of_edge
            apart = np.abs(station[first] - station[second]) > 1
            first, second = first[apart], second[apart]
        sheet = sheet.straight(self._has_width)
        near = sheet.apart_at_least(first, second)[0] < most
        return sheet.apart(first[near], second[near], unit, math.inf)

    def crossed(self, at: Moment) -> str:
        """Describe a deep overlap on the straight way from the last look to this one; empty if there was none."""
        before, self._before = self._before, at
        if before is None:
            return ""
        turns = before.surface_rotation.transpose(0, 2, 1) @ at.surface_rotation
        if len(turns) and Rotation.from_matrix(turns).magnitude().max() > LARGEST_TURN:
            return ""
        moved = at.sections - before.sections
        rods = _parts(_largest(moved[0]) + _largest(moved[1]), self._smallest_radius) if self._pairs else 0
        points, positions = at.points - before.points, at.surface_position - before.surface_position
        surfaces = [
            _parts(max(_largest(points[touching] - way), self._way(moved[:, nodes], way)), of.smallest)
            for of, touching, nodes, way in zip(self._surfaces, self._touching, self._nodes, positions, strict=True)
        ]
        ends = list(zip(vars(before).values(), vars(at).values(), strict=True))
        for part in np.linspace(0.0, 1.0, max([rods, *surfaces]) + 1)[1:-1]:
            between = Moment(*(a + part * (b - a) for a, b in ends))
            if found := self._deep(between, moved[0], rods > 1, [parts > 1 for parts in surfaces]):
                return found
        return ""

    def _deep(self, at: Moment, way: Array, with_rods: bool, with_surfaces: list[bool]) -> str:
        """Describe a deep overlap of nodes that move by `way` [m] from look to look; empty if there is none."""
        sheet = self._ribbons.sheet(at.sections)
        if with_rods:
            first, second = self._pairs.at(at.sections[0])
            gaps, radii = self._rod_gaps(sheet.straight(self._has_width), first, second)
            deep = np.flatnonzero(gaps < -DEEP * radii)
            if deep.size:
                first, second = first[deep], second[deep]
                middle = 0.5 * (way[:-1] + way[1:])[self._model.rods.edge_node]
                against = np.linalg.norm(middle[first] - middle[second], axis=1)
                if (2.0 * against <= self._pairs.length_between(first, second)).any():
                    return "a rod passed through a rod"
        gaps = self._surface_gaps(sheet, at, 0.0) if any(with_surfaces) else []
        for surface, gap, wanted in zip(self._surfaces, gaps, with_surfaces, strict=False):
            if wanted and gap < -DEEP * surface.smallest:
                return f"something passed through {surface.name}"
        return ""

    @staticmethod
    def _way(sections: Array, way: Array) -> float:
        """Return the farthest way of a point of sections that move by so much, to a surface that moves by `way` [m]."""
        middle, half = sections
        return _largest(middle - way) + _largest(half)

    def _rod_gaps(self, sheet: Sheet, first: Array, second: Array) -> tuple[Array, Array]:
        """Return the gap of each pair of edges, as if they were flat, or a lower bound above the barrier distance;
        their radii.
        """
        bound, radii = sheet.apart_at_least(first, second)
        unit = self._model.scene.contact.barrier_distance
        near = np.flatnonzero(bound < unit)
        bound[near] = sheet.apart_if_flat(first[near], second[near], unit + radii[near]) - radii[near]
        return bound, radii

    def _surface_gaps(self, sheet: Sheet, at: Moment, enough: float) -> list[float]:
        """Return the least gap of all that can meet each surface [m]; of ribbons, that it is not below `enough`."""
        found = []
        for number, surface in enumerate(self._surfaces):
            place = at.surface_position[number], at.surface_rotation[number]
            touching = self._touching[number]
            of_bodies = surface.distance((at.points[touching] - place[0]) @ place[1]) - self._points.radius[touching]
            unit = self._model.scene.contact.barrier_distance
            of_ribbons = sheet.least_gap(self._meeting[number], surface, place, unit, enough)
            found.append(min(of_ribbons, float(of_bodies.min(initial=math.inf))))
        return found


def _parts(way: float, size: float) -> int:
    """Return into how many parts a way is cut that could pass through something of a size [m]; 0 if they would be too
    many.
    """
    parts = math.ceil(way / (0.5 * size))
    return parts if parts <= MOST_PARTS else 0


def _largest(way: Array) -> float:
    return float(np.linalg.norm(way, axis=1).max()) if len(way) else 0.0


def _wide_rods(model: Model) -> set[str]:
    """Return the names of rods that are somewhere wider than so many times their thickness."""
    width, thickness = {}, {}
    for strand in model.strands:
        stations = strand.first_station + np.arange(strand.node_count)
        for station, wide, thick in zip(stations.tolist(), strand.width, strand.thickness, strict=True):
            key = strand.rod, station
            width[key], thickness[key] = wide, thickness.get(key, 0.0) + thick
    return {key[0] for key, wide in width.items() if wide > ROUND * thickness[key] * (1.0 + 1e-9)}


class PairsOfEdges:
    """The pairs of edges of a model that may not come together, all of them or, of very many, those that are near.

    `most`: number of edges up to which all pairs are listed.
    """

    def __init__(self, model: Model, most: int = MOST_EDGES):
        self._model, self._edges = model, len(model.rods.edge_node)
        scene = model.scene
        rods = [(copy.name, copy.rod) for rod in scene.rods for copy in rod.copies]
        number = {name: index for index, (name, _) in enumerate(rods)}
        self._rod, self._arc = np.full(self._edges, -1), np.zeros(self._edges)  # −1: copies of others
        thick = np.zeros(len(rods))
        for strand in model.strands:
            index, edges = number[strand.rod], np.arange(strand.shown - 1)
            self._rod[strand.first_edge + edges] = index
            self._arc[strand.first_edge + edges] = rods[index][1].edge_length * (strand.first_station + edges)
            thick[index] += float(strand.thickness.max())
        self._edge_length = np.array([rod.edge_length for _, rod in rods])
        self._length = np.array([rod.path.length if rod.closed else math.inf for _, rod in rods])
        bend = 0.5 * math.pi * (thick + scene.contact.barrier_distance)
        self._exclusion = np.maximum(bend, 2.0 * self._edge_length) * (1.0 - 1e-9)
        holds = [{rod.clamp_start, rod.clamp_end} - {None} for _, rod in rods]
        self._joined = np.array([[bool(one & other) for other in holds] for one in holds])
        np.fill_diagonal(
            self._joined,
            [len(held) == 1 and rod.clamp_start == rod.clamp_end for held, (_, rod) in zip(holds, rods, strict=True)],
        )
        self._all: tuple[Array, Array] | None = None
        self._left_out = np.empty(0, dtype=np.int64)
        self.count = self._edges * (self._edges - 1) // 2  # Of pairs; of very many edges, of all that there are
        self.has_all = self._edges <= most  # Whether all are listed
        if self.has_all:
            self._all = self._allowed(*np.triu_indices(self._edges, 1))
            self.count = len(self._all[0])

    def at(self, nodes: Array) -> tuple[Array, Array]:
        """Return two arrays of edges, all pairs that may be near among them; nodes [m]."""
        if self._all is not None:
            return self._all
        edge = self._model.rods.edge_node
        middle, along = 0.5 * (nodes[edge] + nodes[edge + 1]), nodes[edge + 1] - nodes[edge]
        reach = np.linalg.norm(along, axis=1).max() + 2.0 * max(float(s.width.max()) for s in self._model.strands)
        reach += FAR * self._model.scene.contact.barrier_distance
        near = KDTree(middle).query_pairs(reach, output_type="ndarray")
        first, second = self._allowed(near[:, 0], near[:, 1])
        keep = ~np.isin(self._number(first, second), self._left_out)
        return first[keep], second[keep]

    def leave_out(self, start: Array, out: Array) -> None:
        """Leave out pairs, of those with nodes at the start [m], from now on."""
        first, second = self.at(start)
        if self._all is not None:
            self._all = first[~out], second[~out]
        else:
            self._left_out = self._number(first[out], second[out])

    def of_one_rod(self, first: Array, second: Array) -> Array:
        """Return whether two edges belong to one rod."""
        return self._rod[first] == self._rod[second]

    def joined(self, first: Array, second: Array) -> Array:
        """Return whether one body holds the rods of two edges, or both ends of their rod."""
        return self._joined[self._rod[first], self._rod[second]]

    def length_between(self, first: Array, second: Array) -> Array:
        """Return the length of rod between two edges [m], infinite between rods."""
        return np.where(self.of_one_rod(first, second), np.abs(self._arc[first] - self._arc[second]), math.inf)

    def _number(self, first: Array, second: Array) -> Array:
        return np.minimum(first, second) * self._edges + np.maximum(first, second)

    def _allowed(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Return those pairs that may not come together."""
        rod, same = self._rod[first], self.of_one_rod(first, second)
        apart, length = np.abs(self._arc[first] - self._arc[second]), self._length[rod]
        around = np.where(np.isfinite(length), np.minimum(apart, length - apart), apart)
        far = around - self._edge_length[rod] >= self._exclusion[rod]
        keep = (rod >= 0) & (self._rod[second] >= 0) & (~same | far)
        return first[keep], second[keep]
