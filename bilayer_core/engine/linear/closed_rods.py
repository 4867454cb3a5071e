"""Closed rods in the Newton matrix: unknowns that are in the band twice become one column of the border each.

A closed strand is one with ends in memory, whose first nodes and edge come again at its end (`model.strand_arrays`).
With P the matrix that gives either of two such unknowns the value of one, the matrix of the closed strand is PᵀKP and
the right-hand side Pᵀr, K being that of the strand with ends, a band. With S the rows of `first` and `copy` and R all
others,

    band: K_RR, rows of the identity for S,    border: K_RS P,    corner: PᵀK_SS P,

so nothing is left out and nothing depends on where the join is. These are two nodes and the edge between them for each
strand: seven unknowns in space, four in a plane, and the cost stays linear in the number of nodes.

With rails (`contact.rails`) the node after these and the edge before it have columns, too, though they are in the band
once: a contact couples them with the node and the edge before the join, at the other end of the band.
"""

from __future__ import annotations

from bilayer_core.engine.linear.assembly import hold_unknowns
from bilayer_core.engine.linear.new_columns import add_columns, add_to_column
from bilayer_core.jit import kernel, piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY


@piece(int, Problem)
def move_joins_to_border(p):
    """Move what is in the band twice to columns of the border, after those of bodies, and add the two up."""
    joins, bordered, band, strands = p.joins, p.bordered, p.system.band, p.strands
    count, base, bandwidth = joins.first.shape[0], bordered.width[0], strands.bandwidth
    add_columns(bordered, count)
    for k in range(count):
        _move_row(joins.column, bordered, band, strands.size, bandwidth, base, k, joins.first[k])
        if joins.copy[k] != joins.first[k]:
            _move_row(joins.column, bordered, band, strands.size, bandwidth, base, k, joins.copy[k])
    hold_unknowns(joins.first, 1, bandwidth, band)
    hold_unknowns(joins.copy, 1, bandwidth, band)
    return READY


@kernel
def _move_row(column, bordered, band, size, bandwidth, base, k, row):
    """Add what the band and the columns of bodies hold in a row to the join column k."""
    border, corner, own = bordered.border, bordered.schur, base + k
    for c in range(base):
        corner[c, own] += border[c, row]
        corner[own, c] += border[c, row]
        border[c, row] = 0.0
    for i in range(max(0, row - bandwidth), min(size, row + bandwidth + 1)):
        value = band[row, i - row] if i >= row else band[i, row - i]
        if column[i] >= 0:
            corner[base + column[i], own] += value
        elif value != 0.0:
            add_to_column(bordered, own, i, value)


@kernel
def gather_joins(joins, freedom, bordered, right):
    """Move what is wanted of joined unknowns, the sum of both, from the right-hand side to `BorderedSystem.load`."""
    base = freedom.shape[1]
    for k in range(joins.first.shape[0]):
        first, copy = joins.first[k], joins.copy[k]
        bordered.load[base + k] = right[first] + (right[copy] if copy != first else 0.0)
        right[first] = right[copy] = 0.0


@kernel
def scatter_joins(joins, freedom, bordered, right):
    """Give both unknowns of each join their step, from `BorderedSystem.load`."""
    base = freedom.shape[1]
    for k in range(joins.first.shape[0]):
        right[joins.first[k]] = right[joins.copy[k]] = bordered.load[base + k]
