"""Points on rods against the segments of other rods: nearest points, each counted once.

A point p = (1 − s) x_i + s x_{i+1} on edge (i, i+1) faces a chain of segments. For the segment (j, j+1), with e =
x_{j+1} − x_j,

    τ = (p − x_j)·e/|e|²,   t = min(max(τ, 0), 1),   D = |p − (1 − t) x_j − t x_{j+1}|,   gap d = D − r_p − r_segment

and d is once continuously differentiable. A sum of b(d) over the segments would count a point beside a node twice, so
that of the nodes between two segments is taken off again:

    B(p) = Σ_segments b(d) − Σ_inner nodes b(d_node)

On a straight chain every segment but the nearest has the distance of its node next to p: all cancels but b of the
nearest distance. Everywhere B ≥ b(nearest distance), because each inner node is no nearer than the segment on its far
side; so B is a barrier, smooth where the nearest point passes over a node, and independent of the mesh. What is left
after cancelling is listed as *contacts* with a *count* of +1 or −1: the segments with 0 < τ < 1, and each node with the
number of its segments that are nearest there (τ ≤ 0 or τ ≥ 1), less one for an inner node. A node where the
chain ends, or where the point does not see the segment beyond (`model.rod_surfaces`), is no inner node.

**Ribbons** are chains of facets (`contact.facet`), with the lines across their ends for nodes, and B_facets is smooth
where the nearest place passes on to a border. Where two faces meet, few points are enough, an edge or a quarter of the
width apart; where borders cross, points must be as dense as on round rods. So few points at a border and many take part
in different ways:

    Σ_few Δl (B_facets − B_left − B_right) + Σ_many Δl (B_left + B_right)

Beside a border B_facets is that of the border: the few cancel, and the many are left. Inside, the borders are farther
away than the facet, B_facets is left of the few, and nothing of the many.

So a border on a border presses with K_c/4; one on a face with K_c/8, three times that where it lies along few points
of the face, and its gap closes farther: at a load of 0.1 K_c d̂ to 0.83 d̂ face on face, to 0.68 d̂ border on border. No
weights make this equal: with E = ∫ b(d) dμ over a section, faces that lie on each other demand that μ is 1 in all. Each
of the two borders could have half at most, and then the middle of a ribbon would keep nothing off.
"""

from __future__ import annotations

import math

from bilayer_core.contact.facet import (
    BORDERS,
    INSIDE,
    SLACK,
    across_at_end,
    fraction_between,
    nearest_place,
    place_of_point,
    place_on_facet,
    square_distance,
)
from bilayer_core.jit import kernel
from bilayer_core.jit.called import stack_vector
from bilayer_core.kinematics.vector import combine, dot, row


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
        if search.edge_right[a] >= 0 or search.edge_right[k] >= 0:
            found, gap = _facing_facet(rods, position, path, c, found)
            first, smallest = min(first, until[c]), min(smallest, gap)
            continue
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
            contacts.edge[n, 0], contacts.edge[n, 1] = a, k
            contacts.right[n, 0] = contacts.right[n, 1] = -1
            weight[n, 0], weight[n, 1], weight[n, 2], weight[n, 3] = 1.0 - s, s, t - 1.0, -t
            for m in range(3):
                between = weight[n, 0] * position[i, m] + weight[n, 1] * position[i + 1, m]
                between += weight[n, 2] * position[j, m] + weight[n, 3] * position[j + 1, m]
                normal[n, m] = between / contacts.distance[n]
    return found, smallest, first


@kernel
def _facing_facet(rods, position, path, c, found):
    """Append the contacts of the pair c, of which one edge is a ribbon's, to `found` ones, as `facing_contacts` does;
    return how many there are then, and the smallest gap of those that are new [m].

    The facet and its borders are three *views* of the edge. They count +1, −1 or 0 times each.
    """
    search, d_hat, smallest = rods.search, rods.d_hat, math.inf
    p, k = search.point[c], search.edge[c]
    radii = search.edge_radius[search.point_edge[p]] + search.edge_radius[k]
    x, ribbon = place_of_point(search, position, p), search.edge_right[k] >= 0
    facets, borders = 1.0, 0.0
    if ribbon and search.point_sees[p] == BORDERS:
        facets, borders = 0.0, 1.0
    elif ribbon and search.point_sees[p] == INSIDE:
        borders = -1.0
    along, across, first = stack_vector(3), stack_vector(3), stack_vector(3)
    factor, times = stack_vector(3), stack_vector(3)
    factor[0], factor[1], factor[2] = facets, borders, borders
    nearest = math.inf
    for view in range(3):
        along[view] = across[view] = 0.0
        if factor[view] != 0.0:
            along[view], across[view] = _nearest_in_view(search, position, k, view, x)
            nearest = min(nearest, _gap_at(search, position, k, along[view], across[view], x, radii))
    search.until[c] = path + nearest - d_hat
    if nearest >= d_hat:
        return found, smallest
    for view in range(3):
        first[view] = 1.0 if along[view] <= 0.0 else 0.0
        if search.before[c] and factor[view] != 0.0:
            other, _ = _nearest_in_view(search, position, search.edge_before[k], view, x)
            first[view] -= 0.0 if other >= 1.0 else 1.0
    for kind in range(3):  # the edge's inside, its start, its end where no other has that for its start
        for view in range(3):
            if kind == 0:
                counts = 1.0 if 0.0 < along[view] < 1.0 else 0.0
            elif kind == 1:
                counts = first[view]
            else:
                counts = 1.0 if along[view] >= 1.0 and not search.after[c] else 0.0
            times[view] = factor[view] * counts
        t, v = 0.0 if kind == 1 else 1.0 if kind == 2 else along[0], across[0]
        if kind > 0 and times[0] != 0.0:
            v = across_at_end(search, position, k, t, x)
        for view in range(3):
            if view > 0:
                t, v = along[view] if kind == 0 else t, float(view - 1)
            elif times[0] != 0.0 and borders != 0.0 and (v == 0.0 or v == 1.0):
                same = 1 if v == 0.0 else 2  # a border: all that cancels
                if kind > 0 or t == along[same]:
                    times[same] += times[0]
                    continue
            if times[view] == 0.0:
                continue
            gap = _gap_at(search, position, k, t, v, x, radii)
            if not gap < d_hat:
                continue
            smallest = min(smallest, gap)
            found += 1
            if found <= rods.contacts.point.shape[0]:
                multiplicity = int(times[view])
                _write_contact(rods, position, found - 1, p, k, multiplicity, kind == 0, t, v, gap, gap + radii)
    return found, smallest


@kernel
def _nearest_in_view(search, position, k, view, x):
    """Return (t, v) of the place nearest to a point on an edge: its facet (view 0), its left or its right border."""
    if view == 0:
        return nearest_place(search, position, k, x)
    r = search.edge_node[k] if view == 1 else search.edge_right[k]
    return fraction_between(row(position, r), row(position, r + 1), x), float(view - 1)


@kernel
def _gap_at(search, position, k, t, v, x, radii):
    """Return the gap of a point at x from a place of an edge [m]."""
    away = combine(1.0, x, -1.0, place_on_facet(search, position, k, t, v))
    return math.sqrt(dot(away, away)) - radii


@kernel
def _write_contact(rods, position, n, p, k, multiplicity, inner, t, v, gap, distance):
    """Write a contact of ribbons as the n-th."""
    search, contacts = rods.search, rods.contacts
    a, s = search.point_edge[p], search.point_fraction[p]
    contacts.point[n], contacts.multiplicity[n], contacts.inner[n] = p, multiplicity, inner
    contacts.gap[n], contacts.distance[n], contacts.place[n, 0], contacts.place[n, 1] = gap, distance, t, v
    weight = contacts.weight
    for side in range(2):
        edge = a if side == 0 else k
        sign, along, across = (1.0, s, search.point_across[p]) if side == 0 else (-1.0, t, v)
        right = search.edge_right[edge]
        if right < 0:
            across = 0.0
        contacts.node[n, side], contacts.right[n, side] = search.edge_node[edge], right
        contacts.edge[n, side] = edge
        weight[n, 2 * side] = sign * (1.0 - along) * (1.0 - across)
        weight[n, 2 * side + 1] = sign * along * (1.0 - across)
        weight[n, 4 + 2 * side] = sign * (1.0 - along) * across
        weight[n, 5 + 2 * side] = sign * along * across
    x, y = place_of_point(search, position, p), place_on_facet(search, position, k, t, v)
    for m in range(3):
        contacts.normal[n, m] = (x[m] - y[m]) / distance
