"""Contact between rods in the Newton matrix.

A contact couples the edge (i, i+1) of a point with the edge (j, j+1) that it faces, which are far from each other in
the band. The blocks of either edge by itself stay in the band. For those between the two, the nodes of one of them
leave the band for the border, as those that a free body holds do (`solve.clamps`): with S the unknowns of these nodes
and R all others,

    [ A_RR  A_RS ]        band: A_RR, rows of the identity for S
    [ A_SR  A_SS ]        border: U = A_RS,   corner: D = A_SS

Of each two strands in contact those nodes leave that are fewer. So the border has three columns for each of some
contacting nodes, and the cost stays linear in the number of nodes.
"""

from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..kinematics.rotation import skew
from ..model.model import Model
from .assembly import hold_unknowns
from .rod_contact import Contacts

Array = np.ndarray


@kernel
def _block(c, m, n, row, column, weight, matrix, side, turn):
    """Entry of the second derivative of contact c by component `row` of its node m and `column` of its node n."""
    value = weight[c, m] * weight[c, n] * matrix[c, row, column]
    return value - side[c] * turn[c, m, row] * turn[c, n, column]


@kernel
def add_own_edges(count, node, weight, matrix, side, turn, node_unknown, band_out):
    """Add the blocks of either edge of each contact by itself to the band."""
    for c in range(count):
        for pair in range(2):
            first = node[c, pair]
            for m in range(2):
                for n in range(m + 1):
                    row, column = node_unknown[first + m], node_unknown[first + n]
                    for x in range(matrix.shape[1]):
                        for y in range(x + 1 if m == n else matrix.shape[1]):
                            value = _block(c, 2 * pair + m, 2 * pair + n, x, y, weight, matrix, side, turn)
                            band_out[column + y, row + x - column - y] += value


@kernel
def sum_between(count, node, weight, matrix, side, turn, first, second, index, blocks_out):
    """Sum the blocks between the two edges of contacts by pairs of nodes.

    Parameters
    ----------
    first, second : Array
        Nodes of each pair of nodes, in ascending order of (first, second), first < second, shape (n_block,).
    index : Array
        Place of the pair of nodes for the four blocks of each contact, shape (count, 2, 2).
    blocks_out : Array
        Added to: rows of the first node, columns of the second, shape (n_block, 3, 3), or (n_block, 2, 2) in a plane.
    """
    for c in range(count):
        for m in range(2):
            for n in range(2):
                place = index[c, m, n]
                swapped = node[c, 0] + m != first[place]
                for x in range(matrix.shape[1]):
                    for y in range(matrix.shape[1]):
                        value = _block(c, m, 2 + n, x, y, weight, matrix, side, turn)
                        if swapped:
                            blocks_out[place, y, x] += value
                        else:
                            blocks_out[place, x, y] += value


@kernel
def move_to_border(unknown, dimension, place_of_unknown, half_bandwidth, size, base, band, border_out, corner_out):
    """Copy rows and columns of `dimension` unknowns from each of `unknown` to the border and corner; they are left in
    the band.

    `place_of_unknown` numbers the unknowns that leave the band, −1 for all others, shape (size,); their columns begin
    at `base`.
    """
    for k in range(unknown.shape[0]):
        for column in range(unknown[k], unknown[k] + dimension):
            own = base + place_of_unknown[column]
            for i in range(max(0, column - half_bandwidth), min(size, column + half_bandwidth + 1)):
                value = band[column, i - column] if i >= column else band[i, column - i]
                if place_of_unknown[i] >= 0:
                    corner_out[base + place_of_unknown[i], own] = value
                else:
                    border_out[i, own] = value


@kernel
def add_between(first, second, blocks, place_of_unknown, base, border_out, corner_out):
    """Add the blocks between the unknowns from each of `first` and those from `second`, one of which has left the
    band.
    """
    for k in range(first.shape[0]):
        for x in range(blocks.shape[1]):
            for y in range(blocks.shape[2]):
                row, column = first[k] + x, second[k] + y
                a, b, value = place_of_unknown[row], place_of_unknown[column], blocks[k, x, y]
                if a >= 0 and b >= 0:
                    corner_out[base + a, base + b] += value
                    corner_out[base + b, base + a] += value
                elif a >= 0:
                    border_out[column, base + a] += value
                else:
                    border_out[row, base + b] += value


class RodBorder:
    """Blocks between nodes that rod contact couples, and the nodes that leave the band for them; `rows` are their
    unknowns.
    """

    def __init__(self, model: Model):
        self._model, self._layout = model, model.solved_layout
        self._axes = model.directions
        self._strand = np.repeat(np.arange(len(model.strands)), [s.node_count for s in model.strands])
        self._held = np.zeros(model.node_count, dtype=np.int64) - 1
        self._held[model.attached_node] = np.arange(len(model.attached_node))
        self._unknown = self.rows = np.zeros(0, dtype=np.int64)
        self._place = np.full(self._layout.size, -1, dtype=np.int64)
        self._first = self._second = self.rows
        self._blocks = np.zeros((0, self._layout.dimension, self._layout.dimension))

    def add_to_band(self, parts: list[Contacts], simplified: int, band: Array) -> None:
        """Add each edge's own blocks to the band, collect those between edges, and choose the nodes that leave the
        band.

        `simplified` is for `Contacts.curvature`.
        """
        layout, nodes = self._layout, self._model.node_count
        self._place[:] = -1
        self._unknown = self.rows = self._first = self._second = np.zeros(0, dtype=np.int64)
        parts = [part for part in parts if part.count]
        if not parts:
            return
        keys, tails = [], []
        for part in parts:
            tail = self._of_unknowns(part, simplified)
            tails.append(tail)
            add_own_edges(part.count, part.node, *tail, layout.node, band)
            own = part.node[: part.count, 0, None, None] + np.arange(2)[:, None]
            other = part.node[: part.count, 1, None, None] + np.arange(2)
            keys.append(np.minimum(own, other) * nodes + np.maximum(own, other))
        found, places = np.unique(np.concatenate([key.ravel() for key in keys]), return_inverse=True)
        self._first, self._second = found // nodes, found % nodes
        self._blocks = np.zeros((len(found), layout.dimension, layout.dimension))
        begin = 0
        for part, key, tail in zip(parts, keys, tails, strict=True):
            index = places[begin : begin + key.size].reshape(key.shape)
            begin += key.size
            sum_between(part.count, part.node, *tail, self._first, self._second, index, self._blocks)
        self._choose()

    def _of_unknowns(self, part: Contacts, simplified: int) -> tuple[Array, Array, Array, Array]:
        """Weights, M, κ and turns of contacts, with components along the unknowns of nodes."""
        matrix, side = part.curvature(simplified)
        if self._layout.dimension == 3:
            return part.weight, matrix, side, part.turn
        axes = self._axes
        return part.weight, np.ascontiguousarray(axes @ matrix @ axes.T), side, np.ascontiguousarray(part.turn @ axes.T)

    def _choose(self) -> None:
        """Of each two strands (or halves of one) the nodes that are fewer leave; nodes that bodies hold are in the
        border already.
        """
        between = (self._held[self._first] < 0) & (self._held[self._second] < 0)
        first, second = self._first[between], self._second[between]
        leaving = []
        strands = self._strand[first] * len(self._model.strands) + self._strand[second]
        for pair in np.unique(strands):
            sides = [np.unique(side[strands == pair]) for side in (first, second)]
            leaving.append(min(sides, key=len))
        nodes = np.unique(np.concatenate(leaving)) if leaving else np.zeros(0, dtype=np.int64)
        self._unknown = self._layout.node[nodes]
        self._unknown.flags.writeable = False  # as those of attached nodes: one type for kernels
        self.rows = (self._unknown[:, None] + np.arange(self._layout.dimension)).ravel()
        self._place[self.rows] = np.arange(len(self.rows))

    def add_to_bodies(self, arm: Array, border: Array, corner: Array) -> None:
        """Add the blocks of nodes that free bodies hold to these bodies' border and corner; see `solve.clamps`."""
        model, axes, d = self._model, self._axes, self._layout.dimension
        for k in np.flatnonzero((self._held[self._first] >= 0) | (self._held[self._second] >= 0)):
            block = self._blocks[k]
            ends = []
            for node in (self._first[k], self._second[k]):
                held = self._held[node]
                free = model.attached_free[held] if held >= 0 else -1
                jacobian = axes @ np.hstack([np.eye(3), -skew(arm[held])]) if free >= 0 else None
                ends.append((held >= 0, free, jacobian, self._layout.node[node]))
            (held_a, free_a, jacobian_a, row_a), (held_b, free_b, jacobian_b, row_b) = ends
            if free_a >= 0 and free_b >= 0:
                turned = jacobian_a.T @ block @ jacobian_b
                corner[6 * free_a : 6 * free_a + 6, 6 * free_b : 6 * free_b + 6] += turned
                corner[6 * free_b : 6 * free_b + 6, 6 * free_a : 6 * free_a + 6] += turned.T
            elif free_a >= 0 and not held_b:
                border[row_b : row_b + d, 6 * free_a : 6 * free_a + 6] += block.T @ jacobian_a
            elif free_b >= 0 and not held_a:
                border[row_a : row_a + d, 6 * free_b : 6 * free_b + 6] += block @ jacobian_b

    def widen(self, band: Array, border: Array, corner: Array) -> tuple[Array, Array]:
        """Move the nodes that leave from the band to the border and corner of bodies; returns these with their columns.

        Parameters
        ----------
        band : Array
            See `solve.band`; rows and columns of nodes that leave become those of the identity.
        border, corner : Array
            Of bodies' freedom, shapes (≥ size, n), (n, n).
        """
        layout, base = self._layout, border.shape[1]
        width = base + len(self.rows)
        wide, large = np.zeros((len(border), width)), np.zeros((width, width))
        wide[:, :base], large[:base, :base] = border, corner
        rows = self.rows
        large[base:, :base], large[:base, base:] = border[rows], border[rows].T
        leaving = (self._unknown, layout.dimension)
        move_to_border(*leaving, self._place, layout.half_bandwidth, layout.size, base, band, wide, large)
        free = (self._held[self._first] < 0) & (self._held[self._second] < 0)
        rows_of_blocks = (layout.node[self._first[free]], layout.node[self._second[free]])
        add_between(*rows_of_blocks, self._blocks[free], self._place, base, wide, large)
        wide[rows] = 0.0
        hold_unknowns(*leaving, layout.half_bandwidth, band)
        return wide, large
