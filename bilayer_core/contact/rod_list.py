"""When points and segments of rods that are near each other are listed anew.

A list is made for a straight motion of all nodes, from x₀ to x₁, with a margin m. It holds every pair that can come
nearer than the barrier distance while nodes are no farther than m/2 from that motion, the mean displacement taken off
(a Verlet list; Verlet 1967). So one list serves a fast step as well as a slow one: what counts is how pairs move
towards each other, not how far they go, and lists are short.
"""

from __future__ import annotations

import math

from ..jit import kernel
from .broad_phase import near_pairs

MARGIN = 0.5
"""Of a list, in units of the barrier distance and the thickest layer together."""
LARGEST_MOVE = 8.0
"""Likewise; longer steps are cut short."""


@kernel
def _departure(position, step, fraction, base):
    """Largest distance of a node at x + fraction · step from its place in `base` [m], the mean of all taken off, as in
    `base`.
    """
    count = position.shape[0]
    m0, m1, m2 = 0.0, 0.0, 0.0
    for i in range(count):
        m0 += position[i, 0] + fraction * step[i, 0]
        m1 += position[i, 1] + fraction * step[i, 1]
        m2 += position[i, 2] + fraction * step[i, 2]
    m0, m1, m2 = m0 / count, m1 / count, m2 / count
    largest = 0.0
    for i in range(count):
        d0 = position[i, 0] + fraction * step[i, 0] - base[i, 0] - m0
        d1 = position[i, 1] + fraction * step[i, 1] - base[i, 1] - m1
        d2 = position[i, 2] + fraction * step[i, 2] - base[i, 2] - m2
        largest = max(largest, d0 * d0 + d1 * d1 + d2 * d2)
    return math.sqrt(largest)


@kernel
def reachable(step, no_step, unit):
    """Largest motion of a node in a step [m], the mean of all taken off, and the part of the step for which there can
    be a list; `no_step` is zero.

    A translation common to all nodes brings none of them nearer to another.
    """
    move, largest = _departure(no_step, step, 1.0, no_step), LARGEST_MOVE * unit
    return move, largest / move if move > largest else 1.0


@kernel
def _is_listed(position, step, fraction, move, base, tip, half):
    """Whether nodes stay within `half` [m] of a list's motion while they go by `move` from x to x + fraction · step."""
    from_base = _departure(position, step, 0.0, base)
    if from_base + move <= half:
        return True
    from_tip = _departure(position, step, 0.0, tip)
    if min(from_base, from_tip) + move <= half:
        return True
    if move == 0.0 or min(from_base, from_tip) > half:
        return False
    at_end = _departure(position, step, fraction, tip)
    return min(at_end, _departure(position, step, fraction, base)) <= half


@kernel
def _centre(position, step, fraction, out):
    """x + fraction · step, the mean taken off."""
    count = position.shape[0]
    for c in range(3):
        mean = 0.0
        for i in range(count):
            mean += (position[i, c] + fraction * step[i, c]) / count
        for i in range(count):
            out[i, c] = position[i, c] + fraction * step[i, c] - mean


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
    base,
    tip,
    margin,
    count,
    point_out,
    edge_out,
    before_out,
    after_out,
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
    start_position, edge_node … rod_exclusion, point_out … after_out
        As for `near_pairs`.
    base, tip, margin, count : Array
        Positions from which to which the list was made, their mean taken off [m], its margin [m] (0: there is none),
        and how many pairs it has, shapes (n_node, 3), (n_node, 3), (1,), (1,). Changed.
    """
    if margin[0] > 0.0 and _is_listed(position, step, fraction, move, base, tip, 0.5 * margin[0]):
        return True
    _centre(position, step, 0.0, base)
    _centre(position, step, fraction, tip)
    margin[0] = MARGIN * unit
    count[0] = near_pairs(
        base,
        tip,
        start_position,
        touch,
        touch + margin[0],
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
        point_out,
        edge_out,
        before_out,
        after_out,
    )
    if count[0] > point_out.shape[0]:
        margin[0] = 0.0
        return False
    return True
