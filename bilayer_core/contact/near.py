"""The pairs of a carrier and a surface that are near each other, and how far anything has moved since they were listed.

A list made with a margin m holds every pair that can come nearer than the barrier distance, and the nearest of all,
until carriers and surfaces together have moved by more than m (a Verlet list; Verlet 1967). The motion of a surface is
that of its fastest point: |δX| + |δφ| times its extent, the radius of a ball about its position that holds it; a gap
can shrink by no more than that. A plane's extent is the largest distance of a carrier.
"""

from __future__ import annotations

import math

from ..jit import kernel
from .shapes import PLANE, shape_distance


@kernel
def gap_normal(kind, size, rounding, radius, place, turn, s, x0, x1, x2):
    """Gap [m] between a carrier at x and surface s, its outward normal in the world, and x in the surface's frame
    (above a plane, its height alone).

    Parameters
    ----------
    kind, size, rounding : Array
        Of surfaces: see `contact.shapes`; shapes (n_surface,), (n_surface, 3), (n_surface,).
    radius : float
        Of the carrier [m].
    place, turn : Array
        Positions [m] and rotations of surfaces, shapes (n_surface, 3), (n_surface, 3, 3).
    s : int
    x0, x1, x2 : float
        The carrier's position [m].

    Returns
    -------
    gap, n0, n1, n2, p0, p1, p2 : float
    """
    z0, z1, z2 = x0 - place[s, 0], x1 - place[s, 1], x2 - place[s, 2]
    p2 = turn[s, 0, 2] * z0 + turn[s, 1, 2] * z1 + turn[s, 2, 2] * z2
    if kind[s] == PLANE:
        return p2 - rounding[s] - radius, turn[s, 0, 2], turn[s, 1, 2], turn[s, 2, 2], 0.0, 0.0, p2
    p0 = turn[s, 0, 0] * z0 + turn[s, 1, 0] * z1 + turn[s, 2, 0] * z2
    p1 = turn[s, 0, 1] * z0 + turn[s, 1, 1] * z1 + turn[s, 2, 1] * z2
    d, g0, g1, g2 = shape_distance(kind[s], size[s, 0], size[s, 1], size[s, 2], p0, p1, p2)
    n0 = turn[s, 0, 0] * g0 + turn[s, 0, 1] * g1 + turn[s, 0, 2] * g2
    n1 = turn[s, 1, 0] * g0 + turn[s, 1, 1] * g1 + turn[s, 1, 2] * g2
    n2 = turn[s, 2, 0] * g0 + turn[s, 2, 1] * g1 + turn[s, 2, 2] * g2
    return d - rounding[s] - radius, n0, n1, n2, p0, p1, p2


@kernel
def list_near(
    reach,
    margin,
    kind,
    size,
    rounding,
    bound,
    place,
    turn,
    radius,
    group,
    meets,
    carrier,
    near_carrier_out,
    near_surface_out,
    extent_out,
):
    """List pairs whose gap is at most max(d̂ + m, smallest gap + 2 m), by surfaces and then by carriers.

    Parameters
    ----------
    reach : float
        d̂ [m].
    margin : float
        m [m].
    kind, size, rounding, place, turn
        As for `gap_normal`.
    bound : Array
        Radius of a ball about each surface's position that holds it [m], infinite for a plane, shape (n_surface,).
    radius, group, carrier : Array
        Of carriers: radius [m], group, and position [m], shapes (n_carrier,), (n_carrier,), (n_carrier, 3).
    meets : Array
        Whether carriers of a group can meet a surface, shape (n_surface, n_group), bool.
    near_carrier_out, near_surface_out : Array
        The pairs; those beyond their length are counted but not written.
    extent_out : Array
        Of surfaces [m], shape (n_surface,).

    Returns
    -------
    count : int
    """
    count = 0
    smallest = math.inf
    for s in range(kind.shape[0]):
        extent_out[s] = bound[s] if kind[s] != PLANE else margin
        for i in range(radius.shape[0]):
            if not meets[s, group[i]]:
                continue
            x0, x1, x2 = carrier[i, 0], carrier[i, 1], carrier[i, 2]
            z0, z1, z2 = x0 - place[s, 0], x1 - place[s, 1], x2 - place[s, 2]
            away = z0 * z0 + z1 * z1 + z2 * z2
            limit = max(reach + margin, smallest + 2.0 * margin)
            if kind[s] == PLANE:
                extent_out[s] = max(extent_out[s], math.sqrt(away) + margin)
            elif away > (bound[s] + radius[i] + limit) ** 2:
                continue
            gap = gap_normal(kind, size, rounding, radius[i], place, turn, s, x0, x1, x2)[0]
            smallest = min(smallest, gap)
            if gap <= limit:
                if count < near_carrier_out.shape[0]:
                    near_carrier_out[count] = i
                    near_surface_out[count] = s
                count += 1
    return count


@kernel
def moved_since(carrier, listed_carrier, place, listed_place, turn, listed_turn, extent):
    """Largest motion of a carrier plus that of a surface's point since a list was made [m]."""
    largest = 0.0
    for i in range(carrier.shape[0]):
        square = 0.0
        for c in range(3):
            square += (carrier[i, c] - listed_carrier[i, c]) ** 2
        largest = max(largest, square)
    slowest = 0.0
    for s in range(place.shape[0]):
        shift, twist = 0.0, 0.0
        for c in range(3):
            shift += (place[s, c] - listed_place[s, c]) ** 2
            for k in range(3):
                twist += (turn[s, c, k] - listed_turn[s, c, k]) ** 2
        # |R − R₀| (Frobenius) is √2 times the chord of the turn
        slowest = max(slowest, math.sqrt(shift) + math.sqrt(0.5 * twist) * extent[s])
    return math.sqrt(largest) + slowest


@kernel
def largest_motion(node_step, node_free, body_motion, body_reach, surface_body, extent):
    """Largest motion of a carrier plus that of a surface's point in a step [m].

    Parameters
    ----------
    node_step, node_free : Array
        Displacement of nodes [m], shape (n_node, 3), and which of them no body carries, bool.
    body_motion : Array
        Displacement [m] and rotation vector [rad] of bodies and of the world, shape (n_body + 1, 6).
    body_reach : Array
        Largest distance of a carrier of each body from its position [m], shape (n_body + 1,).
    surface_body, extent : Array
        Body of each surface, and its extent [m], shape (n_surface,).
    """
    largest = 0.0
    for i in range(node_free.shape[0]):
        if node_free[i]:
            largest = max(largest, node_step[i, 0] ** 2 + node_step[i, 1] ** 2 + node_step[i, 2] ** 2)
    largest = math.sqrt(largest)
    for b in range(body_reach.shape[0]):
        largest = max(largest, _motion(body_motion, b, body_reach[b]))
    fastest = 0.0
    for s in range(surface_body.shape[0]):
        fastest = max(fastest, _motion(body_motion, surface_body[s], extent[s]))
    return largest + fastest


@kernel
def _motion(body_motion, b, reach):
    """|δX| + |δφ| reach"""
    shift = body_motion[b, 0] ** 2 + body_motion[b, 1] ** 2 + body_motion[b, 2] ** 2
    twist = body_motion[b, 3] ** 2 + body_motion[b, 4] ** 2 + body_motion[b, 5] ** 2
    return math.sqrt(shift) + math.sqrt(twist) * reach
