"""Points on ribbons and the facets of ribbons: places, and nearest places.

A *facet* is the bilinear patch between two rails of one border, L₀ and L₁, and those of the other, R₀ and R₁:

    Q(t, v) = (1 − v) ((1 − t) L₀ + t L₁) + v ((1 − t) R₀ + t R₁),   0 ≤ t, v ≤ 1

The nearest place to a point is found by going along t and v in turn: along either of them Q is straight, and the
nearest place a projection. The error falls by the square of the cosine between the two directions each time, to the
last digit in a few rounds on what is nearly a rectangle. Where there is one rail, the facet is the segment L₀ L₁, and v
is 0. The *borders* of a facet are the segments L₀ L₁ and R₀ R₁, v = 0 and 1.

Points see either of them (`model.rod_surfaces`): facets, whole or less their borders, or borders alone.
"""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import combine, dot, row

WHOLE, INSIDE, BORDERS = 0, 1, 2
"""What a point sees of ribbons: facets; facets less what it would see of their borders; borders alone."""
MOST_ROUNDS = 100
ENOUGH = 1e-15
"""Of t and v: smaller changes end the search."""

SLACK = 1.0 + 1e-9
"""Of squares that are compared before a root is taken: larger than any rounding."""


@kernel
def mix(s, a, b):
    """Return (1 − s) a + s b."""
    return combine(1.0 - s, a, s, b)


@kernel
def fraction_between(a, b, p):
    """Return the fraction, 0 … 1, at which the segment from a to b is nearest to p; 0 where it has no length."""
    e = combine(1.0, b, -1.0, a)
    square = dot(e, e)
    return min(max(dot(combine(1.0, p, -1.0, a), e) / square, 0.0), 1.0) if square > 0.0 else 0.0


@kernel
def nearest_on_facet(l0, l1, r0, r1, p):
    """Return (t, v) of the place of a facet that is nearest to p."""
    t, v = 0.5, 0.5
    for _ in range(MOST_ROUNDS):
        before, beside = t, v
        t = fraction_between(mix(v, l0, r0), mix(v, l1, r1), p)
        v = fraction_between(mix(t, l0, l1), mix(t, r0, r1), p)
        if abs(t - before) + abs(v - beside) <= ENOUGH:
            break
    return t, v


@kernel
def place_of_point(search, position, p):
    """Return where a point of a rod is, as a tuple."""
    a, s = search.point_edge[p], search.point_fraction[p]
    i, r = search.edge_node[a], search.edge_right[a]
    left = mix(s, row(position, i), row(position, i + 1))
    if r < 0:
        return left
    return mix(search.point_across[p], left, mix(s, row(position, r), row(position, r + 1)))


@kernel
def place_on_facet(search, position, k, t, v):
    """Return Q(t, v) of an edge, as a tuple."""
    j, r = search.edge_node[k], search.edge_right[k]
    left = mix(t, row(position, j), row(position, j + 1))
    if r < 0:
        return left
    return mix(v, left, mix(t, row(position, r), row(position, r + 1)))


@kernel
def nearest_place(search, position, k, p):
    """Return (t, v) of the place of an edge that is nearest to p."""
    j, r = search.edge_node[k], search.edge_right[k]
    if r < 0:
        return fraction_between(row(position, j), row(position, j + 1), p), 0.0
    return nearest_on_facet(row(position, j), row(position, j + 1), row(position, r), row(position, r + 1), p)


@kernel
def across_at_end(search, position, k, t, p):
    """Return v of the place nearest to p on the line across an edge at one of its ends, t = 0 or 1."""
    r = search.edge_right[k]
    if r < 0:
        return 0.0
    end = 0 if t == 0.0 else 1
    return fraction_between(row(position, search.edge_node[k] + end), row(position, r + end), p)


@kernel
def square_distance(p0, p1, p2, position, j):
    """Return the square of the distance of a point from the segment (j, j+1) [m²]: what is far needs no root."""
    d0, d1, d2 = p0 - position[j, 0], p1 - position[j, 1], p2 - position[j, 2]
    e0, e1 = position[j + 1, 0] - position[j, 0], position[j + 1, 1] - position[j, 1]
    e2 = position[j + 1, 2] - position[j, 2]
    t = min(max((d0 * e0 + d1 * e1 + d2 * e2) / (e0 * e0 + e1 * e1 + e2 * e2), 0.0), 1.0)
    d0, d1, d2 = d0 - t * e0, d1 - t * e1, d2 - t * e2
    return d0 * d0 + d1 * d1 + d2 * d2


@kernel
def square_between(search, position, p, k):
    """Return the square of the distance of a point from what it sees of an edge [m²]."""
    j, right, x = search.edge_node[k], search.edge_right[k], place_of_point(search, position, p)
    if right < 0:
        return square_distance(x[0], x[1], x[2], position, j)
    if search.point_sees[p] == BORDERS:
        left = square_distance(x[0], x[1], x[2], position, j)
        return min(left, square_distance(x[0], x[1], x[2], position, right))
    t, v = nearest_place(search, position, k, x)
    away = combine(1.0, x, -1.0, place_on_facet(search, position, k, t, v))
    return dot(away, away)
