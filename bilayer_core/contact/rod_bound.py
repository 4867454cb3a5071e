"""The largest fraction of a step over which points of rods stay clear of segments: conservative advancement.

Along a straight step a point nears a segment no faster than it nears one of the segment's ends, v = max |δp − δx_j|,
|δp − δx_{j+1}|, so the distance D falls by at most v β over the fraction β. The step is gone through in parts that use
up no more than what is left of D above the distance to keep; these are long where the two do not meet head-on, and a
few of them come as near as `TOUCH` of the gap.
"""

from __future__ import annotations

import math

from bilayer_core.contact.rod_list import FIRST, PATH
from bilayer_core.contact.segment import SLACK
from bilayer_core.contact.step_bound import KEPT_FRACTION
from bilayer_core.jit import kernel

TOUCH = 0.05  # of the gap: nearer to the distance to keep than this, the search ends
MAX_PARTS = 1000
FAR, NEAR = 8.0, 2.0  # barrier distances: `KEPT_FRACTION` of one and `TOUCH` of the other together are less than one


@kernel
def rod_step_bound(rods, position, step, limit, closing):
    """Largest α ≤ `limit` found such that all gaps keep `KEPT_FRACTION` of themselves along x + β step, 0 ≤ β ≤ α.

    A pair that stays beyond the barrier distance sets no bound: of large gaps less is kept. So what is found does not
    depend on which of these pairs are listed, or looked at.

    Parameters
    ----------
    rods : RodContact
    position, step : Array
        Of nodes [m], shape (n_node, 3).
    limit : float
    closing : float
        By how much gaps close in the part of the step up to `limit` at most [m].
    """
    search, d_hat, alpha = rods.search, rods.d_hat, limit
    # Up to this path a pair keeps clear of the barrier in the step, or keeps enough of its gap head-on.
    looked = rods.ways[PATH] + min(closing, closing / (1.0 - KEPT_FRACTION) - d_hat)
    if looked < rods.ways[FIRST]:
        return limit
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
        square = _square_distance(position, step, 0.0, i, s, j)
        if square > (radii + speed * alpha / (1.0 - KEPT_FRACTION)) ** 2 * SLACK:
            continue  # even head-on
        gone, gap = 0.0, math.sqrt(square) - radii
        keep = KEPT_FRACTION * min(gap, FAR * d_hat)
        near = TOUCH * min(gap, NEAR * d_hat)
        left_over = gap - keep
        part = 0
        while gone < alpha and speed * (alpha - gone) > left_over:
            if part > 0 and (left_over < near or part == MAX_PARTS):
                alpha = gone
                break
            gone += left_over / speed
            if gone < alpha:
                left_over = math.sqrt(_square_distance(position, step, gone, i, s, j)) - radii - keep
            part += 1
    return alpha


@kernel
def _square_distance(position, step, fraction, i, s, j):
    """Square of the distance of the point at s on (i, i+1) from the segment (j, j+1) at x + fraction · step [m²]."""
    p0 = (1.0 - s) * (position[i, 0] + fraction * step[i, 0]) + s * (position[i + 1, 0] + fraction * step[i + 1, 0])
    p1 = (1.0 - s) * (position[i, 1] + fraction * step[i, 1]) + s * (position[i + 1, 1] + fraction * step[i + 1, 1])
    p2 = (1.0 - s) * (position[i, 2] + fraction * step[i, 2]) + s * (position[i + 1, 2] + fraction * step[i + 1, 2])
    x0, x1, x2 = (
        position[j, 0] + fraction * step[j, 0],
        position[j, 1] + fraction * step[j, 1],
        position[j, 2] + fraction * step[j, 2],
    )
    e0 = position[j + 1, 0] + fraction * step[j + 1, 0] - x0
    e1 = position[j + 1, 1] + fraction * step[j + 1, 1] - x1
    e2 = position[j + 1, 2] + fraction * step[j + 1, 2] - x2
    p0, p1, p2 = p0 - x0, p1 - x1, p2 - x2
    t = min(max((p0 * e0 + p1 * e1 + p2 * e2) / (e0 * e0 + e1 * e1 + e2 * e2), 0.0), 1.0)
    p0, p1, p2 = p0 - t * e0, p1 - t * e1, p2 - t * e2
    return p0 * p0 + p1 * p1 + p2 * p2
