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
def _gap(position, i, s, j, radii):
    """Gap [m] between the point at s on edge (i, i+1) and the segment (j, j+1), given the sum of their radii."""
    p0 = (1.0 - s) * position[i, 0] + s * position[i + 1, 0]
    p1 = (1.0 - s) * position[i, 1] + s * position[i + 1, 1]
    p2 = (1.0 - s) * position[i, 2] + s * position[i + 1, 2]
    t = min(max(fraction_along(p0, p1, p2, position, j), 0.0), 1.0)
    return distance_at(p0, p1, p2, position, j, t) - radii


@kernel
def _sees(arc, exclusion, joined, i, s, j, start_position, edge_arc, k, radii, touch):
    """Whether a point at `arc` [m] may touch the segment k of a rod that its own meets: it is far enough along that rod
    (`exclusion`, −inf for another rod), and where bodies join the two they do not touch by construction.
    """
    if max(edge_arc[k, 0] - arc, arc - edge_arc[k, 1]) < exclusion:
        return False
    return not joined or _gap(start_position, i, s, j, radii) > touch


@allocating
def near_pairs(
    position,
    tip,
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
    """List points and segments that may come to a gap below `reach` in a straight motion of nodes, ordered by point,
    then by segment; return how many there are.

    If there are more than the outputs have room for, the rest is counted but not written.

    Parameters
    ----------
    position, tip, start_position : Array
        Of nodes: where the motion begins and ends, and at the start of the run [m], shape (n_node, 3).
    touch, reach : float
        Gap below which joined rods touch by construction, and gap below which pairs are listed [m].
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
    middle, motion = np.empty((edges, 3)), np.empty((edges, 3))
    half = np.empty(edges)  # of the length and, where the ends move differently, of the difference
    longest, thickest = 0.0, 0.0
    m0, m1, m2 = 0.0, 0.0, 0.0
    for k in range(edges):
        j = edge_node[k]
        size, turn = 0.0, 0.0
        for c in range(3):
            first, last = tip[j, c] - position[j, c], tip[j + 1, c] - position[j + 1, c]
            middle[k, c] = 0.5 * (position[j, c] + position[j + 1, c])
            motion[k, c] = 0.5 * (first + last)
            size += (position[j + 1, c] - position[j, c]) ** 2
            turn += (last - first) ** 2
        half[k] = 0.5 * (math.sqrt(size) + math.sqrt(turn))
        longest = max(longest, half[k])
        thickest = max(thickest, edge_radius[k])
        m0, m1, m2 = m0 + motion[k, 0] / edges, m1 + motion[k, 1] / edges, m2 + motion[k, 2] / edges
    fastest = 0.0
    for k in range(edges):
        fastest = max(fastest, (motion[k, 0] - m0) ** 2 + (motion[k, 1] - m1) ** 2 + (motion[k, 2] - m2) ** 2)
    width = 2.0 * (longest + thickest + math.sqrt(fastest)) + reach
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
        if first_point[a] == first_point[a + 1]:
            continue
        count = 0
        own, i = edge_rod[a], edge_node[a]
        for cx in range(cell[a, 0] - 1, cell[a, 0] + 2):
            for cy in range(cell[a, 1] - 1, cell[a, 1] + 2):
                for cz in range(cell[a, 2] - 1, cell[a, 2] + 2):
                    k = head[_bucket(cx, cy, cz, mask)]
                    while k >= 0:
                        other = edge_rod[k]
                        same = cell[k, 0] == cx and cell[k, 1] == cy and cell[k, 2] == cz
                        along = max(edge_arc[k, 1] - edge_arc[a, 0], edge_arc[a, 1] - edge_arc[k, 0])
                        apart = own != other or along >= rod_exclusion[own]
                        if same and apart and rod_meets[own, other]:
                            away, moved = 0.0, 0.0
                            for c in range(3):
                                away += (middle[a, c] - middle[k, c]) ** 2
                                moved += (motion[a, c] - motion[k, c]) ** 2
                            reached = half[a] + half[k] + edge_radius[a] + edge_radius[k] + reach + math.sqrt(moved)
                            if away < reached * reached:
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
            arc, s = point_arc[p], point_fraction[p]
            for n in range(count):
                k = near[n]
                j, other = edge_node[k], edge_rod[k]
                radii = edge_radius[a] + edge_radius[k]
                left, right = 0.0, 0.0
                for c in range(3):
                    way = (1.0 - s) * (tip[i, c] - position[i, c]) + s * (tip[i + 1, c] - position[i + 1, c])
                    left += (way - tip[j, c] + position[j, c]) ** 2
                    right += (way - tip[j + 1, c] + position[j + 1, c]) ** 2
                if _gap(position, i, s, j, radii) - math.sqrt(max(left, right)) >= reach:
                    continue
                exclusion, joined = rod_exclusion[own] if own == other else -math.inf, rod_joined[own, other]
                if not _sees(arc, exclusion, joined, i, s, j, start_position, edge_arc, k, radii, touch):
                    continue
                if found < room:
                    point_out[found] = p
                    edge_out[found] = k
                    before_out[found] = not edge_first[k] and _sees(
                        arc, exclusion, joined, i, s, j - 1, start_position, edge_arc, k - 1, radii, touch
                    )
                    after_out[found] = (
                        k + 1 < edges
                        and not edge_first[k + 1]
                        and _sees(arc, exclusion, joined, i, s, j + 1, start_position, edge_arc, k + 1, radii, touch)
                    )
                found += 1
    return found
