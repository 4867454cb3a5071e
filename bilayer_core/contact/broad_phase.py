"""Which points of rods are near which segments, at a cost linear in the number of edges.

Edges are sorted into cubic cells by their midpoints; the cells are as wide as two edges that just reach each other are
apart, so an edge looks into its own cell and the 26 around it. Cells are kept in a hash table with chains.
"""

from __future__ import annotations

import math

import numpy as np

from ..jit import allocating, kernel
from .segment import distance_at, fraction_along


@kernel
def _bucket(cx, cy, cz, mask):
    """Place of a cell in a table of mask + 1 places."""
    return (cx * 73856093 ^ cy * 19349663 ^ cz * 83492791) & mask


@kernel
def _nearest(position, i, s, j):
    """Distance [m] of the point at s on edge (i, i+1) from the segment (j, j+1)."""
    p0 = (1.0 - s) * position[i, 0] + s * position[i + 1, 0]
    p1 = (1.0 - s) * position[i, 1] + s * position[i + 1, 1]
    p2 = (1.0 - s) * position[i, 2] + s * position[i + 1, 2]
    t = min(max(fraction_along(p0, p1, p2, position, j), 0.0), 1.0)
    return distance_at(p0, p1, p2, position, j, t)


@kernel
def _sees(
    a,
    arc,
    s,
    k,
    start_position,
    touch,
    edge_node,
    edge_radius,
    edge_rod,
    edge_arc,
    rod_meets,
    rod_joined,
    rod_exclusion,
):
    """Whether a point at `arc` [m] on edge a may touch the segment k: the rods meet, it is far enough along its own
    rod, and where bodies join the rods the two do not touch by construction.
    """
    first, second = edge_rod[a], edge_rod[k]
    if not rod_meets[first, second]:
        return False
    if first == second and max(edge_arc[k, 0] - arc, arc - edge_arc[k, 1]) < rod_exclusion[first]:
        return False
    if rod_joined[first, second]:
        distance = _nearest(start_position, edge_node[a], s, edge_node[k])
        return distance - edge_radius[a] - edge_radius[k] > touch
    return True


@allocating
def near_pairs(
    position,
    start_position,
    touch,
    reach,
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
):
    """List points and segments with a gap below `reach`, ordered by point, then by segment; return how many there are.

    If there are more than the outputs have room for, the rest is counted but not written.

    Parameters
    ----------
    position, start_position : Array
        Of nodes, now and at the start of the run [m], shape (n_node, 3).
    touch, reach : float
        Gap below which joined rods touch by construction, gap up to which pairs are listed [m].
    edge_node, edge_radius, edge_rod, edge_first, edge_arc, first_point, point_fraction, point_arc
        See `model.rod_surfaces`; the points of edge k are first_point[k] … first_point[k + 1] − 1.
    rod_meets, rod_joined, rod_exclusion
        See `model.rod_surfaces`.
    point_out, edge_out : Array
        Written, int64.
    before_out, after_out : Array
        Written: whether the point also sees the segments before and after on the same strand, bool.
    """
    edges = edge_node.shape[0]
    middle = np.empty((edges, 3))
    half = np.empty(edges)
    longest, thickest = 0.0, 0.0
    for k in range(edges):
        j = edge_node[k]
        size = 0.0
        for c in range(3):
            middle[k, c] = 0.5 * (position[j, c] + position[j + 1, c])
            size += (position[j + 1, c] - position[j, c]) ** 2
        half[k] = 0.5 * math.sqrt(size)
        longest = max(longest, half[k])
        thickest = max(thickest, edge_radius[k])
    width = 2.0 * (longest + thickest) + reach
    mask = 1
    while mask < 2 * edges:
        mask *= 2
    mask -= 1
    head = np.full(mask + 1, -1, np.int64)
    following = np.empty(edges, np.int64)
    cell = np.empty((edges, 3), np.int64)
    for k in range(edges):
        for c in range(3):
            cell[k, c] = math.floor(middle[k, c] / width)
        place = _bucket(cell[k, 0], cell[k, 1], cell[k, 2], mask)
        following[k] = head[place]
        head[place] = k
    near = np.empty(edges, np.int64)
    found = 0
    room = point_out.shape[0]
    for a in range(edges):
        count = 0
        for index in range(27):
            cx, cy, cz = cell[a, 0] + index % 3 - 1, cell[a, 1] + index // 3 % 3 - 1, cell[a, 2] + index // 9 - 1
            k = head[_bucket(cx, cy, cz, mask)]
            while k >= 0:
                same = cell[k, 0] == cx and cell[k, 1] == cy and cell[k, 2] == cz
                if same and rod_meets[edge_rod[a], edge_rod[k]]:
                    reached = half[a] + half[k] + edge_radius[a] + edge_radius[k] + reach
                    distance2 = 0.0
                    for c in range(3):
                        distance2 += (middle[a, c] - middle[k, c]) ** 2
                    along = max(edge_arc[k, 1] - edge_arc[a, 0], edge_arc[a, 1] - edge_arc[k, 0])
                    apart = edge_rod[a] != edge_rod[k] or along >= rod_exclusion[edge_rod[a]]
                    if apart and distance2 < reached * reached:
                        place = count
                        while place > 0 and near[place - 1] > k:
                            near[place] = near[place - 1]
                            place -= 1
                        near[place] = k
                        count += 1
                k = following[k]
        if count == 0:
            continue
        for p in range(first_point[a], first_point[a + 1]):
            for n in range(count):
                k = near[n]
                distance = _nearest(position, edge_node[a], point_fraction[p], edge_node[k])
                if distance - edge_radius[a] - edge_radius[k] >= reach:
                    continue
                who = (a, point_arc[p], point_fraction[p])
                rods = (
                    start_position,
                    touch,
                    edge_node,
                    edge_radius,
                    edge_rod,
                    edge_arc,
                    rod_meets,
                    rod_joined,
                    rod_exclusion,
                )
                if not _sees(*who, k, *rods):
                    continue
                if found < room:
                    point_out[found] = p
                    edge_out[found] = k
                    before_out[found] = not edge_first[k] and _sees(*who, k - 1, *rods)
                    after_out[found] = k + 1 < edges and not edge_first[k + 1] and _sees(*who, k + 1, *rods)
                found += 1
    return found
