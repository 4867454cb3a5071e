"""Rods near each other: a short list within the list of near pairs, made anew in the loop.

The list of pairs reaches far, so that it lasts for many steps (`solve.rod_contact`); most of its pairs are nowhere near
contact. Those nearer than the barrier distance and a margin are kept in a list of their own until nodes have moved by
half of that margin, the mean displacement taken off.
"""

from __future__ import annotations

from ..contact.rod_bound import largest_travel, rod_step_bound
from ..contact.segment import distance_at, facing_contacts, fraction_along
from ..jit import inner
from .copying import copy

AHEAD = 2.5
"""Margin of a short list, in units of the step that demands it."""


@inner
def _shorten(threads, strands, position, margin):
    """Keep the pairs nearer than the barrier distance and a margin [m]."""
    found, reach = 0, threads.d_hat + margin
    for c in range(threads.pair_count):
        p, k = threads.pair_point[c], threads.pair_edge[c]
        a, j, s = threads.point_edge[p], strands.edge_node[k], threads.point_fraction[p]
        i = strands.edge_node[a]
        p0 = (1.0 - s) * position[i, 0] + s * position[i + 1, 0]
        p1 = (1.0 - s) * position[i, 1] + s * position[i + 1, 1]
        p2 = (1.0 - s) * position[i, 2] + s * position[i + 1, 2]
        t = min(max(fraction_along(p0, p1, p2, position, j), 0.0), 1.0)
        gap = distance_at(p0, p1, p2, position, j, t) - threads.edge_radius[a] - threads.edge_radius[k]
        if gap < reach:
            threads.near_point[found], threads.near_edge[found] = p, k
            threads.near_before[found], threads.near_after[found] = threads.pair_before[c], threads.pair_after[c]
            found += 1
    threads.near_count[0], threads.near_margin[0] = found, margin
    copy(position, threads.near_base)


@inner
def _reach(threads, strands, position, step, fraction):
    """Have a short list that is valid at `position` and over a fraction of a step from there; false if all pairs
    together are not.
    """
    travel, move = largest_travel(position, step, threads.base)
    if fraction < 1.0:
        travel, _ = largest_travel(position, threads.no_step, threads.base)
        travel += fraction * move
    if not travel <= 0.5 * threads.margin:
        copy(position, threads.wanted)
        threads.wanted_move[0] = fraction * move
        return False
    if threads.pair_count == 0:
        return True
    travel, _ = largest_travel(position, threads.no_step, threads.near_base)
    if not travel + fraction * move <= 0.5 * threads.near_margin[0]:
        _shorten(threads, strands, position, max(threads.least_margin, AHEAD * fraction * move))
    return True


@inner
def rods_touch(threads, strands, at):
    """Whether rods are nearer to each other than the barrier distance; where the list of pairs does not reach, so far
    as it does: the bound of the step that led there has asked for another list.
    """
    if threads is None:
        return False
    if not _reach(threads, strands, at.position, threads.no_step, 1.0) or threads.near_count[0] == 0:
        return False
    count, _ = facing_contacts(
        at.position,
        threads.near_count[0],
        threads.near_point,
        threads.near_edge,
        threads.near_before,
        threads.near_after,
        strands.edge_node,
        threads.edge_radius,
        threads.point_edge,
        threads.point_fraction,
        threads.d_hat,
        threads.point,
        threads.edge,
        threads.fraction,
        threads.inner,
        threads.times,
        threads.gap,
    )
    return count > 0


@inner
def bound_between_rods(threads, strands, system, at):
    """Largest fraction of `System.node_step` that keeps rods apart, and whether the list of pairs reaches so far."""
    if threads is None:
        return 1.0, True
    _, move = largest_travel(at.position, system.node_step, threads.base)
    limit = 0.4 * threads.largest_margin / move if move > 0.4 * threads.largest_margin else 1.0
    if not _reach(threads, strands, at.position, system.node_step, limit):
        return 0.0, False
    if threads.near_count[0] == 0:
        return limit, True
    fraction, _ = rod_step_bound(
        at.position,
        system.node_step,
        limit,
        threads.near_count[0],
        threads.near_point,
        threads.near_edge,
        strands.edge_node,
        threads.edge_radius,
        threads.point_edge,
        threads.point_fraction,
    )
    return fraction, True
