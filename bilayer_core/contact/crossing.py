"""Edges that go through surfaces between their nodes.

Contact points of rods are at nodes, so a surface that is smaller than an edge, or that has a corner, can come between
two of them without touching either. No barrier sees that; this does, after the fact.

Edges are checked at the end of a step and at samples within it, between which nothing moves by more than half the
thickness of the surface. Between start and end of the step an edge moves on straight lines in the frame of the surface.

The signed distance φ of a convex shape is convex along a line. So a tangent to φ along an edge bounds it from below,
and where the tangents at both ends of an interval meet is the least that φ can be within: either that is positive, or
φ there is negative, or it is the end of a shorter interval (Kelley's cutting planes, 1960).
"""

from __future__ import annotations

import math

from bilayer_core.contact.shapes import shape_distance
from bilayer_core.jit import kernel
from bilayer_core.kinematics.copying import copy

CUTS = 60
"""Intervals that are looked at in one edge; each is a part of the one before."""
FINE = 1e-9
"""Part of an edge: a shorter interval is a point."""
SAMPLES = 256
"""Within a step, at most."""


@kernel
def note_start(surfaces, at):
    """Remember where nodes and surfaces are at the start of a step."""
    copy(at.position, surfaces.first_position)
    copy(at.surface_position, surfaces.first_surface_position)
    copy(at.surface_rotation, surfaces.first_surface_rotation)


@kernel
def crossing(strands, surfaces, at):
    """Find the first edge whose centreline goes through a surface between its nodes.

    Only edges whose nodes both meet the surface count: a rod may grow out of a body that holds it. A plane lies on one
    side of every edge whose nodes it has on that side.

    Parameters
    ----------
    strands, surfaces, at
        Records `Strands`, `Surfaces` and `Configuration` (`model.records`), that of the end of a step.

    Returns
    -------
    number : int
        That of the edge, plus that of the surface times the number of edges; −1 if there is none.
    """
    x, first, p, first_p = at.position, surfaces.first_position, at.surface_position, surfaces.first_surface_position
    for s in range(p.shape[0]):
        for e in range(strands.edge_count):
            if not surfaces.edge_can_cross[s, e]:
                continue
            a = strands.edge_node[e]
            moved = far = onward = square = before = 0.0
            for c in range(3):  # from the surface's position to the edge's middle, at the start and at the end
                start = 0.5 * (first[a, c] + first[a + 1, c]) - first_p[s, c]
                end = 0.5 * (x[a, c] + x[a + 1, c]) - p[s, c]
                moved += (end - start) ** 2
                onward -= start * (end - start)
                far += start**2
                square += (x[a + 1, c] - x[a, c]) ** 2
                before += (first[a + 1, c] - first[a, c]) ** 2
            part = min(max(onward / moved, 0.0), 1.0) if moved > 0.0 else 0.0
            nearest = far - 2.0 * part * onward + part**2 * moved
            limit = surfaces.bound[s] + 0.5 * math.sqrt(max(square, before))
            if nearest < limit**2 and _crosses_within_step(surfaces, at, a, s):
                return e + s * strands.edge_count
    return -1


@kernel
def _seen_from(position, axes, s, x, a):
    """Return where node a is in the frame of surface s [m]."""
    z0, z1, z2 = x[a, 0] - position[s, 0], x[a, 1] - position[s, 1], x[a, 2] - position[s, 2]
    return (
        axes[s, 0, 0] * z0 + axes[s, 1, 0] * z1 + axes[s, 2, 0] * z2,
        axes[s, 0, 1] * z0 + axes[s, 1, 1] * z1 + axes[s, 2, 1] * z2,
        axes[s, 0, 2] * z0 + axes[s, 1, 2] * z1 + axes[s, 2, 2] * z2,
    )


@kernel
def _crosses_within_step(surfaces, at, a, s):
    """Return whether the edge behind node a goes through surface s at the end of a step, or at a moment within it."""
    x, position, axes = surfaces.first_position, surfaces.first_surface_position, surfaces.first_surface_rotation
    a0, b0 = _seen_from(position, axes, s, x, a), _seen_from(position, axes, s, x, a + 1)
    x, position, axes = at.position, at.surface_position, at.surface_rotation
    a1, b1 = _seen_from(position, axes, s, x, a), _seen_from(position, axes, s, x, a + 1)
    of_a = (a1[0] - a0[0]) ** 2 + (a1[1] - a0[1]) ** 2 + (a1[2] - a0[2]) ** 2
    of_b = (b1[0] - b0[0]) ** 2 + (b1[1] - b0[1]) ** 2 + (b1[2] - b0[2]) ** 2
    displacement, thickness = math.sqrt(max(of_a, of_b)), _thickness(surfaces, s)
    samples = SAMPLES if displacement > SAMPLES * thickness else int(math.ceil(displacement / thickness))
    for k in range(samples, 0, -1):
        t = k / samples
        r = 1.0 - t
        if _goes_through(
            surfaces,
            s,
            (r * a0[0] + t * a1[0], r * a0[1] + t * a1[1], r * a0[2] + t * a1[2]),
            (r * b0[0] + t * b1[0], r * b0[1] + t * b1[1], r * b0[2] + t * b1[2]),
        ):
            return True
    return samples == 0 and _goes_through(surfaces, s, a1, b1)


@kernel
def _thickness(surfaces, s):
    """Return the least half thickness of a surface, and a little [m]."""
    least = min(surfaces.size[s, 0], surfaces.size[s, 1], surfaces.size[s, 2])
    return least + surfaces.rounding[s] + FINE * surfaces.bound[s]


@kernel
def _distance(surfaces, s, a, b, t):
    """Return the signed distance of surface s at the part t from a to b [m], and its slope along t [m]."""
    size = surfaces.size
    w0, w1, w2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    x, y, z = a[0] + t * w0, a[1] + t * w1, a[2] + t * w2
    d, g0, g1, g2 = shape_distance(surfaces.kind[s], size[s, 0], size[s, 1], size[s, 2], x, y, z)
    return d - surfaces.rounding[s], g0 * w0 + g1 * w1 + g2 * w2


@kernel
def _goes_through(surfaces, s, a, b):
    """Return whether the line between points a and b, outside of surface s and in its frame, enters the surface."""
    first, last = 0.0, 1.0
    low, fall = _distance(surfaces, s, a, b, first)
    high, rise = _distance(surfaces, s, a, b, last)
    for _ in range(CUTS):
        if fall >= 0.0 or rise <= 0.0:  # the least is at an end
            return False
        t = (high - low + fall * first - rise * last) / (fall - rise)
        if low + fall * (t - first) > 0.0 or not first + FINE < t < last - FINE:
            return False
        d, slope = _distance(surfaces, s, a, b, t)
        if d < 0.0:
            return True
        if slope < 0.0:
            first, low, fall = t, d, slope
        else:
            last, high, rise = t, d, slope
    return False
