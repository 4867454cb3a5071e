"""The largest fraction of a step over which every gap keeps a tenth of its present size.

The gap of a contact point and a convex surface is a convex function of the point's position p in the surface's frame.
So from a moment t of the step on

    d(t + τ) ≥ d + d′ τ − ½ C τ²,   |p″| ≤ C = |φ_A|² |a| + 2 |φ_B| V + |φ_B|² (|ρ| + V),
    V = |δX_A − δX_B| + |φ_A| |a|

for a contact point of body A at the arm a, a surface of body B and ρ between them; C is zero where nothing turns. A
contact point of a rod at Σ c_e e + Σ s_e A_e from its node (`contact.near`) moves and turns with edges e, whose ends
move along straight lines, or on arcs of bodies that hold them. The tangent t = e/|e| is reached from t₀ by the shortest
arc: the frame turns by

    ω = t × ṫ + (θ̇ − (t₀ × t)·ṫ/(1 + t₀·t)) t,   ω × A = ω·t (t × A) − (ṫ·A) t

the last part only where t leaves a great circle, for an edge with an end that is held. While an edge keeps half its
length l, |ṫ| ≤ 2 |ė|/l, and t is at most a sixth of a half turn from t₀. So ω ≤ W = 2.6 |ė|/l + |δθ|, and with
|A| the sum of |s_e A_e|, in V and C |φ_A| |a| is W |A| + Σ |c_e| |ė|, |φ_A|² |a| is (4 W² + 3 |ë|/l) |A| + Σ |c_e| |ë|
and what its node has itself.

Advancing to the τ at which the right side falls to the kept gap, again and again, approaches the first moment at which
d does from below: without turning this is Newton's method on a convex function, exact for a plane at once. A contact
point cannot jump over a surface however long the step (continuous collision detection; Li et al. 2020, sec. 5).
"""

from __future__ import annotations

import math

from bilayer_core.contact.gap import gap_normal, place_of, stands_aside
from bilayer_core.contact.shapes import SPHERE
from bilayer_core.jit import kernel
from bilayer_core.jit.called import stack_vector
from bilayer_core.kinematics.vector import row

KEPT_FRACTION = 0.1  # of each gap
CLOSE_ENOUGH = 1e-6  # of a gap: how near to the kept gap the search ends
MAX_ADVANCES = 50  # what is reached by then is kept: a bound all the same


@kernel
def _turned(v0, v1, v2, t, r0, r1, r2):
    """Return exp(t [r]×) v"""
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
    """Return |δX| + |δφ| extent of a body in a step [m]."""
    shift = motion[b, 0] ** 2 + motion[b, 1] ** 2 + motion[b, 2] ** 2
    angle = motion[b, 3] ** 2 + motion[b, 4] ** 2 + motion[b, 5] ** 2
    return math.sqrt(shift) + math.sqrt(angle) * extent


@kernel
def _acceleration_of_node(surfaces, system, at, i):
    """Return a bound of the acceleration of a node during a step, in units of its length [m]: one that a body holds
    moves on an arc.
    """
    motion, b = system.motion, surfaces.moved_by[i]
    if b < 0:
        return 0.0
    square = 0.0
    for c in range(3):
        square += (at.position[i, c] - at.pose_position[b, c]) ** 2
    return (motion[b, 3] ** 2 + motion[b, 4] ** 2 + motion[b, 5] ** 2) * math.sqrt(square)


@kernel
def _speed_of_node(surfaces, system, at, i):
    """Return a bound of its speed likewise [m]."""
    step = system.node_step
    start = math.sqrt(step[i, 0] ** 2 + step[i, 1] ** 2 + step[i, 2] ** 2)
    return start + _acceleration_of_node(surfaces, system, at, i)


@kernel
def square_of_change(strands, system, e):
    """Return the square of the change of an edge vector in a step, |δe|² [m²]."""
    n, step, square = strands.edge_node[e], system.node_step, 0.0
    for c in range(3):
        square += (step[n + 1, c] - step[n, c]) ** 2
    return square


@kernel
def _turn_of_edge(surfaces, strands, system, at, e):
    """Return the bounds of |ė|/l, |θ̇| and |ë|/l of an edge during a step."""
    n, size = strands.edge_node[e], math.sqrt(square_of_change(strands, system, e))
    change = _acceleration_of_node(surfaces, system, at, n) + _acceleration_of_node(surfaces, system, at, n + 1)
    return (size + change) / at.length[e], abs(system.angle_step[e]), change / at.length[e]


@kernel
def _turn_at_node(surfaces, strands, system, at, i):
    """Return the largest values of `_turn_of_edge` over the edges at a node."""
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    slope, angle, change = _turn_of_edge(surfaces, strands, system, at, before)
    slope_, angle_, change_ = _turn_of_edge(surfaces, strands, system, at, after)
    return max(slope, slope_), max(angle, angle_), max(change, change_)


@kernel
def _motion_of_rod_points(surfaces, strands, system, at):
    """Return a bound of the motion in a step of all contact points with an arm from their node [m].

    The angle between an edge and where it is by a part α of a step is at most π/2 α |ė|/l, or π if |ė|/l is above 1.
    """
    if not surfaces.rod_points.exists:
        return 0.0
    step, held = system.node_step, surfaces.moved_by
    steepest = sharpest = speed = of_free_edges = of_free_nodes = 0.0
    for e in range(strands.edge_node.shape[0]):
        n = strands.edge_node[e]
        sharpest = max(sharpest, abs(system.angle_step[e]))
        if held[n] >= 0 or held[n + 1] >= 0:
            steepest = max(steepest, _turn_of_edge(surfaces, strands, system, at, e)[0])
        else:
            of_free_edges = max(of_free_edges, square_of_change(strands, system, e) / (at.length[e] * at.length[e]))
    for i in range(surfaces.node_free.shape[0]):
        if held[i] >= 0:
            speed = max(speed, _speed_of_node(surfaces, system, at, i))
        else:
            of_free_nodes = max(of_free_nodes, step[i, 0] ** 2 + step[i, 1] ** 2 + step[i, 2] ** 2)
    steepest, speed = max(steepest, math.sqrt(of_free_edges)), max(speed, math.sqrt(of_free_nodes))
    turn = (0.5 * math.pi if steepest <= 1.0 else math.pi) * steepest + sharpest
    return surfaces.rod_points.node_factor * speed + surfaces.rod_points.longest * turn


@kernel
def motion_of_points(surfaces, bodies, strands, system, at):
    """Return the largest motion of a contact point in a step [m]."""
    step, square = system.node_step, 0.0
    for i in range(surfaces.node_free.shape[0]):
        if surfaces.node_free[i]:
            square = max(square, step[i, 0] ** 2 + step[i, 1] ** 2 + step[i, 2] ** 2)
    largest = max(math.sqrt(square), _motion_of_rod_points(surfaces, strands, system, at))
    for b in range(bodies.bounding_radius.shape[0]):
        largest = max(largest, _fastest(system.motion, b, bodies.bounding_radius[b]))
    return largest


@kernel
def motion_of_surfaces(surfaces, system):
    """Return the largest motion of a point of a surface in a step [m], by the extents that the list of near
    pairs has.
    """
    largest = 0.0
    for s in range(surfaces.body.shape[0]):
        largest = max(largest, _fastest(system.motion, surfaces.body[s], surfaces.extent[s]))
    return largest


@kernel
def _carry(t0, t1, t2, m0, m1, m2, angle, u0, u1, u2):
    """Return a vector m normal to the unit tangent t, carried to the unit tangent u and turned about it."""
    scale = (m0 * u0 + m1 * u1 + m2 * u2) / (1.0 + t0 * u0 + t1 * u1 + t2 * u2)
    m0, m1, m2 = m0 - scale * (t0 + u0), m1 - scale * (t1 + u1), m2 - scale * (t2 + u2)
    c, s = math.cos(angle), math.sin(angle)
    return c * m0 + s * (u1 * m2 - u2 * m1), c * m1 + s * (u2 * m0 - u0 * m2), c * m2 + s * (u0 * m1 - u1 * m0)


@kernel
def _node_at(surfaces, system, at, i, t):
    """Return the displacement of a node at a part t of a step, and its rate, as one tuple."""
    step, b = system.node_step, surfaces.moved_by[i]
    if b < 0:
        return t * step[i, 0], t * step[i, 1], t * step[i, 2], step[i, 0], step[i, 1], step[i, 2]
    motion, x, p = system.motion, at.position, at.pose_position
    a0, a1, a2 = x[i, 0] - p[b, 0], x[i, 1] - p[b, 1], x[i, 2] - p[b, 2]
    r0, r1, r2 = motion[b, 3], motion[b, 4], motion[b, 5]
    b0, b1, b2 = _turned(a0, a1, a2, t, r0, r1, r2)
    return (
        t * motion[b, 0] + b0 - a0,
        t * motion[b, 1] + b1 - a1,
        t * motion[b, 2] + b2 - a2,
        motion[b, 0] + r1 * b2 - r2 * b1,
        motion[b, 1] + r2 * b0 - r0 * b2,
        motion[b, 2] + r0 * b1 - r1 * b0,
    )


@kernel
def _rod_point_at(surfaces, strands, system, at, k, t, moved_out, rate_out):
    """Write the displacement of a contact point with an arm at a part t of a step, and its rate."""
    mix, node, angle_step = surfaces.near_mix, surfaces.near_node[k], system.angle_step
    moved = _node_at(surfaces, system, at, node, t)
    for c in range(3):
        moved_out[c], rate_out[c] = moved[c], moved[3 + c]
    for side in range(2):
        e, along_edge, part = surfaces.node_edges[node, side], mix[k, side], mix[k, 2 + side]
        n, length, tangent = strands.edge_node[e], at.length[e], row(at.tangent, e)
        first, last = _node_at(surfaces, system, at, n, t), _node_at(surfaces, system, at, n + 1, t)
        m, w = row(at.director1, e), row(at.director2, e)
        a0 = mix[k, 4] * m[0] + mix[k, 5] * w[0]
        a1 = mix[k, 4] * m[1] + mix[k, 5] * w[1]
        a2 = mix[k, 4] * m[2] + mix[k, 5] * w[2]
        u0 = tangent[0] + (last[0] - first[0]) / length
        u1 = tangent[1] + (last[1] - first[1]) / length
        u2 = tangent[2] + (last[2] - first[2]) / length
        stretch = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2)
        u0, u1, u2 = u0 / stretch, u1 / stretch, u2 / stretch
        b0, b1, b2 = _carry(tangent[0], tangent[1], tangent[2], a0, a1, a2, t * angle_step[e], u0, u1, u2)
        v0, v1, v2 = last[3] - first[3], last[4] - first[4], last[5] - first[5]
        along = (v0 * b0 + v1 * b1 + v2 * b2) / (length * stretch)
        spin = v0 * (tangent[1] * u2 - tangent[2] * u1) + v1 * (tangent[2] * u0 - tangent[0] * u2)
        spin += v2 * (tangent[0] * u1 - tangent[1] * u0)
        spin /= (1.0 + tangent[0] * u0 + tangent[1] * u1 + tangent[2] * u2) * length * stretch
        spin = angle_step[e] - spin
        moved_out[0] += along_edge * (last[0] - first[0]) + part * (b0 - a0)
        moved_out[1] += along_edge * (last[1] - first[1]) + part * (b1 - a1)
        moved_out[2] += along_edge * (last[2] - first[2]) + part * (b2 - a2)
        rate_out[0] += along_edge * v0 + part * (spin * (u1 * b2 - u2 * b1) - along * u0)
        rate_out[1] += along_edge * v1 + part * (spin * (u2 * b0 - u0 * b2) - along * u1)
        rate_out[2] += along_edge * v2 + part * (spin * (u0 * b1 - u1 * b0) - along * u2)


@kernel
def step_bound(surfaces, strands, system, at, closing):
    """Return the largest α ≤ 1 such that all gaps keep `KEPT_FRACTION` of themselves along β step, 0 ≤ β ≤ α.

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
    moved, rate_of_point = stack_vector(3), stack_vector(3)
    for k in range(surfaces.near_count[0]):
        if stands_aside(surfaces, k):
            continue
        i, s = surfaces.near_contact_point[k], surfaces.near_surface[k]
        x0, x1, x2 = place_of(surfaces, at, k)
        gap, n0, n1, n2, _, _, _ = gap_normal(surfaces, at, surfaces.near_radius[k], s, x0, x1, x2)
        kept = KEPT_FRACTION * gap
        if gap - closing * alpha >= kept:
            continue
        off_node = surfaces.near_arm[k]
        a, b = -1 if off_node else surfaces.moved_by[i], surfaces.body[s]
        r0 = r1 = r2 = turn_a = 0.0  # rotation of the contact point's body
        a0 = a1 = a2 = arm = slope = change = of_node = own = 0.0  # arm on it
        if a >= 0:
            u0, u1, u2 = motion[a, 0], motion[a, 1], motion[a, 2]
            r0, r1, r2 = motion[a, 3], motion[a, 4], motion[a, 5]
            a0, a1, a2 = x0 - position[a, 0], x1 - position[a, 1], x2 - position[a, 2]
            arm, turn_a = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2), math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
        elif not off_node:
            u0, u1, u2 = node_step[i, 0], node_step[i, 1], node_step[i, 2]
        else:
            n, mix, u0, u1, u2 = surfaces.near_node[k], surfaces.near_mix, 0.0, 0.0, 0.0
            of_node, own = _speed_of_node(surfaces, system, at, n), _acceleration_of_node(surfaces, system, at, n)
            slope, angle, change = _turn_at_node(surfaces, strands, system, at, n)
            turn_a, arm = 2.6 * slope + angle, math.sqrt(mix[k, 4] ** 2 + mix[k, 5] ** 2)
            arm *= abs(mix[k, 2]) + abs(mix[k, 3])
            along = abs(mix[k, 0]) * at.length[surfaces.node_edges[n, 0]]
            along += abs(mix[k, 1]) * at.length[surfaces.node_edges[n, 1]]
            of_node, own = of_node + along * slope, own + along * change
        u0, u1, u2 = u0 - motion[b, 0], u1 - motion[b, 1], u2 - motion[b, 2]
        f0, f1, f2 = motion[b, 3], motion[b, 4], motion[b, 5]
        if surfaces.kind[s] == SPHERE:
            f0 = f1 = f2 = 0.0
        z0, z1, z2 = x0 - position[b, 0], x1 - position[b, 1], x2 - position[b, 2]
        lever = turn_b = 0.0
        if f0 != 0.0 or f1 != 0.0 or f2 != 0.0:
            lever, turn_b = math.sqrt(z0 * z0 + z1 * z1 + z2 * z2), math.sqrt(f0 * f0 + f1 * f1 + f2 * f2)
        if alpha * slope > 0.5:  # the longest part for which the bounds of an arm's motion hold
            alpha, blocking = 0.5 / slope, k
        speed = math.sqrt(u0 * u0 + u1 * u1 + u2 * u2) + of_node + turn_a * arm
        if gap - (speed + turn_b * (lever + speed)) * alpha >= kept:
            continue
        own += (4.0 * turn_a * turn_a + 3.0 * change if off_node else turn_a * turn_a) * arm
        acceleration = own + 2.0 * turn_b * speed + turn_b * turn_b * (lever + speed)
        # the contact point in a frame that moves and turns with the surface from where that is now
        t = 0.0
        d = gap
        b0, b1, b2 = a0, a1, a2
        for _ in range(MAX_ADVANCES):
            # rate of p in the frame of the surface at t: u + φ_A × a − φ_B × z
            w0 = u0 + r1 * b2 - r2 * b1
            w1 = u1 + r2 * b0 - r0 * b2
            w2 = u2 + r0 * b1 - r1 * b0
            if off_node:
                _rod_point_at(surfaces, strands, system, at, k, t, moved, rate_of_point)
                w0, w1, w2 = u0 + rate_of_point[0], u1 + rate_of_point[1], u2 + rate_of_point[2]
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
            if off_node:
                _rod_point_at(surfaces, strands, system, at, k, t, moved, rate_of_point)
                b0, b1, b2 = moved[0], moved[1], moved[2]
            z0 = x0 - a0 + t * u0 + b0 - position[b, 0]
            z1 = x1 - a1 + t * u1 + b1 - position[b, 1]
            z2 = x2 - a2 + t * u2 + b2 - position[b, 2]
            if turn_b > 0.0:
                z0, z1, z2 = _turned(z0, z1, z2, -t, f0, f1, f2)
            y0, y1, y2 = z0 + position[b, 0], z1 + position[b, 1], z2 + position[b, 2]
            d, n0, n1, n2, _, _, _ = gap_normal(surfaces, at, surfaces.near_radius[k], s, y0, y1, y2)
            if d <= kept + CLOSE_ENOUGH * gap:
                break
        if t < alpha:
            alpha = t
            blocking = k
    return alpha, blocking
