"""Which points of rods are near which segments.

Edges are the leaves of a binary tree in the order of their numbers: neighbours along a rod are neighbours in the tree.
Every node of it has the box that holds its edges over their whole motion, so a search for what reaches an edge costs
the logarithm of the number of edges, and what it finds.

Neighbours on the same strand are always near each other, but do not meet where the strand goes straight enough: if
every edge e between them keeps e·d ≥ c times its arc length for some unit vector d, then two places L apart on the path
are c L apart at least (Volino & Magnenat-Thalmann 1994). So the search leaves out the *run* of such edges about those
for which it is made, with c L their distance for the smallest L at which a rod sees itself. As e·d is linear in a
straight motion, it is enough to look at both ends of that. Of ribbons this holds for the rails of either border; two
places on different ones are nearer to each other by no more than what lies across, along d.
"""

from __future__ import annotations

import math

from bilayer_core.contact.facet import INSIDE, SLACK, square_between
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Flags, FlagTable, IndexTable, Indices, Matrix, Vector


@record
class RodSearch:
    """A search for points and segments that come near each other, and what it finds; see `model.rod_surfaces`.

    The size ``"tree"`` is that of the tree, ``"near pair"`` the capacity for pairs.
    """

    start_position: Matrix  # of rails at the start of the run [m], shape (n_rail, 3)
    base: Matrix = ("rail", 3)  # where a straight motion of rails begins [m]
    tip: Matrix = ("rail", 3)  # and ends
    edge_node: Indices  # first node of each edge, shape (n_edge,)
    edge_right: Indices  # rail of the right border there, −1 of round rods, shape (n_edge,)
    edge_radius: Vector  # largest radius of its strand's nodes [m], shape (n_edge,)
    edge_rod: Indices  # expanded rod of each edge, shape (n_edge,)
    edge_first: Flags  # whether the edge is the first of its strand in memory, shape (n_edge,)
    edge_before: Indices  # the edge on the same strand that ends where it begins, −1 without one, shape (n_edge,)
    edge_after: Indices  # the edge that begins where it ends, likewise
    edge_arc: Matrix  # from and to along the path of its rod [m], shape (n_edge, 2)
    first_point: Indices  # points of edge k are first_point[k] … first_point[k + 1] − 1, shape (n_edge + 1,)
    point_edge: Indices  # shape (n_point,)
    point_fraction: Vector  # position on its edge, 0 … 1, shape (n_point,)
    point_across: Vector  # and across it, from the left border to the right, likewise
    point_arc: Vector  # along the path of its rod [m], shape (n_point,)
    point_sees: Indices  # what it sees of ribbons, see `contact.facet`, shape (n_point,)
    rod_can_collide: FlagTable  # whether two rods, or one and itself, can meet, shape (n_rod, n_rod)
    rod_joined: FlagTable  # whether one body holds both, or both ends of one, shape (n_rod, n_rod)
    rod_exclusion: Vector  # arc distance from which on a rod sees itself [m], shape (n_rod,)
    rod_length: Vector  # once round a closed rod along its path, infinite for others [m], shape (n_rod,)
    box: Matrix = ("tree", 6)  # scratch: boxes, where children of b are 2 b and 2 b + 1 and leaves come last
    sweep: Matrix = ("edge", 7)  # middle of edges, its motion, half of the length, the difference of motions of ends
    met: IndexTable = (2, "edge")  # scratch: edges
    count: Indices = (1,)  # of pairs, more than are written if there is no capacity for them
    point: Indices = ("near pair",)  # the pairs
    edge: Indices = ("near pair",)
    before: Flags = ("near pair",)  # whether the point also sees the segment before, and
    after: Flags = ("near pair",)  # that after, on the same strand
    until: Vector = (
        "near pair",
    )  # path before which each stays beyond the barrier distance [m], see `contact.rod_list`


@kernel
def _sees(search, a, p, k, touch):
    """Return whether a point p of edge a may touch segment k of a rod that its own rod can meet.

    On its own rod, the segment must be far enough along it. If bodies join the two rods, the point and the segment must
    not touch by construction: their gap at the start of the run must be above `touch` [m].
    """
    own, other, arc = search.edge_rod[a], search.edge_rod[k], search.point_arc[p]
    if own == other and _arc_between(search, own, arc, arc, k) < search.rod_exclusion[own]:
        return False
    if not search.rod_joined[own, other]:
        return True
    radii = search.edge_radius[a] + search.edge_radius[k]
    slack = SLACK if search.edge_right[a] >= 0 or search.edge_right[k] >= 0 else 1.0
    return square_between(search, search.start_position, p, k) > (radii + touch) ** 2 * slack


@kernel
def _arc_between(search, rod, first, last, k):
    """Return a lower bound of the arc distance of any place from `first` to `last` along a rod from its edge k [m];
    round a closed rod the shorter way.
    """
    begin, end, once_round = search.edge_arc[k, 0], search.edge_arc[k, 1], search.rod_length[rod]
    return min(max(begin - first, last - end), once_round - max(end - last, first - begin))


def tree_size(edges: int) -> int:
    """Return the number of boxes of the tree of so many edges."""
    return 2 << max(edges - 1, 0).bit_length()


GROUP = 4
"""Edges next to each other for which the tree is searched together, a power of two."""


@kernel
def _come_near(box, a, b, distance):
    """Return whether two boxes of the tree are nearer than `distance` [m] along each axis."""
    for c in range(3):
        if box[b, c] >= box[a, 3 + c] + distance or box[b, 3 + c] <= box[a, c] - distance:
            return False
    return True


@kernel
def _along(position, i, d0, d1, d2):
    """Return the component of the edge (i, i+1) along a unit vector [m]."""
    return (
        d0 * (position[i + 1, 0] - position[i, 0])
        + d1 * (position[i + 1, 1] - position[i, 1])
        + d2 * (position[i + 1, 2] - position[i, 2])
    )


@kernel
def _goes_on(search, k, d0, d1, d2, share):
    """Return whether an edge goes `share` of its arc length or more along a unit vector, at both ends of its motion."""
    i, least = search.edge_node[k], share * (search.edge_arc[k, 1] - search.edge_arc[k, 0])
    if _along(search.base, i, d0, d1, d2) < least or _along(search.tip, i, d0, d1, d2) < least:
        return False
    r = search.edge_right[k]
    return r < 0 or (_along(search.base, r, d0, d1, d2) >= least and _along(search.tip, r, d0, d1, d2) >= least)


@kernel
def _across(search, k, d0, d1, d2):
    """Return the largest part along a unit vector of what lies across an edge of a ribbon, in its motion [m]."""
    i, r, largest = search.edge_node[k], search.edge_right[k], 0.0
    for end in range(2):
        for part in range(2):
            x = search.base if part == 0 else search.tip
            along = d0 * (x[r + end, 0] - x[i + end, 0]) + d1 * (x[r + end, 1] - x[i + end, 1])
            largest = max(largest, abs(along + d2 * (x[r + end, 2] - x[i + end, 2])))
    return largest


RUN = 2.0
"""Half of the longest run that is looked for, in units of the arc distance from which a rod sees itself."""


@kernel
def _run_about(search, first, last, near):
    """Return a run [begin, end) of edges of one strand about those from `first` to `last`.

    No two of these edges come nearer to each other than `near` [m] if they are so far apart along the path that a rod
    has to check for contact with itself. The run is empty if there is no such one.
    """
    position, tip, edge_first, edge_arc = search.base, search.tip, search.edge_first, search.edge_arc
    exclusion, own_near = search.rod_exclusion[search.edge_rod[first]], near
    i, j = search.edge_node[first], search.edge_node[last] + 1
    d0 = position[j, 0] - position[i, 0] + tip[j, 0] - tip[i, 0]
    d1 = position[j, 1] - position[i, 1] + tip[j, 1] - tip[i, 1]
    d2 = position[j, 2] - position[i, 2] + tip[j, 2] - tip[i, 2]
    scale = 1.0 / math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    d0, d1, d2 = d0 * scale, d1 * scale, d2 * scale
    for k in range(first, last + 1):
        if search.edge_right[k] >= 0:
            near = max(near, own_near + _across(search, k, d0, d1, d2))
    share = near / exclusion
    for k in range(first, last + 1):
        if (k > first and edge_first[k]) or not _goes_on(search, k, d0, d1, d2, share):
            return 0, 0
    begin, end = first, last + 1
    limit = edge_arc[first, 0] - RUN * exclusion
    while not edge_first[begin] and edge_arc[begin, 0] > limit and _goes_on(search, begin - 1, d0, d1, d2, share):
        begin -= 1
    limit = edge_arc[last, 1] + RUN * exclusion
    while end < edge_first.shape[0] and not edge_first[end] and edge_arc[end, 0] < limit:
        if not _goes_on(search, end, d0, d1, d2, share):
            break
        end += 1
    return begin, end


@kernel
def _near_leaves(box, leaves, own, distance, begin, end, met_out):
    """List the leaves of the tree whose boxes come nearer than `distance` to that of the node `own`, ascending, but for
    those from `begin` to `end`, in the first row of `met_out`; return how many there are.
    """
    count = 0
    b, below = 1, leaves  # a node, and how many leaves are below it
    while b > 0:
        from_leaf = b * below - leaves
        can_collide = (from_leaf < begin or from_leaf + below > end) and _come_near(box, own, b, distance)
        if can_collide and b < leaves:
            b *= 2
            below >>= 1
            continue
        if can_collide:
            met_out[0, count] = from_leaf
            count += 1
        while b & 1:
            b >>= 1
            below <<= 1
        b += b > 0
    return count


@kernel
def _sweep_ribbon(search, k, b):
    """Write the box of an edge of a ribbon over its motion, and the ball about its middle that holds it."""
    position, tip, box, sweep, radius = search.base, search.tip, search.box, search.sweep, search.edge_radius[k]
    i, r = search.edge_node[k], search.edge_right[k]
    for c in range(3):
        low, high, middle, moved = math.inf, -math.inf, 0.0, 0.0
        for corner in range(4):
            n = (i if corner < 2 else r) + corner % 2
            low, high = min(low, position[n, c], tip[n, c]), max(high, position[n, c], tip[n, c])
            middle += 0.25 * position[n, c]
            moved += 0.25 * (tip[n, c] - position[n, c])
        box[b, c], box[b, 3 + c] = low - radius, high + radius
        sweep[k, c], sweep[k, 3 + c] = middle, moved
    size = turn = 0.0
    for corner in range(4):
        n, away, moved = (i if corner < 2 else r) + corner % 2, 0.0, 0.0
        for c in range(3):
            away += (position[n, c] - sweep[k, c]) ** 2
            moved += (tip[n, c] - position[n, c] - sweep[k, 3 + c]) ** 2
        size, turn = max(size, away), max(turn, moved)
    sweep[k, 6] = math.sqrt(size) + math.sqrt(turn) + radius


@kernel
def _moved_against(search, a, s, v, k):
    """Return the largest motion of the point (s, v) of an edge a against a corner of an edge k [m]."""
    position, tip, i, r = search.base, search.tip, search.edge_node[a], search.edge_right[a]
    j, right, largest = search.edge_node[k], search.edge_right[k], 0.0
    for corner in range(2 if right < 0 else 4):
        n, square = (j if corner < 2 else right) + corner % 2, 0.0
        for c in range(3):
            way = (1.0 - s) * (tip[i, c] - position[i, c]) + s * (tip[i + 1, c] - position[i + 1, c])
            if r >= 0:
                other = (1.0 - s) * (tip[r, c] - position[r, c]) + s * (tip[r + 1, c] - position[r + 1, c])
                way = (1.0 - v) * way + v * other
            square += (way - tip[n, c] + position[n, c]) ** 2
        largest = max(largest, square)
    return math.sqrt(largest)


@piece(int, RodSearch, float, float)
def near_pairs(search, touch, distance):
    """List points and segments that may come to a gap below `distance` in a straight motion of nodes, ordered by point,
    then by segment; return how many there are.

    If there are more than there is capacity for, the rest is counted but not written.

    Parameters
    ----------
    search : RodSearch
        In `until` is left how far each gap at the beginning is above `touch` [m].
    touch, distance : float
        Gap below which joined rods touch by construction, and gap below which pairs are listed [m].
    """
    position, tip, edge_node, edge_radius = search.base, search.tip, search.edge_node, search.edge_radius
    edge_rod, edge_arc, box, sweep, met = search.edge_rod, search.edge_arc, search.box, search.sweep, search.met
    first_point, edge_before, edge_after = search.first_point, search.edge_before, search.edge_after
    edges = edge_node.shape[0]
    leaves = box.shape[0] // 2
    for k in range(leaves):
        b = leaves + k
        if k >= edges:
            for c in range(3):
                box[b, c], box[b, 3 + c] = math.inf, -math.inf
            continue
        j, radius = edge_node[k], edge_radius[k]
        size, turn = 0.0, 0.0
        for c in range(3):
            p, q, u, v = position[j, c], position[j + 1, c], tip[j, c], tip[j + 1, c]
            box[b, c] = min(min(p, q), min(u, v)) - radius
            box[b, 3 + c] = max(max(p, q), max(u, v)) + radius
            sweep[k, c] = 0.5 * (p + q)
            sweep[k, 3 + c] = 0.5 * (u - p + v - q)
            size += (q - p) ** 2
            turn += (v - q - u + p) ** 2
        sweep[k, 6] = 0.5 * (math.sqrt(size) + math.sqrt(turn)) + radius
        if search.edge_right[k] >= 0:
            _sweep_ribbon(search, k, leaves + k)
    for b in range(leaves - 1, 0, -1):
        for c in range(3):
            box[b, c] = min(box[2 * b, c], box[2 * b + 1, c])
            box[b, 3 + c] = max(box[2 * b, 3 + c], box[2 * b + 1, 3 + c])
    found = 0
    capacity = search.point.shape[0]
    group = min(GROUP, leaves)
    meetings = 0
    for a in range(edges):
        if a % group == 0:
            last, near_by = min(a + group, edges) - 1, 2.0 * edge_radius[a] + distance
            begin, end = _run_about(search, a, last, near_by)
            meetings = _near_leaves(box, leaves, (leaves + a) // group, distance, begin, end, met)
        if first_point[a] == first_point[a + 1]:
            continue
        count = 0
        own, i = edge_rod[a], edge_node[a]
        for m in range(meetings):
            k = met[0, m]
            if not search.rod_can_collide[own, edge_rod[k]]:
                continue
            if own == edge_rod[k]:
                if _arc_between(search, own, edge_arc[a, 0], edge_arc[a, 1], k) < search.rod_exclusion[own]:
                    continue
            away, moved = 0.0, 0.0
            for c in range(3):
                away += (sweep[a, c] - sweep[k, c]) ** 2
                moved += (sweep[a, 3 + c] - sweep[k, 3 + c]) ** 2
            near_enough = sweep[a, 6] + sweep[k, 6] + distance
            if away >= near_enough * near_enough and away >= (near_enough + math.sqrt(moved)) ** 2:
                continue
            if _come_near(box, leaves + a, leaves + k, distance):
                met[1, count] = k
                count += 1
        if count == 0:
            continue
        for p in range(first_point[a], first_point[a + 1]):
            s, r = search.point_fraction[p], search.edge_right[a]
            v = search.point_across[p] if r >= 0 else 0.0
            for n in range(count):
                k = met[1, n]
                if search.point_sees[p] == INSIDE and search.edge_right[k] < 0:
                    continue  # which is a border all through
                j = edge_node[k]
                radii = edge_radius[a] + edge_radius[k]
                left, right = 0.0, 0.0
                for c in range(3):
                    way = (1.0 - s) * (tip[i, c] - position[i, c]) + s * (tip[i + 1, c] - position[i + 1, c])
                    left += (way - tip[j, c] + position[j, c]) ** 2
                    right += (way - tip[j + 1, c] + position[j + 1, c]) ** 2
                moved = math.sqrt(max(left, right))
                if r >= 0 or search.edge_right[k] >= 0:
                    moved = _moved_against(search, a, s, v, k)
                square = square_between(search, position, p, k)
                if square >= (radii + distance + moved) ** 2:
                    continue
                away = math.sqrt(square)  # and no less than half of what is left of this and of that at the end
                if away + math.sqrt(square_between(search, tip, p, k)) >= 2.0 * (radii + distance) + moved:
                    continue
                if not _sees(search, a, p, k, touch):
                    continue
                if found < capacity:
                    search.point[found], search.edge[found] = p, k
                    search.until[found] = away - radii - touch
                    before = edge_before[k] >= 0 and _sees(search, a, p, edge_before[k], touch)
                    after = edge_after[k] >= 0 and _sees(search, a, p, edge_after[k], touch)
                    search.before[found], search.after[found] = before, after
                found += 1
    search.count[0] = found
    return found
