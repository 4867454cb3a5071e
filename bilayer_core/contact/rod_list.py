"""When points and segments of rods that are near each other are listed anew.

A list is made for a straight motion of all nodes, from x₀ to x₁, with a margin m. It holds every pair that can come
nearer than the barrier distance while nodes are no farther than m/2 from that motion, the mean displacement taken off
(a Verlet list; Verlet 1967). So one list serves a fast step as well as a slow one: what counts is how pairs move
towards each other, not how far they go, and lists are short. A short motion is prolonged, so that the list serves the
steps to come if they go on as straight as that.

A gap closes by no more than twice what nodes go, the mean taken off. The sum of that over all moves since a list was
made is its *path*; a pair is not looked at again before the path is longer by what the gap was above the barrier
distance when it was found, in making the list or later. So most pairs cost a comparison.
"""

from __future__ import annotations

import math

from ..jit import kernel
from .broad_phase import near_pairs

MARGIN = 0.3
"""Of a list, in units of the barrier distance and the thickest layer together."""
AHEAD, MOST_AHEAD = 1.0, 32.0
"""How far a motion is prolonged, in the same units, and in lengths of its own at most."""
LARGEST_MOVE = 8.0
"""In the same units; longer steps are cut short."""
MADE, ROOM, PATH, FIRST = 0, 1, 2, 3
"""Places in `ways`."""


@kernel
def reachable(step, unit):
    """Largest motion of a node in a step [m], the mean of all taken off, and the part of the step for which there can
    be a list.

    A translation common to all nodes brings none of them nearer to another.
    """
    m0, m1, m2 = _mean(step)
    square = 0.0
    for i in range(step.shape[0]):
        d0, d1, d2 = step[i, 0] - m0, step[i, 1] - m1, step[i, 2] - m2
        square = max(square, d0 * d0 + d1 * d1 + d2 * d2)
    move, largest = math.sqrt(square), LARGEST_MOVE * unit
    return move, largest / move if move > largest else 1.0


@kernel
def _mean(vectors):
    m0, m1, m2 = 0.0, 0.0, 0.0
    count = vectors.shape[0]
    for i in range(count):
        m0 += vectors[i, 0]
        m1 += vectors[i, 1]
        m2 += vectors[i, 2]
    return m0 / count, m1 / count, m2 / count


@kernel
def _go_on(position, last):
    """Take nodes, the mean of all taken off, to where they are; return the largest distance from where they were
    last [m].
    """
    m0, m1, m2 = _mean(position)
    square = 0.0
    for i in range(position.shape[0]):
        x0, x1, x2 = position[i, 0] - m0, position[i, 1] - m1, position[i, 2] - m2
        d0, d1, d2 = x0 - last[i, 0], x1 - last[i, 1], x2 - last[i, 2]
        last[i, 0], last[i, 1], last[i, 2] = x0, x1, x2
        square = max(square, d0 * d0 + d1 * d1 + d2 * d2)
    return math.sqrt(square)


@kernel
def _stray(position, step, fraction, base, tip):
    """Largest distance of a node at x + fraction · step from a list's motion, at the moment of this that is nearest to
    all [m], the mean of all taken off, as in `base` and `tip`.
    """
    count = position.shape[0]
    m0, m1, m2, along, square = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        x0 = position[i, 0] + fraction * step[i, 0]
        x1 = position[i, 1] + fraction * step[i, 1]
        x2 = position[i, 2] + fraction * step[i, 2]
        way0, way1, way2 = tip[i, 0] - base[i, 0], tip[i, 1] - base[i, 1], tip[i, 2] - base[i, 2]
        m0, m1, m2 = m0 + x0, m1 + x1, m2 + x2
        along += (x0 - base[i, 0]) * way0 + (x1 - base[i, 1]) * way1 + (x2 - base[i, 2]) * way2
        square += way0 * way0 + way1 * way1 + way2 * way2
    m0, m1, m2 = m0 / count, m1 / count, m2 / count
    moment = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    largest = 0.0
    for i in range(count):
        d0 = position[i, 0] + fraction * step[i, 0] - m0 - base[i, 0] - moment * (tip[i, 0] - base[i, 0])
        d1 = position[i, 1] + fraction * step[i, 1] - m1 - base[i, 1] - moment * (tip[i, 1] - base[i, 1])
        d2 = position[i, 2] + fraction * step[i, 2] - m2 - base[i, 2] - moment * (tip[i, 2] - base[i, 2])
        largest = max(largest, d0 * d0 + d1 * d1 + d2 * d2)
    return math.sqrt(largest)


@kernel
def _set_out(position, step, length, base, tip, last):
    """A motion from x to x + length · step, the mean of all taken off at either end; nodes go on from there."""
    m0, m1, m2 = _mean(position)
    w0, w1, w2 = _mean(step)
    for i in range(position.shape[0]):
        x0, x1, x2 = position[i, 0] - m0, position[i, 1] - m1, position[i, 2] - m2
        base[i, 0], base[i, 1], base[i, 2] = x0, x1, x2
        last[i, 0], last[i, 1], last[i, 2] = x0, x1, x2
        tip[i, 0] = x0 + length * (step[i, 0] - w0)
        tip[i, 1] = x1 + length * (step[i, 1] - w1)
        tip[i, 2] = x2 + length * (step[i, 2] - w2)


@kernel
def list_rods(
    position,
    step,
    fraction,
    move,
    unit,
    touch,
    start_position,
    edge_node,
    edge_radius,
    edge_rod,
    edge_first,
    edge_arc,
    first_point,
    point_fraction,
    point_arc,
    rod_meets,
    rod_joined,
    rod_exclusion,
    box,
    sweep,
    met,
    base,
    tip,
    last,
    ways,
    count,
    point_out,
    edge_out,
    before_out,
    after_out,
    until_out,
):
    """Have a list that holds all pairs nearer than the barrier distance at x + β step, 0 ≤ β ≤ `fraction`; false if
    there is no room for it, and then there is none.

    Parameters
    ----------
    position, step : Array
        Of nodes: x and a step [m], shape (n_node, 3).
    move : float
        Largest motion in that part of the step, see `reachable` [m].
    unit : float
        Barrier distance and thickest layer together [m].
    touch : float
        Barrier distance [m].
    start_position, edge_node … met, point_out … after_out
        As for `near_pairs`.
    base, tip, last : Array
        Positions from which to which the list was made, and where nodes were last, their mean taken off [m], shape
        (n_node, 3). Changed.
    ways : Array
        Margin of the list [m] (0: there is none), how far nodes may go on in any direction for it to serve, its
        path [m], and that before which none of its pairs comes to the barrier distance, shape (4,). Changed.
    count : Array
        How many pairs the list has, shape (1,). Changed.
    until_out : Array
        Path before which each pair stays beyond the barrier distance [m].
    """
    if move == 0.0:
        gone = _go_on(position, last)
        ways[ROOM] -= gone
        ways[PATH] += 2.0 * gone
    if move <= ways[ROOM]:
        return True
    if ways[MADE] > 0.0:
        ways[ROOM] = 0.5 * ways[MADE] - _stray(position, step, 0.0, base, tip)
        if ways[ROOM] >= 0.0:
            if move <= ways[ROOM] or _stray(position, step, fraction, base, tip) <= 0.5 * ways[MADE]:
                return True
    ahead = min(max(AHEAD * unit / move, 1.0), MOST_AHEAD) if move > 0.0 else 1.0
    _set_out(position, step, ahead * fraction, base, tip, last)
    ways[MADE], ways[ROOM], ways[PATH] = MARGIN * unit, 0.5 * MARGIN * unit, 0.0
    count[0] = near_pairs(
        base,
        tip,
        start_position,
        touch,
        touch + ways[MADE],
        edge_node,
        edge_radius,
        edge_rod,
        edge_first,
        edge_arc,
        first_point,
        point_fraction,
        point_arc,
        rod_meets,
        rod_joined,
        rod_exclusion,
        box,
        sweep,
        met,
        point_out,
        edge_out,
        before_out,
        after_out,
        until_out,
    )
    if count[0] > point_out.shape[0]:
        ways[MADE], ways[ROOM] = 0.0, -1.0
        return False
    first = math.inf
    for c in range(count[0]):
        first = min(first, until_out[c])
    ways[FIRST] = first
    return True
