"""The largest fraction of a step over which points of rods stay clear of segments: conservative advancement.

Along a straight step a point nears a segment no faster than it nears one of the segment's ends, v = max |δp − δx_j|,
|δp − δx_{j+1}|, so the distance D falls by at most v β over the fraction β. The step is gone through in parts that use
up no more than what is left of D above the distance to keep; these are long where the two do not meet head-on, and a
few of them come as near as `TOUCH` of the gap. Rails (`contact.rails`) go faster than their nodes by their swings at
most; where they are by then is computed exactly.
"""

from __future__ import annotations

import math

from bilayer_core.contact.facet import BORDERS, SLACK, mix, nearest_on_facet, square_between
from bilayer_core.contact.rails import rail_in_step, swing_of
from bilayer_core.contact.rod_list import PATH
from bilayer_core.contact.step_bound import KEPT_FRACTION
from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import combine, combine3, dot

TOUCH = 0.05  # of the gap: nearer to the distance to keep than this, the search ends
MAX_PARTS = 1000
FAR, NEAR = 8.0, 2.0  # barrier distances: `KEPT_FRACTION` of one and `TOUCH` of the other together are less than one


@kernel
def rod_step_bound(rods, strands, system, at, position, limit, closing):
    """Return the largest α ≤ `limit` found such that all gaps keep `KEPT_FRACTION` of themselves in all parts of a step
    up to α.

    A pair that stays beyond the barrier distance sets no bound: of large gaps less is kept. So what is found does not
    depend on which of these pairs are listed, or looked at.

    Parameters
    ----------
    rods : RodContact
    strands : Strands
    system : System
        With the step.
    at : Configuration
    position : Array
        Of rails [m], shape (n_node, 3).
    limit : float
    closing : float
        By how much gaps close in the part of the step up to `limit` at most [m].
    """
    search, d_hat, alpha, step, rails = rods.search, rods.d_hat, limit, system.node_step, rods.rails
    looked = path_to_look_at(rods, closing)
    for c in range(search.count[0]):
        if search.until[c] > looked:
            continue
        p, k = search.point[c], search.edge[c]
        a = search.point_edge[p]
        i, j, s = search.edge_node[a], search.edge_node[k], search.point_fraction[p]
        radii = search.edge_radius[a] + search.edge_radius[k]
        left, right = 0.0, 0.0
        for m in range(3):
            own = (1.0 - s) * step[i, m] + s * step[i + 1, m]
            left += (own - step[j, m]) ** 2
            right += (own - step[j + 1, m]) ** 2
        speed = math.sqrt(max(left, right))
        if rails.exists:
            speed += _swing(rails, strands, system, at, limit, search, a)
            speed += _swing(rails, strands, system, at, limit, search, k)
        if search.edge_right[a] < 0 and search.edge_right[k] < 0:
            square = _square_distance(position, step, 0.0, i, s, j)
        else:
            square = square_between(search, position, p, k)
        if square > (radii + speed * alpha / (1.0 - KEPT_FRACTION)) ** 2 * SLACK:
            continue  # even head-on
        gone, gap = 0.0, math.sqrt(square) - radii
        keep = KEPT_FRACTION * min(gap, FAR * d_hat)
        near = TOUCH * min(gap, NEAR * d_hat)
        left_over = max(gap - keep, 0.0)
        part = 0
        while gone < alpha and speed * (alpha - gone) > left_over:
            if part > 0 and (left_over < near or part == MAX_PARTS):
                alpha = gone
                break
            gone += left_over / speed
            if gone < alpha:
                if rails.exists:
                    square = _square_of_rails(rails, search, strands, system, at, gone, p, k)
                else:
                    square = _square_distance(position, step, gone, i, s, j)
                left_over = math.sqrt(square) - radii - keep
            part += 1
    return alpha


@kernel
def path_to_look_at(rods, closing):
    """Return the path up to which a pair keeps clear of the barrier, or keeps enough of its gap head-on [m], while gaps
    close by `closing` at most [m]: pairs with a longer one set no bound.
    """
    return rods.ways[PATH] + min(closing, closing / (1.0 - KEPT_FRACTION) - rods.d_hat)


@kernel
def _square_distance(position, step, fraction, i, s, j):
    """Return the square of the distance of the point at s on (i, i+1) from the segment (j, j+1) at x + fraction · step
    [m²].
    """
    x0, x1 = _moved(position, step, fraction, i), _moved(position, step, fraction, i + 1)
    return _between(x0, x1, s, _moved(position, step, fraction, j), _moved(position, step, fraction, j + 1))


@kernel
def _moved(position, step, fraction, i):
    """Return row i of x + fraction · step, as a tuple."""
    return (
        position[i, 0] + fraction * step[i, 0],
        position[i, 1] + fraction * step[i, 1],
        position[i, 2] + fraction * step[i, 2],
    )


@kernel
def _swing(rails, strands, system, at, part, search, k):
    """Return the largest swing of a rail of an edge in a part of a step [m]."""
    j, r = search.edge_node[k], search.edge_right[k]
    largest = max(swing_of(rails, strands, system, at, part, j), swing_of(rails, strands, system, at, part, j + 1))
    if r < 0:
        return largest
    largest = max(largest, swing_of(rails, strands, system, at, part, r))
    return max(largest, swing_of(rails, strands, system, at, part, r + 1))


@kernel
def _square_of_rails(rails, search, strands, system, at, part, p, k):
    """Return the square of the distance of a point from what it sees of an edge by a part of a step, both of rails
    [m²].
    """
    a, s = search.point_edge[p], search.point_fraction[p]
    i, r = search.edge_node[a], search.edge_right[a]
    x0 = rail_in_step(rails, strands, system, at, i, part)
    x1 = rail_in_step(rails, strands, system, at, i + 1, part)
    x = mix(s, x0, x1)
    if r >= 0:
        first = rail_in_step(rails, strands, system, at, r, part)
        last = rail_in_step(rails, strands, system, at, r + 1, part)
        x = mix(search.point_across[p], x, mix(s, first, last))
    j, r = search.edge_node[k], search.edge_right[k]
    l0 = rail_in_step(rails, strands, system, at, j, part)
    l1 = rail_in_step(rails, strands, system, at, j + 1, part)
    if r < 0:
        return _between(x0, x1, s, l0, l1) if search.edge_right[a] < 0 else _between(x, x, 0.0, l0, l1)
    r0 = rail_in_step(rails, strands, system, at, r, part)
    r1 = rail_in_step(rails, strands, system, at, r + 1, part)
    if search.point_sees[p] == BORDERS:
        return min(_between(x, x, 0.0, l0, l1), _between(x, x, 0.0, r0, r1))
    t, v = nearest_on_facet(l0, l1, r0, r1, x)
    away = combine(1.0, x, -1.0, mix(v, mix(t, l0, l1), mix(t, r0, r1)))
    return dot(away, away)


@kernel
def _between(x0, x1, s, y0, y1):
    """Return the square of the distance of the point at s between x0 and x1 from the segment between y0 and y1 [m²]."""
    p = combine3(1.0 - s, x0, s, x1, -1.0, y0)
    e = combine(1.0, y1, -1.0, y0)
    t = min(max(dot(p, e) / dot(e, e), 0.0), 1.0)
    r = combine(1.0, p, -t, e)
    return dot(r, r)
