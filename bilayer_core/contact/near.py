"""The pairs of a contact point and a surface that are near each other, and how far anything has moved since the list.

A list made with a margin m holds every pair that can come nearer than the barrier distance, and the nearest of all,
until contact points and surfaces together have moved by more than m (a Verlet list; Verlet 1967). The motion of a
surface is that of its fastest point: |δX| + |δφ| times its extent, the radius of a ball about its position that holds
it; a gap can shrink by no more than that. A plane's extent is the largest distance of a contact point.

`surfaces` is a record `Surfaces`, `at` a configuration, `Configuration` (`model.records`).
"""

from __future__ import annotations

import math

from bilayer_core.contact.shapes import PLANE, shape_distance
from bilayer_core.jit import kernel


@kernel
def gap_normal(surfaces, at, i, s, x0, x1, x2):
    """Gap between contact point i and surface s, were the point at x, and the surface's outward normal.

    Parameters
    ----------
    surfaces, at
    i, s : int
    x0, x1, x2 : float
        [m]

    Returns
    -------
    gap : float
        [m]
    n0, n1, n2 : float
        The normal in the world.
    p0, p1, p2 : float
        x in the surface's frame [m]; above a plane, its height alone.
    """
    kind, size, position, axes = surfaces.kind[s], surfaces.size, at.surface_position, at.surface_rotation
    inward = surfaces.rounding[s]
    z0, z1, z2 = x0 - position[s, 0], x1 - position[s, 1], x2 - position[s, 2]
    p2 = axes[s, 0, 2] * z0 + axes[s, 1, 2] * z1 + axes[s, 2, 2] * z2
    if kind == PLANE:
        return p2 - inward - surfaces.radius[i], axes[s, 0, 2], axes[s, 1, 2], axes[s, 2, 2], 0.0, 0.0, p2
    p0 = axes[s, 0, 0] * z0 + axes[s, 1, 0] * z1 + axes[s, 2, 0] * z2
    p1 = axes[s, 0, 1] * z0 + axes[s, 1, 1] * z1 + axes[s, 2, 1] * z2
    d, g0, g1, g2 = shape_distance(kind, size[s, 0], size[s, 1], size[s, 2], p0, p1, p2)
    n0 = axes[s, 0, 0] * g0 + axes[s, 0, 1] * g1 + axes[s, 0, 2] * g2
    n1 = axes[s, 1, 0] * g0 + axes[s, 1, 1] * g1 + axes[s, 1, 2] * g2
    n2 = axes[s, 2, 0] * g0 + axes[s, 2, 1] * g1 + axes[s, 2, 2] * g2
    return d - inward - surfaces.radius[i], n0, n1, n2, p0, p1, p2


@kernel
def list_near(surfaces, at, margin):
    """List pairs whose gap is at most max(d̂ + m, smallest gap + 2 m), by surfaces and then by contact points.

    The list with its gaps, the extents of surfaces and where everything is are written to `surfaces`; pairs beyond the
    capacity of the list are counted but not written.

    Parameters
    ----------
    surfaces, at
    margin : float
        m [m]

    Returns
    -------
    count : int
    """
    bound, radius, group, can_collide = surfaces.bound, surfaces.radius, surfaces.group, surfaces.can_collide
    point, position, extent = at.contact_point, at.surface_position, surfaces.extent
    count, smallest = 0, math.inf
    for s in range(position.shape[0]):
        plane = surfaces.kind[s] == PLANE
        extent[s] = margin if plane else bound[s]
        for i in range(point.shape[0]):
            if not can_collide[s, group[i]]:
                continue
            square = 0.0
            for c in range(3):
                square += (point[i, c] - position[s, c]) ** 2
            limit = max(surfaces.d_hat + margin, smallest + 2.0 * margin)
            if plane:
                extent[s] = max(extent[s], math.sqrt(square) + margin)
            elif square > (bound[s] + radius[i] + limit) ** 2:
                continue
            gap = gap_normal(surfaces, at, i, s, point[i, 0], point[i, 1], point[i, 2])[0]
            smallest = min(smallest, gap)
            if gap <= limit:
                if count < surfaces.near_contact_point.shape[0]:
                    surfaces.near_contact_point[count] = i
                    surfaces.near_surface[count] = s
                    surfaces.near_gap[count] = gap
                count += 1
    for i in range(point.shape[0]):
        for c in range(3):
            surfaces.listed_contact_point[i, c] = point[i, c]
    for s in range(position.shape[0]):
        for c in range(3):
            surfaces.listed_surface_position[s, c] = position[s, c]
            for k in range(3):
                surfaces.listed_surface_rotation[s, c, k] = at.surface_rotation[s, c, k]
    return count


@kernel
def moved_since(surfaces, at):
    """Largest motion of a contact point plus that of a surface's point since the list was made [m]."""
    point, listed_point = at.contact_point, surfaces.listed_contact_point
    position, listed_position = at.surface_position, surfaces.listed_surface_position
    axes, listed_axes = at.surface_rotation, surfaces.listed_surface_rotation
    largest = 0.0
    for i in range(point.shape[0]):
        square = 0.0
        for c in range(3):
            square += (point[i, c] - listed_point[i, c]) ** 2
        largest = max(largest, square)
    fastest = 0.0
    for s in range(position.shape[0]):
        shift, chord = 0.0, 0.0
        for c in range(3):
            shift += (position[s, c] - listed_position[s, c]) ** 2
            for k in range(3):
                chord += (axes[s, c, k] - listed_axes[s, c, k]) ** 2
        # |R − R₀| (Frobenius) is √2 times the chord of the rotation
        fastest = max(fastest, math.sqrt(shift) + math.sqrt(0.5 * chord) * surfaces.extent[s])
    return math.sqrt(largest) + fastest
