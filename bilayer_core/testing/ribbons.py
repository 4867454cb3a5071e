"""Ribbons as they are: sections with rounded borders across a smooth curve through the stations.

A ribbon is its middle sheet c(s) + u a(s), −1 ≤ u ≤ 1, about which half the thickness lies on all sides. c is the
middle between the outer faces, and a reaches along m2 to half the width less half the thickness. Between stations both
are cubics; their slope at a station is that of the parabola through it and its two neighbours, but where the chain
turns by more than 60 degrees: there the curve has a corner.

`least_gap` halves pieces of the sheet. A piece goes once no point of it can be nearer to the surface than what was
found: distances change by no more than the way, and from those of its corners by no more than ½ k way² + e where the
surface bends by k and the piece lies within e of its corners. So pieces become as small as what is near demands, and
no grid decides what is seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bilayer_core.model.model import Model
from bilayer_core.observed.frame import Frame
from bilayer_core.testing.rectangles import Rectangles, apart, apart_at_least
from bilayer_core.testing.surfaces import SceneSurface

Array = np.ndarray
FINE = 0.02
"""Part of the barrier distance to which gaps are found."""
SMALLEST = 0.05
"""Part of the barrier distance below which pieces are not halved."""
KINK = 0.5
"""Cosine of the turn at a station below which the curve has a corner there."""
LOOKED_AT = np.array([(0, -1, -1, 1, 1), (0, -1, 1, -1, 1)], dtype=float)[:, :, None]
"""Places on a piece in half lengths, along and across, its middle first."""


class Ribbons:
    """The ribbons of a model.

    Attributes
    ----------
    radius : Array
        Half the thickness at each node [m], shape (n_node,).
    """

    def __init__(self, model: Model):
        self._model, nodes = model, model.node_count
        self.radius, self._reach, self._offset = np.zeros((3, nodes))
        for strand in model.strands:
            own = slice(strand.first_node, strand.first_node + strand.node_count)
            self.radius[own], self._offset[own] = 0.5 * strand.thickness, strand.offset
            if not model.plane.exists:
                self._reach[own] = np.maximum(0.5 * strand.width - self.radius[own], 0.0)
        self._length = np.linalg.norm(np.diff(model.start_position[:nodes], axis=0), axis=1)[:, None]

    def sections(self, frame: Frame) -> Array:
        """Return c and a of each node [m], shape (2, n_node, 3)."""
        return self.sections_of(frame.positions[: self._model.node_count], frame.directors)

    def sections_of(self, position: Array, director1: Array) -> Array:
        """Return c and a by positions of nodes [m] and m1 of edges."""
        model, nodes, first = self._model, self._model.node_count, self._model.rods.edge_node
        tangent = position[first + 1] - position[first]
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        m1, m2 = np.zeros((2, nodes, 3))
        for node in (first, first + 1):
            np.add.at(m1, node, director1)
            np.add.at(m2, node, np.cross(tangent, director1))
        for strand in model.strands:
            if strand.closed:
                begin, end = strand.first_node, strand.first_node + strand.node_count - 2
                for of in (m1, m2):
                    of[begin], of[end + 1] = of[end], of[begin + 1]
        m1, m2 = (of / np.linalg.norm(of, axis=1)[:, None] for of in (m1, m2))
        return np.stack([position + self._offset[:, None] * m1, self._reach[:, None] * m2])

    def sheet(self, sections: Array) -> Sheet:
        """Return the sheet through sections."""
        secant = np.diff(sections, axis=1) / self._length
        slope = np.zeros_like(sections)
        before, after = self._length[:-1], self._length[1:]
        slope[:, 1:-1] = (after * secant[:, :-1] + before * secant[:, 1:]) / (before + after)
        for strand in self._model.strands:
            first, last = strand.first_node, strand.first_node + strand.node_count - 1
            if strand.closed:
                slope[:, first] = slope[:, last - 1]
            else:
                slope[:, first], slope[:, last] = secant[:, first], secant[:, last - 1]
                if last > first + 1:
                    slope[:, first] += 0.5 * (secant[:, first] - slope[:, first + 1])
                    slope[:, last] += 0.5 * (secant[:, last - 1] - slope[:, last - 1])
        first, (along, _) = self._model.rods.edge_node, secant / np.linalg.norm(secant[0], axis=1)[:, None]
        kink = np.append(np.append(False, (along[1:] * along[:-1]).sum(axis=1) < KINK), False)[:, None]
        third = self._length[first] / 3.0
        begin, end = sections[:, first], sections[:, first + 1]
        inner = (
            begin + third * np.where(kink[first], secant[:, first], slope[:, first]),
            end - third * np.where(kink[first + 1], secant[:, first], slope[:, first + 1]),
        )
        points = np.stack([begin, *inner, end], axis=2)
        return Sheet(points, np.stack([self.radius[first], self.radius[first + 1]], axis=1))


@dataclass(frozen=True)
class Sheet:
    """Bézier points of c and a of each edge [m], shape (2, n_edge, 4, 3), and its radii at both ends [m]."""

    points: Array
    radius: Array

    def straight(self, has_width: Array) -> Sheet:
        """Return the sheet straight between stations, without its width where an edge has none: what rods meet rods
        with.
        """
        begin, end = self.points[:, :, :1], self.points[:, :, 3:]
        straight = begin + np.linspace(0.0, 1.0, 4)[:, None] * (end - begin)
        straight[1] *= has_width[:, None, None]
        return Sheet(straight, self.radius)

    def at(self, edge: Array, along: Array, across: Array) -> tuple[Array, Array]:
        """Return places [m], shape (n, 3), and half thicknesses there [m], 0 ≤ along ≤ 1."""
        rest = 1.0 - along
        weight = np.stack([rest**3, 3.0 * rest**2 * along, 3.0 * rest * along**2, along**3], axis=-1)
        middle, half = np.einsum("kncd,nc->knd", self.points[:, edge], weight)
        return middle + across[:, None] * half, rest * self.radius[edge, 0] + along * self.radius[edge, 1]

    def ways(self) -> tuple[Array, Array, Array, Array]:
        """Return bounds of stretches: ways per step along and across, and of the bend along and the turn of sections
        [m], each of shape (n_edge,).
        """
        size = np.linalg.norm(self.points, axis=3)
        first = 3.0 * np.linalg.norm(np.diff(self.points, axis=2), axis=3).max(axis=2)
        second = 6.0 * np.linalg.norm(np.diff(self.points, 2, axis=2), axis=3).max(axis=2)
        return first.sum(axis=0), size[1].max(axis=1), second.sum(axis=0), first[1]

    def least_gap(self, edges: Array, surface: SceneSurface, place: tuple[Array, Array], unit: float, enough: float):
        """Return the least gap of some stretches to a surface [m], or a number not below `enough` if it is larger.

        `place`: position and rotation of the surface. `unit`: the barrier distance [m], to a part of which the gap is
        found.
        """
        along_way, across_way, bend, turn = self.ways()
        edge, along, across = edges, np.full(len(edges), 0.5), np.zeros(len(edges))
        step, half = np.full(len(edges), 0.5), np.where(across_way[edges] > 0.0, 1.0, 0.0)
        least = math.inf
        while edge.size:
            places = along + LOOKED_AT[0] * step, across + LOOKED_AT[1] * half
            x, radius = self.at(np.tile(edge, LOOKED_AT.shape[1]), *(of.ravel() for of in places))
            local = (x - place[0]) @ place[1]
            gaps = (surface.distance(local) - radius).reshape(LOOKED_AT.shape[1], -1)
            least = min(least, float(gaps.min()))
            if least < -unit:
                break
            way = along_way[edge] * step, across_way[edge] * half
            reach = way[0] + way[1]
            left = 0.5 * surface.bend(local[: edge.size], reach) * reach**2
            left += 0.5 * bend[edge] * step**2 + turn[edge] * step * half
            lowest = gaps.min(axis=0) - np.minimum(left, reach)
            go_on = (lowest < min(least, enough) - FINE * unit) & (reach > SMALLEST * unit)
            edge, along, across, step, half = (of[go_on] for of in (edge, along, across, step, half))
            lengthwise = (way[0] >= way[1])[go_on]
            step, half = np.where(lengthwise, 0.5 * step, step), np.where(lengthwise, half, 0.5 * half)
            moved = np.where(lengthwise, step, 0.0), np.where(lengthwise, 0.0, half)
            along = np.concatenate([along - moved[0], along + moved[0]])
            across = np.concatenate([across - moved[1], across + moved[1]])
            edge, step, half = (np.tile(of, 2) for of in (edge, step, half))
        return least

    def flat(self, edge: Array, along: Array, across: Array, step: Array, half: Array) -> tuple[Rectangles, Array]:
        """Return rectangles that touch the sheet in the middles of pieces, and how far these are askew [m]."""
        middle, _ = self.at(edge, along, across)
        rest, (c, a) = 1.0 - along, np.diff(self.points[:, edge], axis=2)
        weight = 3.0 * np.stack([rest**2, 2.0 * rest * along, along**2], axis=-1)
        one = np.einsum("ncd,nc->nd", c, weight) + across[:, None] * np.einsum("ncd,nc->nd", a, weight)
        other = self.at(edge, along, across + 1.0)[0] - middle
        size = np.maximum((other**2).sum(axis=1), 1e-300)
        askew = ((one * other).sum(axis=1) / size)[:, None] * other
        sides = np.stack([step[:, None] * (one - askew), half[:, None] * other], axis=1)
        return Rectangles(middle, sides), step * np.linalg.norm(askew, axis=1)

    def apart_at_least(self, first: Array, second: Array) -> tuple[Array, Array]:
        """Return a lower bound of the gap of each pair of edges, and the sum of their radii [m]."""
        along_way, across_way, _, _ = self.ways()
        edges = np.arange(len(self.radius))
        middle, _ = self.at(edges, np.full(len(edges), 0.5), np.zeros(len(edges)))
        radius = self.radius.max(axis=1)
        size, way = 0.5 * along_way + across_way + radius, middle[first] - middle[second]
        return np.sqrt(np.einsum("nd,nd->n", way, way)) - size[first] - size[second], radius[first] + radius[second]

    def whole(self) -> tuple[Rectangles, Array]:
        """Return a rectangle that touches the sheet in the middle of each edge, and how far these are askew [m]."""
        half = np.full(len(self.radius), 0.5)
        return self.flat(np.arange(len(half)), half, 0.0 * half, half, 2.0 * half)

    def apart_if_flat(self, first: Array, second: Array, enough: Array) -> Array:
        """Return the distance of the middle sheets of each pair of edges as if these were flat [m], or a lower bound
        that is not below `enough`.
        """
        flat, _ = self.whole()
        return apart(flat.of(first), flat.of(second), enough)

    def apart(self, first: Array, second: Array, unit: float, enough: float) -> float:
        """Return the least gap between pairs of stretches [m], or a lower bound if that is above `enough`."""
        _, across_way, bend, turn = self.ways()
        flat, askew = self.whole()
        around = 0.125 * bend + 0.5 * turn + askew + self.radius.max(axis=1)
        low = apart_at_least(flat.of(first), flat.of(second)) - around[first] - around[second]
        near = low < enough
        first, second, pieces = first[near], second[near], []
        for edge in (first, second):
            wide = np.where(across_way[edge] > 0.0, 1.0, 0.0)
            pieces.append([edge, np.full(len(edge), 0.5), np.zeros(len(edge)), np.full(len(edge), 0.5), wide])
        least, bound = math.inf, float(low[~near].min(initial=math.inf))
        while pieces[0][0].size:
            flat, left, radii = [], [], np.zeros(pieces[0][0].size)
            for edge, along, across, step, half in pieces:
                rectangles, askew = self.flat(edge, along, across, step, half)
                flat.append(rectangles)
                ends = self.radius[edge]
                radii += (1.0 - along) * ends[:, 0] + along * ends[:, 1]
                left.append(0.5 * bend[edge] * step**2 + turn[edge] * step * half + askew)
                left[-1] += step * np.abs(ends[:, 1] - ends[:, 0])
            gaps, off = apart(*flat) - radii, left[0] + left[1]
            least = min(least, float((gaps + off).min()))
            if least < -unit:  # deep inside: how deep is no question
                return least
            go_on = (gaps - off < min(least, enough)) & (off > FINE * unit)
            bound = min(bound, float((gaps - off)[~go_on].min(initial=math.inf)))
            pieces = [[of[go_on] for of in piece] for piece in pieces]
            longer = (left[0] >= left[1])[go_on]
            pieces = [_halved(piece, chosen) for piece, chosen in zip(pieces, (longer, ~longer), strict=True)]
        return bound


def _halved(piece: list[Array], chosen: Array) -> list[Array]:
    """Return pieces twice, the chosen ones as their two halves along."""
    edge, along, across, step, half = piece
    step = np.where(chosen, 0.5 * step, step)
    moved = np.where(chosen, step, 0.0)
    return [
        np.tile(edge, 2),
        np.concatenate([along - moved, along + moved]),
        np.tile(across, 2),
        np.tile(step, 2),
        np.tile(half, 2),
    ]
