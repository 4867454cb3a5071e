"""When points and segments of rods that are near each other are listed anew.

A list is made for a straight motion of all nodes, from x₀ to x₁, with a margin m. It holds every pair that can come
nearer than the barrier distance while nodes are no farther than m/2 from that motion, the mean displacement taken off
(a Verlet list; Verlet 1967). So one list serves a fast step as well as a slow one: what counts is how pairs move
towards each other, not how far they go, and lists are short. A short motion is prolonged, so that the list serves the
steps to come if they go on as straight as that.

Where rods meet off their nodes, all this is about their rails (`contact.rails`). Their way in a step is not straight:
the margin covers by how much at most they *stray* from it.

A gap closes by no more than twice what nodes go, the mean taken off. The sum of that over all moves since a list was
made is its *path*; a pair is not looked at again before the path is longer by what the gap was above the barrier
distance when it was found, in making the list or later. So most pairs cost a comparison.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel

MARGIN = 0.3
"""Of a list, in units of the barrier distance and the thickest layer together."""
AHEAD, MOST_AHEAD = 1.0, 32.0
"""How far a motion is prolonged, in the same units, and in lengths of its own at most."""
LARGEST_MOVE = 8.0
"""In the same units; longer steps are cut short."""
MADE, LEFT, PATH, FIRST = 0, 1, 2, 3
"""Places in `RodContact.ways`: margin of the list [m] (0: there is none), how far nodes may go on in any direction for
it to serve, its path [m], and that before which none of its pairs comes to the barrier distance."""


@kernel
def largest_motion(step):
    """Return the largest motion of a node in a step [m], the mean of all taken off.

    A translation common to all nodes brings none of them nearer to another.
    """
    m0, m1, m2 = _mean(step)
    square = 0.0
    for i in range(step.shape[0]):
        d0, d1, d2 = step[i, 0] - m0, step[i, 1] - m1, step[i, 2] - m2
        square = max(square, d0 * d0 + d1 * d1 + d2 * d2)
    return math.sqrt(square)


@kernel
def reachable(move, limit, unit):
    """Return the part of a step, up to `limit`, for which there can be a list if all move by `move` in it [m]."""
    largest = LARGEST_MOVE * unit
    return largest / move if limit * move > largest else limit


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
def _stray(search, position, step, fraction):
    """Return the largest distance of a node at x + fraction · step from a list's motion, at the moment of this that is
    nearest to all [m], the mean of all taken off, as in `RodSearch.base` and `tip`.
    """
    base, tip = search.base, search.tip
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
def list_serves(rods, position, step, fraction, move, stray):
    """Return whether the list holds all pairs nearer than the barrier distance at x + β step, 0 ≤ β ≤ `fraction`, and
    up to `stray` from there.

    Parameters
    ----------
    rods : RodContact
        Its path, and where nodes were last, are brought up to date.
    position, step : Array
        Of nodes: x and a step [m], shape (n_node, 3).
    fraction : float
    move : float
        Largest motion in that part of the step, see `reachable` [m].
    stray : float
        [m]
    """
    ways = rods.ways
    if move == 0.0:  # nodes are at x now
        last, square = rods.last, 0.0
        m0, m1, m2 = _mean(position)
        for i in range(position.shape[0]):
            x0, x1, x2 = position[i, 0] - m0, position[i, 1] - m1, position[i, 2] - m2
            d0, d1, d2 = x0 - last[i, 0], x1 - last[i, 1], x2 - last[i, 2]
            last[i, 0], last[i, 1], last[i, 2] = x0, x1, x2
            square = max(square, d0 * d0 + d1 * d1 + d2 * d2)
        gone = math.sqrt(square)
        ways[LEFT] -= gone
        ways[PATH] += 2.0 * gone
    if move <= ways[LEFT]:
        return True
    if ways[MADE] <= 0.0:
        return False
    ways[LEFT] = 0.5 * ways[MADE] - _stray(rods.search, position, step, 0.0)
    if ways[LEFT] < 0.0:
        return False
    return move <= ways[LEFT] or _stray(rods.search, position, step, fraction) + stray <= 0.5 * ways[MADE]


@kernel
def begin_list(rods, position, step, fraction, move, stray):
    """Take over the motion for which a list is made next, the mean of all nodes taken off at either end; nodes go on
    from its beginning. Parameters are as for `list_serves`; returns the margin [m].
    """
    ahead = min(max(AHEAD * rods.unit / move, 1.0), MOST_AHEAD) if move > 0.0 else 1.0
    base, tip, last, length = rods.search.base, rods.search.tip, rods.last, ahead * fraction
    m0, m1, m2 = _mean(position)
    w0, w1, w2 = _mean(step)
    for i in range(position.shape[0]):
        x0, x1, x2 = position[i, 0] - m0, position[i, 1] - m1, position[i, 2] - m2
        base[i, 0], base[i, 1], base[i, 2] = x0, x1, x2
        last[i, 0], last[i, 1], last[i, 2] = x0, x1, x2
        tip[i, 0] = x0 + length * (step[i, 0] - w0)
        tip[i, 1] = x1 + length * (step[i, 1] - w1)
        tip[i, 2] = x2 + length * (step[i, 2] - w2)
    margin = MARGIN * rods.unit + 2.0 * stray
    rods.ways[MADE], rods.ways[LEFT], rods.ways[PATH] = margin, 0.5 * margin, 0.0
    return margin


@kernel
def end_list(rods):
    """Note from which path on pairs of the new list count; false if there is no capacity, and then no list."""
    search, ways = rods.search, rods.ways
    if search.count[0] > search.point.shape[0]:
        ways[MADE], ways[LEFT] = 0.0, -1.0
        return False
    first = math.inf
    for c in range(search.count[0]):
        first = min(first, search.until[c])
    ways[FIRST] = first
    return True
