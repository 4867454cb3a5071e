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

from bilayer_core.jit import kernel


@kernel
def fraction_along(p0, p1, p2, position, j):
    """Return τ of a point on the segment (j, j+1), not clamped."""
    x0, x1, x2 = position[j, 0], position[j, 1], position[j, 2]
    e0, e1, e2 = position[j + 1, 0] - x0, position[j + 1, 1] - x1, position[j + 1, 2] - x2
    along = (p0 - x0) * e0 + (p1 - x1) * e1 + (p2 - x2) * e2
    return along / (e0 * e0 + e1 * e1 + e2 * e2)


@kernel
def distance_at(p0, p1, p2, position, j, t):
    """Return the distance [m] of a point from that at fraction t of the segment (j, j+1)."""
    d0 = p0 - (1.0 - t) * position[j, 0] - t * position[j + 1, 0]
    d1 = p1 - (1.0 - t) * position[j, 1] - t * position[j + 1, 1]
    d2 = p2 - (1.0 - t) * position[j, 2] - t * position[j + 1, 2]
    return math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@kernel
def square_distance(p0, p1, p2, position, j):
    """Return the square of the distance of a point from the segment (j, j+1) [m²]: what is far needs no root."""
    d0, d1, d2 = p0 - position[j, 0], p1 - position[j, 1], p2 - position[j, 2]
    e0, e1 = position[j + 1, 0] - position[j, 0], position[j + 1, 1] - position[j, 1]
    e2 = position[j + 1, 2] - position[j, 2]
    t = min(max((d0 * e0 + d1 * e1 + d2 * e2) / (e0 * e0 + e1 * e1 + e2 * e2), 0.0), 1.0)
    d0, d1, d2 = d0 - t * e0, d1 - t * e1, d2 - t * e2
    return d0 * d0 + d1 * d1 + d2 * d2


SLACK = 1.0 + 1e-9
"""Of squares that are compared before a root is taken: larger than any rounding."""


@kernel
def facing_contacts(rods, position, path):
    """List the contacts nearer than the barrier distance; return how many, their smallest gap [m] (infinite without
    any), and the path before which no pair has one.

    If there are more than there is capacity for, the rest is counted but not written.

    Parameters
    ----------
    rods : RodContact
        Written: points, multiplicities, gaps and so on of `contacts`; the path of `search.until` before which each pair
        stays beyond the barrier distance [m], for those that are looked at (see `rod_list`).
    position : Array
        Of nodes [m], shape (n_node, 3).
    path : float
        The present one [m].
    """
    search, contacts, d_hat = rods.search, rods.contacts, rods.d_hat
    until, edge_node = search.until, search.edge_node
    node, weight, normal = contacts.node, contacts.weight, contacts.normal
    found = 0
    smallest = first = math.inf
    for c in range(search.count[0]):
        if until[c] > path:
            first = min(first, until[c])
            continue
        p, k = search.point[c], search.edge[c]
        a = search.point_edge[p]
        i, j, s = edge_node[a], edge_node[k], search.point_fraction[p]
        p0 = (1.0 - s) * position[i, 0] + s * position[i + 1, 0]
        p1 = (1.0 - s) * position[i, 1] + s * position[i + 1, 1]
        p2 = (1.0 - s) * position[i, 2] + s * position[i + 1, 2]
        radii = search.edge_radius[a] + search.edge_radius[k]
        square = square_distance(p0, p1, p2, position, j)
        until[c] = path + math.sqrt(square) - radii - d_hat
        first = min(first, until[c])
        if square > (radii + d_hat) ** 2 * SLACK:
            continue
        along = fraction_along(p0, p1, p2, position, j)
        at_start = 1 if along <= 0.0 else 0
        if search.before[c]:
            at_start -= 1
            if fraction_along(p0, p1, p2, position, edge_node[search.edge_before[k]]) >= 1.0:
                at_start += 1
        for kind in range(3):  # the segment's inside, its start, its end where no other has that for its start
            if kind == 0:
                if not 0.0 < along < 1.0:
                    continue
                multiplicity, t = 1, along
            elif kind == 1:
                if at_start == 0:
                    continue
                multiplicity, t = at_start, 0.0
            else:
                if search.after[c] or along < 1.0:
                    continue
                multiplicity, t = 1, 1.0
            gap = distance_at(p0, p1, p2, position, j, t) - radii
            if not gap < d_hat:
                continue
            smallest = min(smallest, gap)
            found += 1
            if found > contacts.point.shape[0]:
                continue
            n = found - 1
            contacts.point[n], contacts.multiplicity[n], contacts.inner[n] = p, multiplicity, kind == 0
            contacts.gap[n], contacts.distance[n] = gap, gap + radii
            node[n, 0], node[n, 1] = i, j
            weight[n, 0], weight[n, 1], weight[n, 2], weight[n, 3] = 1.0 - s, s, t - 1.0, -t
            for m in range(3):
                between = weight[n, 0] * position[i, m] + weight[n, 1] * position[i + 1, m]
                between += weight[n, 2] * position[j, m] + weight[n, 3] * position[j + 1, m]
                normal[n, m] = between / contacts.distance[n]
    return found, smallest, first
