"""Points on rods against the segments of other rods: nearest points, each counted once.

A point p = (1 − s) x_i + s x_{i+1} on edge (i, i+1) faces a chain of segments. For the segment (j, j+1), with e =
x_{j+1} − x_j,

    τ = (p − x_j)·e/|e|²,   t = min(max(τ, 0), 1),   D = |p − (1 − t) x_j − t x_{j+1}|,   gap d = D − r_p − r_segment

and d is once continuously differentiable. A sum of b(d) over the segments would count a point beside a node twice, so
that of the nodes between two segments is taken off again:

    B(p) = Σ_segments b(d) − Σ_inner nodes b(d_node)

On a straight chain every segment but the nearest has the distance of its node next to p: all cancels but b of the
nearest distance. Everywhere B ≥ b(nearest distance), because each inner node is no nearer than the segment on its far
side; so B is a barrier, smooth where the nearest point passes over a node, and independent of the mesh. What is left of
the sum after cancelling is listed as *contacts* with a *count* of +1 or −1: the segments with 0 < τ < 1, and each node
with the number of its segments that are nearest there (τ ≤ 0 or τ ≥ 1), less one for an inner node. A node where the
chain ends, or where the point does not see the segment beyond (`model.rod_surfaces`), is no inner node.
"""

from __future__ import annotations

import math

from ..jit import kernel


@kernel
def fraction_along(p0, p1, p2, position, j):
    """τ of a point on the segment (j, j+1), not clamped."""
    x0, x1, x2 = position[j, 0], position[j, 1], position[j, 2]
    e0, e1, e2 = position[j + 1, 0] - x0, position[j + 1, 1] - x1, position[j + 1, 2] - x2
    along = (p0 - x0) * e0 + (p1 - x1) * e1 + (p2 - x2) * e2
    return along / (e0 * e0 + e1 * e1 + e2 * e2)


@kernel
def distance_at(p0, p1, p2, position, j, t):
    """Distance [m] of a point from that at fraction t of the segment (j, j+1)."""
    d0 = p0 - (1.0 - t) * position[j, 0] - t * position[j + 1, 0]
    d1 = p1 - (1.0 - t) * position[j, 1] - t * position[j + 1, 1]
    d2 = p2 - (1.0 - t) * position[j, 2] - t * position[j + 1, 2]
    return math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@kernel
def square_distance(p0, p1, p2, position, j):
    """Square of the distance of a point from the segment (j, j+1) [m²]: what is far needs no root."""
    d0, d1, d2 = p0 - position[j, 0], p1 - position[j, 1], p2 - position[j, 2]
    e0, e1 = position[j + 1, 0] - position[j, 0], position[j + 1, 1] - position[j, 1]
    e2 = position[j + 1, 2] - position[j, 2]
    t = min(max((d0 * e0 + d1 * e1 + d2 * e2) / (e0 * e0 + e1 * e1 + e2 * e2), 0.0), 1.0)
    d0, d1, d2 = d0 - t * e0, d1 - t * e1, d2 - t * e2
    return d0 * d0 + d1 * d1 + d2 * d2


SLACK = 1.0 + 1e-9
"""Of squares that are compared before a root is taken: larger than any rounding."""


@kernel
def facing_contacts(
    position,
    pair_count,
    pair_point,
    pair_edge,
    pair_before,
    pair_after,
    until,
    path,
    edge_node,
    edge_radius,
    point_edge,
    point_fraction,
    reach,
    point_out,
    edge_out,
    fraction_out,
    inner_out,
    count_out,
    gap_out,
):
    """List the contacts nearer than `reach` [m]; return how many, their smallest gap [m] (infinite without any), and
    the path before which no pair has one.

    If there are more than the outputs have room for, the rest is counted but not written.

    Parameters
    ----------
    position : Array
        Of nodes [m], shape (n_node, 3).
    pair_count, pair_point, pair_edge, pair_before, pair_after
        From `broad_phase.near_pairs`: points, segments, and whether the point sees the segments before and after.
    until, path : Array, float
        Path before which each pair stays beyond `reach`, changed for those that are looked at, and the present one [m];
        see `rod_list`.
    edge_node, edge_radius : Array
        First node and radius [m] of each edge, shape (n_edge,).
    point_edge, point_fraction : Array
        Edge of each point and s on it, shape (n_point,).
    point_out, edge_out, fraction_out : Array
        Written: point, segment, and t of each contact.
    inner_out : Array
        Written: whether t moves with the shape (0 < τ < 1), or is that of a node.
    count_out, gap_out : Array
        Written: +1 or −1, and d [m].
    """
    found = 0
    smallest = math.inf
    first = math.inf
    for c in range(pair_count):
        if until[c] > path:
            first = min(first, until[c])
            continue
        p, k = pair_point[c], pair_edge[c]
        a = point_edge[p]
        i, j, s = edge_node[a], edge_node[k], point_fraction[p]
        p0 = (1.0 - s) * position[i, 0] + s * position[i + 1, 0]
        p1 = (1.0 - s) * position[i, 1] + s * position[i + 1, 1]
        p2 = (1.0 - s) * position[i, 2] + s * position[i + 1, 2]
        radii = edge_radius[a] + edge_radius[k]
        square = square_distance(p0, p1, p2, position, j)
        until[c] = path + math.sqrt(square) - radii - reach
        first = min(first, until[c])
        if square > (radii + reach) ** 2 * SLACK:
            continue
        along = fraction_along(p0, p1, p2, position, j)
        at_start = 1 if along <= 0.0 else 0
        if pair_before[c]:
            at_start -= 1
            if fraction_along(p0, p1, p2, position, j - 1) >= 1.0:
                at_start += 1
        for kind in range(3):  # the segment's inside, its start, its end where no other has that for its start
            if kind == 0:
                if not 0.0 < along < 1.0:
                    continue
                times, t = 1, along
            elif kind == 1:
                if at_start == 0:
                    continue
                times, t = at_start, 0.0
            else:
                if pair_after[c] or along < 1.0:
                    continue
                times, t = 1, 1.0
            gap = distance_at(p0, p1, p2, position, j, t) - radii
            if gap < reach:
                smallest = min(smallest, gap)
                found += 1
                if found > point_out.shape[0]:
                    continue
                point_out[found - 1] = p
                edge_out[found - 1] = k
                fraction_out[found - 1] = t
                inner_out[found - 1] = kind == 0
                count_out[found - 1] = times
                gap_out[found - 1] = gap
    return found, smallest, first
