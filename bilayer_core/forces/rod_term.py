"""Contact of rods with each other and with themselves.

What is computed does not depend on the list of near pairs, which holds all contacts at any time, always in the same
order; see `contact.rod_list`.
"""

from __future__ import annotations

import math

from ..contact.rod_bound import path_to_look, rod_step_bound
from ..contact.rod_list import FIRST, PATH, list_rods, reachable
from ..contact.segment import facing_contacts
from ..jit import kernel, piece
from ..model.force_places import place_of
from ..model.records.parts import Threads
from ..model.records.problem import Problem
from ..model.records.status import NO_ROOM_FOR_RODS, READY
from ..model.records.step import Place, Stage
from .rod_contact import rod_barrier, rod_friction

ROD_BARRIER, ROD_FRICTION = map(place_of, ("rod barrier", "rod friction"))


@kernel
def _list(threads, strands, position, step, fraction, move):
    """Have a list of near pairs for a part of a step of nodes from `position`, in which they move by `move` [m]; false
    if there is no room for it.
    """
    return list_rods(
        position,
        step,
        fraction,
        move,
        threads.unit,
        threads.d_hat,
        threads.start_position,
        strands.edge_node,
        threads.edge_radius,
        threads.edge_rod,
        threads.edge_first,
        threads.edge_arc,
        threads.first_point,
        threads.point_fraction,
        threads.point_arc,
        threads.rod_meets,
        threads.rod_joined,
        threads.rod_exclusion,
        threads.box,
        threads.sweep,
        threads.met,
        threads.base,
        threads.tip,
        threads.last,
        threads.ways,
        threads.counted,
        threads.pair_point,
        threads.pair_edge,
        threads.pair_before,
        threads.pair_after,
        threads.pair_until,
    )


@kernel
def find_contacts(threads, strands, position):
    """Find where rods are nearer to each other than the barrier distance; false if there is no room for that."""
    if not threads.exists:
        return True
    if not _list(threads, strands, position, threads.no_step, 0.0, 0.0):
        return False
    contacts = threads.contacts
    contacts.counted[0] = 0
    threads.gap[0] = math.inf
    if threads.ways[PATH] < threads.ways[FIRST]:
        return True
    contacts.counted[0], gap, threads.ways[FIRST] = facing_contacts(
        position,
        threads.counted[0],
        threads.pair_point,
        threads.pair_edge,
        threads.pair_before,
        threads.pair_after,
        threads.pair_until,
        threads.ways[PATH],
        strands.edge_node,
        threads.edge_radius,
        threads.point_edge,
        threads.point_fraction,
        threads.d_hat,
        contacts.point,
        contacts.edge,
        contacts.fraction,
        contacts.inner,
        contacts.times,
        contacts.gap,
    )
    if gap < threads.d_hat:
        threads.gap[0] = gap
    return contacts.counted[0] <= contacts.point.shape[0]


@kernel
def rods_touch(threads):
    """Whether any were found nearer than the barrier distance."""
    if not threads.exists:
        return False
    return threads.contacts.counted[0] > 0


@kernel
def bound_between_rods(threads, strands, system, at):
    """Largest fraction of `System.node_step` that keeps rods apart, and whether there is room for the pairs near it."""
    if not threads.exists:
        return 1.0, True
    move, limit = reachable(system.node_step, threads.unit)
    if not _list(threads, strands, at.position, system.node_step, limit, limit * move):
        return 0.0, False
    path, way = threads.ways[PATH], 2.0 * limit * move
    if path_to_look(path, way, threads.d_hat) < threads.ways[FIRST]:
        return limit, True
    fraction, _ = rod_step_bound(
        at.position,
        system.node_step,
        limit,
        threads.d_hat,
        threads.counted[0],
        threads.pair_point,
        threads.pair_edge,
        threads.pair_until,
        path,
        way,
        strands.edge_node,
        threads.edge_radius,
        threads.point_edge,
        threads.point_fraction,
    )
    return fraction, True


@kernel
def _barrier(threads, strands, position, gradient):
    """Add the barrier's gradient at the contacts found last, and return its energy [J]."""
    contacts = threads.contacts
    return rod_barrier(
        threads.d_hat,
        threads.stiffness,
        position,
        contacts.counted[0],
        contacts.point,
        contacts.edge,
        contacts.fraction,
        contacts.inner,
        contacts.times,
        contacts.gap,
        strands.edge_node,
        threads.edge_radius,
        threads.point_edge,
        threads.point_fraction,
        threads.point_weight,
        gradient,
        contacts.node,
        contacts.weight,
        contacts.normal,
        contacts.load,
        contacts.matrix,
        contacts.side,
        contacts.turn,
        contacts.lean,
        contacts.along,
    )


@kernel
def lag_threads(threads, strands, start):
    """Freeze the contacts of friction at the start of a stage; false if there is no room for them."""
    if not threads.exists:
        return True
    if not find_contacts(threads, strands, start.position):
        return False
    found, sliding = threads.contacts, threads.sliding
    sliding.counted[0] = 0
    if found.counted[0] == 0 or not threads.slides:
        return True
    _barrier(threads, strands, start.position, threads.scratch)
    sliding.counted[0] = found.counted[0]
    for c in range(found.counted[0]):
        sliding.node[c, 0], sliding.node[c, 1], sliding.load[c] = found.node[c, 0], found.node[c, 1], found.load[c]
        for m in range(3):
            sliding.normal[c, m] = found.normal[c, m]
        for m in range(4):
            sliding.weight[c, m] = found.weight[c, m]
    return True


@kernel
def add_threads(threads, strands, at, stage, sums):
    """Barrier and friction at the contacts found last; returns the smallest gap below the barrier distance [m]."""
    if not threads.exists:
        return math.inf
    if rods_touch(threads) and sums.selected[ROD_BARRIER]:
        sums.energy[ROD_BARRIER] = _barrier(threads, strands, at.position, sums.carrier)
    sliding = threads.sliding
    if sliding.counted[0] > 0 and sums.selected[ROD_FRICTION]:
        sums.energy[ROD_FRICTION] = rod_friction(
            threads.coefficient,
            threads.threshold,
            stage.lengths[0],
            at.position,
            stage.origin_position,
            sliding.counted[0],
            sliding.node,
            sliding.weight,
            sliding.normal,
            sliding.load,
            sums.carrier,
            sliding.matrix,
        )
    return threads.gap[0]


@piece(float, Threads, Problem, Place, Stage, bool)
def add_rod_contact(threads, p, at, stage, with_hessian):
    """Barrier and friction between rods."""
    return add_threads(threads, p.strands, at, stage, p.sums)


@piece(int, Threads, Problem, Place, Stage)
def start_rod_contact(threads, p, start, stage):
    """The contacts of friction."""
    return READY if lag_threads(threads, p.strands, start) else NO_ROOM_FOR_RODS


@piece(bool, Problem, Place)
def find_rod_contacts(p, at):
    """`find_contacts`"""
    return find_contacts(p.threads, p.strands, at.position)
