"""When points and segments of rods that are near each other are listed anew.

A list is made for a straight motion of all nodes, from x₀ to x₁, with a margin m. It holds every pair that can come
nearer than the barrier distance while nodes are no farther than m/2 from that motion, the mean displacement taken off
(a Verlet list; Verlet 1967). So one list serves a fast step as well as a slow one: what counts is how pairs move
towards each other, not how far they go, and lists are short.
"""

from __future__ import annotations

from ..jit import kernel
from .broad_phase import near_pairs
from .rod_bound import largest_spread

MARGIN = 0.5
"""Of a list, in units of the barrier distance and the thickest layer together."""
LARGEST_MOVE = 8.0
"""Likewise; longer steps are cut short."""


@kernel
def largest_fraction(step, no_step, unit):
    """Part of a step of nodes [m], shape (n_node, 3), for which there can be a list; `no_step` is zero."""
    move, largest = largest_spread(step, no_step, 0.0, no_step), LARGEST_MOVE * unit
    return largest / move if move > largest else 1.0


@kernel
def _is_near(position, step, fraction, base, tip, distance):
    if largest_spread(position, step, fraction, base) <= distance:
        return True
    return largest_spread(position, step, fraction, tip) <= distance


@kernel
def list_rods(
    position,
    step,
    fraction,
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
    listed,
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
    unit : float
        Barrier distance and thickest layer together [m].
    touch : float
        Barrier distance [m].
    start_position, edge_node … rod_exclusion, point_out … after_out
        As for `near_pairs`.
    base, tip, listed, count : Array
        Positions from which to which the list was made [m], whether there is one, and how many pairs it has, shapes
        (n_node, 3), (n_node, 3), (1,), (1,). Changed.
    """
    half = 0.5 * MARGIN * unit
    if listed[0] == 1 and _is_near(position, step, 0.0, base, tip, half):
        if fraction == 0.0 or _is_near(position, step, fraction, base, tip, half):
            return True
    for i in range(position.shape[0]):
        for c in range(3):
            base[i, c], tip[i, c] = position[i, c], position[i, c] + fraction * step[i, c]
    count[0] = near_pairs(
        base,
        tip,
        start_position,
        touch,
        touch + 2.0 * half,
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
    listed[0] = count[0] <= point_out.shape[0]
    return listed[0] == 1
