"""Contact of rods in the Newton matrix: nodes that leave the band for the border, as in `engine.linear.rod_columns`."""

from __future__ import annotations

from ...jit import kernel, piece
from ...model.records.problem import Problem
from ...model.records.status import READY
from .rod_columns import add_between, add_own_edges, add_to_bodies, choose_leaving, leave_band, take_contacts

CONTACTS, NODES = 0, 1
"""Places in `Leaving.counts`."""


@kernel
def _take_part(leaving, strands, simplified, part):
    begin = leaving.counts[CONTACTS]
    take_contacts(
        strands.axes,
        simplified,
        begin,
        part.counted[0],
        part.node,
        part.weight,
        part.normal,
        part.lean,
        part.along,
        part.matrix,
        part.side,
        part.turn,
        leaving.node,
        leaving.weight,
        leaving.matrix,
        leaving.side,
        leaving.turn,
    )
    leaving.counts[CONTACTS] = begin + part.counted[0]


@kernel
def take_contacts_of(threads, leaving, strands, simplified, band):
    """Add each edge's own blocks to the band, and choose the nodes that leave it."""
    if not threads.exists:
        return
    leaving.counts[CONTACTS], leaving.counts[NODES] = 0, 0
    _take_part(leaving, strands, simplified, threads.contacts)
    _take_part(leaving, strands, simplified, threads.sliding)
    count = leaving.counts[CONTACTS]
    if count == 0:
        return
    blocks = leaving.node, leaving.weight, leaving.matrix, leaving.side, leaving.turn
    add_own_edges(count, blocks[0], blocks[1], blocks[2], blocks[3], blocks[4], strands.row, band)
    leaving.counts[NODES] = choose_leaving(
        count,
        leaving.node,
        leaving.strand,
        leaving.attached,
        leaving.mark,
        leaving.met,
        strands.row,
        strands.dimension,
        leaving.leaving,
        leaving.place,
    )


@kernel
def hand_contacts_to_bodies(leaving, grips, strands, at, border):
    """Add the blocks of nodes that free bodies hold to these bodies' border and corner."""
    if not leaving.exists:
        return
    add_to_bodies(
        strands.axes,
        leaving.counts[CONTACTS],
        leaving.node,
        leaving.weight,
        leaving.matrix,
        leaving.side,
        leaving.turn,
        leaving.attached,
        grips.free,
        at.arm,
        strands.row,
        border.border,
        border.corner,
    )


@kernel
def leave(leaving, wide, strands, band):
    """Move the nodes that leave from the band to the border; false if there is no room for them, but
    `BorderedSystem.width` is what it would be.
    """
    if not leaving.exists:
        return True
    nodes, base = leaving.counts[NODES], wide.width[0]
    if nodes == 0:
        return True
    wide.width[0] += strands.dimension * nodes
    if wide.width[0] > wide.load.shape[0]:
        return False
    if wide.coupled[0] == 0:
        wide.coupled[0] = 1
        for a in range(base):
            for i in range(wide.border.shape[1]):
                wide.border[a, i] = 0.0
    leave_band(
        nodes,
        leaving.leaving,
        strands.dimension,
        leaving.place,
        strands.bandwidth,
        strands.size,
        base,
        wide.border.T,
        wide.schur,
        band,
    )
    add_between(
        leaving.counts[CONTACTS],
        leaving.node,
        leaving.weight,
        leaving.matrix,
        leaving.side,
        leaving.turn,
        leaving.attached,
        strands.row,
        leaving.place,
        base,
        wide.border.T,
        wide.schur,
    )
    return True


@kernel
def take_leaving(leaving, wide, right):
    """Move what is wanted of nodes that left the band from the right-hand side to `BorderedSystem.load`."""
    if not leaving.exists:
        return
    count = leaving.counts[NODES]
    dimension = leaving.matrix.shape[1]
    base = wide.width[0] - dimension * count
    for k in range(count):
        for c in range(dimension):
            row = leaving.leaving[k] + c
            wide.load[base + dimension * k + c] = right[row]
            right[row] = 0.0


@kernel
def put_leaving(leaving, wide, right):
    """Move the step of nodes that left the band from `BorderedSystem.load` to that of all."""
    if not leaving.exists:
        return
    count = leaving.counts[NODES]
    dimension = leaving.matrix.shape[1]
    base = wide.width[0] - dimension * count
    for k in range(count):
        for c in range(dimension):
            right[leaving.leaving[k] + c] = wide.load[base + dimension * k + c]


@piece(int, Problem, int)
def take_rod_contacts(p, simplified):
    """`take_contacts_of`"""
    take_contacts_of(p.threads, p.leaving, p.strands, simplified, p.system.band)
    return READY


@piece(bool, Problem)
def move_to_border(p):
    """`leave`"""
    return leave(p.leaving, p.bordered, p.strands, p.system.band)
