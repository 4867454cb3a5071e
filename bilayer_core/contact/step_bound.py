"""The largest fraction of a step over which every gap keeps a tenth of its present size.

The gap of a contact point and a convex surface is a convex function of the point's position p in the surface's frame.
So from a moment t of the step on

    d(t + τ) ≥ d + d′ τ − ½ C τ²,   |p″| ≤ C = |φ_A|² |a| + 2 |φ_B| V + |φ_B|² (|ρ| + V),
    V = |δX_A − δX_B| + |φ_A| |a|

for a contact point of body A at the arm a, a surface of body B and ρ between them; C is zero where nothing turns.
Advancing to the τ at which the right side falls to the kept gap, again and again, approaches the first moment at which
d does from below: without turning this is Newton's method on a convex function, exact for a plane at once. A contact
point cannot jump over a surface however long the step (continuous collision detection; Li et al. 2020, sec. 5).
"""

from __future__ import annotations

import math

from ..jit import kernel
from .near import gap_normal
from .shapes import SPHERE

KEPT_FRACTION = 0.1  # of each gap
CLOSE_ENOUGH = 1e-6  # of a gap: how near to the kept gap the search ends
MAX_ADVANCES = 50  # what is reached by then is kept: a bound all the same


@kernel
def _turned(v0, v1, v2, t, r0, r1, r2):
    """exp(t [r]×) v"""
    angle = t * math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
    if angle == 0.0:
        return v0, v1, v2
    r0, r1, r2 = t * r0 / angle, t * r1 / angle, t * r2 / angle
    cosine, sine = math.cos(angle), math.sin(angle)
    along = (1.0 - cosine) * (r0 * v0 + r1 * v1 + r2 * v2)
    return (
        cosine * v0 + sine * (r1 * v2 - r2 * v1) + along * r0,
        cosine * v1 + sine * (r2 * v0 - r0 * v2) + along * r1,
        cosine * v2 + sine * (r0 * v1 - r1 * v0) + along * r2,
    )


@kernel
def _fastest(motion, b, extent):
    """|δX| + |δφ| extent of a body in a step [m]."""
    shift = motion[b, 0] ** 2 + motion[b, 1] ** 2 + motion[b, 2] ** 2
    angle = motion[b, 3] ** 2 + motion[b, 4] ** 2 + motion[b, 5] ** 2
    return math.sqrt(shift) + math.sqrt(angle) * extent


@kernel
def motion_of_points(surfaces, bodies, system):
    """Largest motion of a contact point in a step [m]."""
    step, square = system.node_step, 0.0
    for i in range(surfaces.node_free.shape[0]):
        if surfaces.node_free[i]:
            square = max(square, step[i, 0] ** 2 + step[i, 1] ** 2 + step[i, 2] ** 2)
    largest = math.sqrt(square)
    for b in range(bodies.bounding_radius.shape[0]):
        largest = max(largest, _fastest(system.motion, b, bodies.bounding_radius[b]))
    return largest


@kernel
def motion_of_surfaces(surfaces, system):
    """Largest motion of a point of a surface in a step [m], by the extents that the list of near pairs has."""
    largest = 0.0
    for s in range(surfaces.body.shape[0]):
        largest = max(largest, _fastest(system.motion, surfaces.body[s], surfaces.extent[s]))
    return largest


@kernel
def step_bound(surfaces, system, at, closing):
    """Largest α ≤ 1 such that all gaps keep `KEPT_FRACTION` of themselves along β step, 0 ≤ β ≤ α.

    Parameters
    ----------
    surfaces : Surfaces
        With the list of near pairs.
    system : System
        With the step: displacements of nodes, displacements and rotation vectors of bodies and of the world.
    at : Configuration
    closing : float
        By how much gaps close at most [m].

    Returns
    -------
    alpha : float
    blocking : int
        Configuration in the list of the pair that sets the bound, −1 if none.
    """
    node_step, motion, position = system.node_step, system.motion, at.pose_position
    alpha, blocking = 1.0, -1
    for k in range(surfaces.near_count[0]):
        i, s = surfaces.near_contact_point[k], surfaces.near_surface[k]
        x0, x1, x2 = at.contact_point[i, 0], at.contact_point[i, 1], at.contact_point[i, 2]
        gap, n0, n1, n2, _, _, _ = gap_normal(surfaces, at, i, s, x0, x1, x2)
        kept = KEPT_FRACTION * gap
        if gap - closing * alpha >= kept:
            continue
        a, b = surfaces.moved_by[i], surfaces.body[s]
        r0 = r1 = r2 = turn_a = 0.0  # rotation of the contact point's body
        a0 = a1 = a2 = arm = 0.0  # arm on it
        if a >= 0:
            u0, u1, u2 = motion[a, 0], motion[a, 1], motion[a, 2]
            r0, r1, r2 = motion[a, 3], motion[a, 4], motion[a, 5]
            a0, a1, a2 = x0 - position[a, 0], x1 - position[a, 1], x2 - position[a, 2]
            arm, turn_a = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2), math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
        else:
            u0, u1, u2 = node_step[i, 0], node_step[i, 1], node_step[i, 2]
        u0, u1, u2 = u0 - motion[b, 0], u1 - motion[b, 1], u2 - motion[b, 2]
        f0, f1, f2 = motion[b, 3], motion[b, 4], motion[b, 5]
        if surfaces.kind[s] == SPHERE:
            f0 = f1 = f2 = 0.0
        z0, z1, z2 = x0 - position[b, 0], x1 - position[b, 1], x2 - position[b, 2]
        lever = turn_b = 0.0
        if f0 != 0.0 or f1 != 0.0 or f2 != 0.0:
            lever, turn_b = math.sqrt(z0 * z0 + z1 * z1 + z2 * z2), math.sqrt(f0 * f0 + f1 * f1 + f2 * f2)
        speed = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2) + turn_a * arm
        if gap - (speed + turn_b * (lever + speed)) * alpha >= kept:
            continue
        acceleration = turn_a * turn_a * arm + 2.0 * turn_b * speed + turn_b * turn_b * (lever + speed)
        # the contact point in a frame that moves and turns with the surface from where that is now
        t = 0.0
        d = gap
        b0, b1, b2 = a0, a1, a2
        for _ in range(MAX_ADVANCES):
            # rate of p in the frame of the surface at t: u + φ_A × a − φ_B × z
            w0 = u0 + r1 * b2 - r2 * b1
            w1 = u1 + r2 * b0 - r0 * b2
            w2 = u2 + r0 * b1 - r1 * b0
            if turn_b > 0.0:
                w0, w1, w2 = _turned(w0, w1, w2, -t, f0, f1, f2)
                w0, w1, w2 = w0 - (f1 * z2 - f2 * z1), w1 - (f2 * z0 - f0 * z2), w2 - (f0 * z1 - f1 * z0)
            rate = n0 * w0 + n1 * w1 + n2 * w2
            if acceleration == 0.0:
                if rate >= 0.0:
                    t = 1.0
                    break
                t += (kept - d) / rate
            else:
                # d + rate τ − ½ acceleration τ² = kept, the positive root without cancellation
                root = math.sqrt(rate * rate + 2.0 * acceleration * (d - kept))
                t += 2.0 * (d - kept) / (root - rate) if rate <= 0.0 else (rate + root) / acceleration
            if t >= alpha:
                break
            b0, b1, b2 = _turned(a0, a1, a2, t, r0, r1, r2)
            z0 = x0 - a0 + t * u0 + b0 - position[b, 0]
            z1 = x1 - a1 + t * u1 + b1 - position[b, 1]
            z2 = x2 - a2 + t * u2 + b2 - position[b, 2]
            if turn_b > 0.0:
                z0, z1, z2 = _turned(z0, z1, z2, -t, f0, f1, f2)
            y0, y1, y2 = z0 + position[b, 0], z1 + position[b, 1], z2 + position[b, 2]
            d, n0, n1, n2, _, _, _ = gap_normal(surfaces, at, i, s, y0, y1, y2)
            if d <= kept + CLOSE_ENOUGH * gap:
                break
        if t < alpha:
            alpha = t
            blocking = k
    return alpha, blocking
