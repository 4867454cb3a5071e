"""Smoothed Coulomb friction that may differ with the direction of sliding.

With normal force λ, normal n and contact points frozen, the slip u of the contact points over a stage of length h gives
a dissipation potential (Li et al. 2020, eq. 14; paper, eqs. 25 and 26, f₁ and u_t put right). Let a be the forward
direction in the tangent plane, s = n × a, and

    ψ(u)² = (μ± u·a)² + (μ_s u·s)²,   μ± = μ₊ where u·a ≥ 0, μ₋ elsewhere,   μ = max(μ₊, μ₋, μ_s),   w = ψ/(μ h)

    D = λ μ h f₀(w),   force −λ f₁(w) q/ψ,   q = μ±² (u·a) a + μ_s² (u·s) s

A slip along +a meets λ μ₊, one along −a λ μ₋; with equal coefficients D = μ λ h f₀(|u_t|/h). D is convex, ψ² once
continuously differentiable:

    ∂D/∂u = λ κ q =: G,   κ = f₁/(w μ h)
    ∂²D/∂u² = λ [κ (μ±² a aᵀ + μ_s² s sᵀ) + (f₁′ − f₁/w)/(w² (μ h)³) q qᵀ] =: F

The forward direction is that of the rod at its node, unless the surface has a grain, which turns with its body, or the
world an axis: these hold for all that slides, with a of the frozen contact. Points of a grained body on a plain
surface have u·(−a): there the surface slides on the grain. Where the grain is along the normal, friction is the same
every way.

A contact point on a body moves with it: y = X + a, where the arm a from the body's position turns with the body,
δa = δφ × a + ½ δφ × (δφ × a). So u, the motion of the contact point relative to that of the surface below it, depends
on the motion of both (`forces.contact_on_bodies`), and the force on one side is opposite to that on the other. Both
points are one, on the face of the body or rod, x − r n, and so the moments cancel as well. That of a rod moves with its
node and turns with the edges there, by a rate that is frozen with the contact (`forces.rod_arms`). F is positive
semidefinite.

A contact of a rod stands for a stretch of it: half an edge on each side of a station, less where a box or cylinder
divides edges. Where slip turns round in a stretch that lies on a flat face, or close by, its load is spread over places
of that, `PARTS` an edge, for the rest of the stage: slip is linear between stations, and what rests may be
anywhere. A place slips as fast as the next one within f₁ of a threshold that is widened to the difference of the two,
so that friction is continuous as what rests moves along: f₁′ falls linearly to 0 there, and such hats add up to 1. (By
contacts alone the stride of a strip that extends is off by several percent, as its resting point is always one of
them.)

Contacts are frozen at the start of a stage, and anew at each minimum of the potential, until that minimum stays: so λ,
n and a are those of the stage's own end, without which integrators lose their order. The normal force that λ makes
differs from it by a factor of about μ |A_nt|/A_nn, with A the compliance of what touches: where that is near 1 or
above, as for a leg within its cone of friction, Aitken's relaxation keeps λ from swinging:

    λ ← λ + ω r,   r the change,   ω ← −ω r₋·(r − r₋)/|r − r₋|²
"""

from __future__ import annotations

import math

from bilayer_core.contact.barrier import barrier_gradient
from bilayer_core.contact.friction_law import friction_over_speed, friction_potential, friction_slope
from bilayer_core.contact.gap import gap_normal, mix_of, place_of, rod_point
from bilayer_core.forces.contact_on_bodies import add_force, add_second_derivative
from bilayer_core.forces.restitution import damping_at
from bilayer_core.forces.rod_arms import (
    add_motion_of_arm,
    add_step_of_arm,
    add_to_edges,
    copy_rate,
    new_arm,
    write_rate,
)
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.kinematics.copying import copy_matrix
from bilayer_core.kinematics.rotating import product_transposed
from bilayer_core.kinematics.vector import row
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.contacts import Sliding
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage

FRICTION = slot_of("friction")
NO_DIRECTION = 1e-6
"""Sine of the angle between a grain and the normal below which it has no direction in the tangent plane."""
LEAST_RELAXATION, LARGEST_RELAXATION = 0.3, 3.0
PARTS = 8
"""Places of an edge at which it slides where its slip turns round."""
MOST_PLACES = 256 * PARTS
"""Of rods, at most: where slip turns round in more stretches than that, the others slide at their contacts alone."""
BESIDE = 0.5
"""How far beside a stretch slip may turn round for it to have such places, as a part of an edge."""
ALIKE = 0.25
"""Part of the slip within which a contact sticks by which slips may differ without friction that does."""
ROUNDING = 1e-9
"""Of a number of places."""


@kernel
def _forward(sliding, edges, start, on_rod, i, n0, n1, n2):
    """Return the forward direction of a contact in its tangent plane, a unit vector.

    That of the rod at a node (mean of its edges), any direction for a body. A rod whose direction is along the normal
    has no forward direction there: what rounding leaves of the projection decides.
    """
    x, y, z = 1.0, 0.0, 0.0
    if on_rod:
        e, f, axis = edges[i, 0], edges[i, 1], sliding.node_axis[i]
        t, m = start.tangent, start.director1
        t0, t1, t2 = t[e, 0] + t[f, 0], t[e, 1] + t[f, 1], t[e, 2] + t[f, 2]
        m0, m1, m2 = m[e, 0] + m[f, 0], m[e, 1] + m[f, 1], m[e, 2] + m[f, 2]
        x, y, z = t0, t1, t2
        if axis == 1:
            x, y, z = m0, m1, m2
        elif axis != 0:
            side = 0.5 * axis  # −1 where the rod is a mirror image
            x, y, z = side * (t1 * m2 - t2 * m1), side * (t2 * m0 - t0 * m2), side * (t0 * m1 - t1 * m0)
    return _tangential(x, y, z, n0, n1, n2)


@kernel
def _tangential(x, y, z, n0, n1, n2):
    """Return the unit vector along the part of (x, y, z) in the plane perpendicular to the unit vector n."""
    for _ in range(2):
        along = x * n0 + y * n1 + z * n2
        x, y, z = x - along * n0, y - along * n1, z - along * n2
        size = math.sqrt(x * x + y * y + z * z)
        if size > 0.0:
            x, y, z = x / size, y / size, z / size
        else:
            x, y, z = n1, n2, n0  # parallel to n only if its three components are equal
    return x, y, z


@kernel
def _axis_of_grain(sliding, at, i, s, a, b):
    """Return the forward direction for contact point i, on body a or −1, on surface s of body b: that of the surface's
    grain, or of the grain that the point's own surface slides with, or of the world; a unit vector, or 0 without any.
    """
    x, y, z = row(sliding.surface_grain, s)
    if x != 0.0 or y != 0.0 or z != 0.0:
        return _turned(at.rotation, b, x, y, z, 1.0)
    x, y, z = row(sliding.point_grain, i)
    if a >= 0 and (x != 0.0 or y != 0.0 or z != 0.0):
        return _turned(at.rotation, a, x, y, z, -1.0)
    x, y, z = sliding.world_axis[0], sliding.world_axis[1], sliding.world_axis[2]
    sign = -1.0 if a == at.rotation.shape[0] - 1 else 1.0  # an obstacle's point: what moves is the surface
    return sign * x, sign * y, sign * z


@kernel
def _turned(rotation, b, x, y, z, sign):
    """Return ± rotation[b] (x, y, z)"""
    return (
        sign * (rotation[b, 0, 0] * x + rotation[b, 0, 1] * y + rotation[b, 0, 2] * z),
        sign * (rotation[b, 1, 0] * x + rotation[b, 1, 1] * y + rotation[b, 1, 2] * z),
        sign * (rotation[b, 2, 0] * x + rotation[b, 2, 1] * y + rotation[b, 2, 2] * z),
    )


@kernel
def _write_axis(sliding, surfaces, at, k, i, s, node, n):
    """Write the forward direction of contact k in its tangent plane, and its coefficients."""
    a, b = surfaces.contact_point_body[i], surfaces.body[s]
    owner = sliding.owner[i]
    for c in range(3):
        sliding.mu[k, c] = sliding.coefficient[owner, s, c]
    x = y = z = 0.0
    if sliding.grained:
        x, y, z = _axis_of_grain(sliding, at, i, s, a, b)
    if x != 0.0 or y != 0.0 or z != 0.0:
        along = x * n[0] + y * n[1] + z * n[2]
        directed = 1.0 - along * along > NO_DIRECTION * NO_DIRECTION
        for c in range(3):
            sliding.mu[k, c] = sliding.along_grain[owner, s, c] if directed else sliding.across_grain[owner, s]
        axis = _tangential(x, y, z, n[0], n[1], n[2])
    else:
        axis = _forward(sliding, surfaces.node_edges, at, a < 0, node, n[0], n[1], n[2])
    sliding.axis[k, 0], sliding.axis[k, 1], sliding.axis[k, 2] = axis


@kernel
def write_across(sliding, k, across_out):
    """Write s = n × a."""
    n, a = sliding.normal, sliding.axis
    across_out[0] = n[k, 1] * a[k, 2] - n[k, 2] * a[k, 1]
    across_out[1] = n[k, 2] * a[k, 0] - n[k, 0] * a[k, 2]
    across_out[2] = n[k, 0] * a[k, 1] - n[k, 1] * a[k, 0]


@kernel
def contact_slip(sliding, surfaces, strands, at, stage, k, arm_out, lever_out, slip_out):
    """Write the slip of a contact since the origin of the stage [m], and its arms now on the body that the contact
    point is on (not written for a rod) and on that of the surface [m].
    """
    a, b, i = surfaces.contact_point_body[sliding.first[k]], surfaces.body[sliding.surface[k]], sliding.node[k]
    rotation, origin_rotation = sliding.rotation, sliding.origin_rotation
    position, origin = at.pose_position, stage.origin_pose_position
    for c in range(3):
        slip_out[c] = 0.0 if a >= 0 else at.position[i, c] - stage.origin_position[i, c]
        if a >= 0:
            now, before = 0.0, 0.0
            for d in range(3):
                now += rotation[a, c, d] * sliding.arm[k, d]
                before += origin_rotation[a, c, d] * sliding.arm[k, d]
            arm_out[c] = now
            slip_out[c] += position[a, c] - origin[a, c] + (now - before)
        now, before = 0.0, 0.0
        for d in range(3):
            now += rotation[b, c, d] * sliding.lever[k, d]
            before += origin_rotation[b, c, d] * sliding.lever[k, d]
        lever_out[c] = now
        slip_out[c] -= position[b, c] - origin[b, c] + (now - before)
    if a < 0:
        start, start_angle, rate = stage.origin_position, stage.origin_angle, sliding.arm_rate
        add_motion_of_arm(surfaces, strands, i, k, rate, at.position, start, at.total_angle, start_angle, slip_out)


@kernel
def _add_motion(motion, body, arm, sign, rate):
    """Add ± the displacement of a point of a body in a step of its position and rotation vector."""
    r0, r1, r2 = motion[body, 3], motion[body, 4], motion[body, 5]
    rate[0] += sign * (motion[body, 0] + r1 * arm[2] - r2 * arm[1])
    rate[1] += sign * (motion[body, 1] + r2 * arm[0] - r0 * arm[2])
    rate[2] += sign * (motion[body, 2] + r0 * arm[1] - r1 * arm[0])


@kernel
def slip_paths(sliding, surfaces, strands, at, stage, system, path_out):
    """Write the slip paths of the lagged contacts in the present step, see `forces.friction_limit`."""
    arm, lever, slip, rate, s = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    a, mu, step_length = sliding.axis, sliding.mu, stage.length
    for k in range(sliding.count[0]):
        i, node = sliding.first[k], sliding.node[k]
        body, under = surfaces.contact_point_body[i], surfaces.body[sliding.surface[k]]
        contact_slip(sliding, surfaces, strands, at, stage, k, arm, lever, slip)
        for c in range(3):
            rate[c] = 0.0 if body >= 0 else system.node_step[node, c]
        if body >= 0:
            _add_motion(system.motion, body, arm, 1.0, rate)
        else:
            add_step_of_arm(surfaces, strands, node, k, sliding.arm_rate, system.node_step, system.angle_step, rate)
        _add_motion(system.motion, under, lever, -1.0, rate)
        write_across(sliding, k, s)
        path_out[k, 0] = slip[0] * a[k, 0] + slip[1] * a[k, 1] + slip[2] * a[k, 2]
        path_out[k, 1] = rate[0] * a[k, 0] + rate[1] * a[k, 1] + rate[2] * a[k, 2]
        path_out[k, 2] = slip[0] * s[0] + slip[1] * s[1] + slip[2] * s[2]
        path_out[k, 3] = rate[0] * s[0] + rate[1] * s[1] + rate[2] * s[2]
        largest = 0.0
        for c in range(3):
            path_out[k, 4 + c] = mu[k, c] ** 2
            largest = max(largest, mu[k, c])
        path_out[k, 7] = sliding.load[k] if largest > 0.0 else 0.0
        path_out[k, 8] = largest * step_length if largest > 0.0 else step_length
        path_out[k, 9] = sliding.smooth[k]


@piece(float, Sliding, Problem, Configuration, Stage, bool)
def add_surface_friction(sliding, p, at, stage, with_hessian):
    """Add the dissipation potential of the lagged contacts; returns infinity, as it knows no gap."""
    surfaces, sums = p.surfaces, p.sums
    if not (sliding.acts and sums.selected[FRICTION]):
        return math.inf
    for b in range(at.rotation.shape[0]):
        product_transposed(at.rotation, b, sliding.back, b, sliding.rotation, b)
    axis, mu = sliding.axis, sliding.mu
    arm, lever, u = stack_vector(3), stack_vector(3), stack_vector(3)
    g, q, across, hessian = stack_vector(3), stack_vector(3), stack_vector(3), stack_matrix(3, 3)
    arm[0] = arm[1] = arm[2] = 0.0
    energy = lost = 0.0
    for k in range(sliding.count[0]):
        i, node, normal_force, threshold = sliding.first[k], sliding.node[k], sliding.load[k], sliding.smooth[k]
        largest = max(mu[k, 0], mu[k, 1], mu[k, 2])
        if largest == 0.0:
            continue
        a, b = surfaces.contact_point_body[i], surfaces.body[sliding.surface[k]]
        contact_slip(sliding, surfaces, p.strands, at, stage, k, arm, lever, u)
        write_across(sliding, k, across)
        forward = u[0] * axis[k, 0] + u[1] * axis[k, 1] + u[2] * axis[k, 2]
        sideways = u[0] * across[0] + u[1] * across[1] + u[2] * across[2]
        ca = (mu[k, 0] if forward >= 0.0 else mu[k, 1]) ** 2
        cs = mu[k, 2] ** 2
        scale = largest * stage.length
        speed = math.sqrt(ca * forward * forward + cs * sideways * sideways) / scale
        energy += normal_force * scale * friction_potential(speed, threshold)
        ratio = normal_force * friction_over_speed(speed, threshold) / scale
        lost += ratio * (speed * scale) ** 2 / stage.length
        for c in range(3):
            q[c] = ca * forward * axis[k, c] + cs * sideways * across[c]
            g[c] = ratio * q[c]
            sums.contact_point[node, c] += g[c]
        if a >= 0:
            add_force(sums.contact, a, 1.0, arm, g)
        else:
            add_to_edges(surfaces, node, g, k, sliding.arm_rate, sums.edge)
        add_force(sums.contact, b, -1.0, lever, g)
        if with_hessian:
            excess = 0.0
            if speed > 0.0:
                bend = friction_slope(speed, threshold) - friction_over_speed(speed, threshold)
                excess = normal_force * bend / (speed * speed * scale**3)
            for c in range(3):
                for d in range(c, 3):
                    tensor = ca * axis[k, c] * axis[k, d] + cs * across[c] * across[d]
                    hessian[c, d] = excess * q[c] * q[d] + ratio * tensor
            r = -1
            if a < 0:
                r = new_arm(sums, node)
                copy_rate(sliding.arm_rate, k, sums.arm_rate, r)
            add_second_derivative(p, hessian, g, arm, lever, -1.0, node, r, a, b)
    sums.energy[FRICTION], sums.lost[FRICTION] = energy, lost
    return math.inf


@kernel
def _on_curve(surfaces, at, i, mix):
    """Return the place of a rod's contact point without its arm [m]."""
    return rod_point(surfaces, at, i, (mix[0], mix[1], 0.0, 0.0, 0.0, 0.0))


@kernel
def _lies_flat(surfaces, strands, stage, i, n, gap, length):
    """Return whether the stretches beside that of a contact at node i press as well, with edges as they lie at the
    origin of the stage.
    """
    start, reach = stage.origin_position, length
    if surfaces.node_edges[i, 0] == surfaces.node_edges[i, 1]:
        reach *= 2.0
    for side in range(2):
        e = surfaces.node_edges[i, side]
        k, rise = strands.edge_node[e], 0.0
        for c in range(3):
            rise += n[c] * (start[k + 1, c] - start[k, c])
        if gap + abs(rise) * reach / surfaces.edge_length[e] >= surfaces.d_hat:
            return False
    return True


@kernel
def freeze_contact(sliding, p, at, stage, k, count, n, arm):
    """Freeze the contact of near pair k as contact `count`, with scratch for its normal and its arm; return whether
    there is one, and whether it is the same as before.
    """
    surfaces = p.surfaces
    i, s = surfaces.near_contact_point[k], surfaces.near_surface[k]
    x, weight, radius = place_of(surfaces, at, k), surfaces.near_weight[k], surfaces.near_radius[k]
    d, n[0], n[1], n[2], _, _, _ = gap_normal(surfaces, at, radius, s, x[0], x[1], x[2])
    if not 0.0 < d < surfaces.d_hat or weight == 0.0:
        return False, True
    a, b, node, mix = surfaces.contact_point_body[i], surfaces.body[s], surfaces.near_node[k], mix_of(surfaces, k)
    same = count < sliding.count[0] and sliding.first[count] == i and sliding.surface[count] == s
    part = mix[0] + mix[1]
    same &= sliding.part[count, 0] == part and sliding.part[count, 1] == mix[5]
    sliding.first[count], sliding.surface[count], sliding.node[count] = i, s, node
    sliding.part[count, 0], sliding.part[count, 1] = part, mix[5]
    sliding.length[count] = 0.0
    sliding.smooth[count], sliding.last_load[count] = sliding.threshold, sliding.load[count]
    sliding.load[count] = -surfaces.stiffness * weight * barrier_gradient(d, surfaces.d_hat)
    if p.restitution.exists:
        sliding.load[count] *= 1.0 - damping_at(p, stage, i, s, d)[0]
    from_point = row(at.pose_position, a) if a >= 0 else _on_curve(surfaces, at, node, mix)
    for c in range(3):
        touched = x[c] - radius * n[c]
        arm[c] = touched - from_point[c]
        sliding.normal[count, c], sliding.arm[count, c] = n[c], arm[c]
        sliding.lever[count, c] = touched - at.pose_position[b, c]
    if a < 0:
        if _lies_flat(surfaces, p.strands, stage, node, n, d, surfaces.near_length[k]):
            sliding.length[count] = surfaces.near_length[k]
        write_rate(surfaces, at, node, mix, arm, count, sliding.arm_rate)
    _write_axis(sliding, surfaces, at, count, i, s, node, n)
    return True, same


@piece(bool, Sliding, Problem, Configuration, Stage)
def freeze_surface_contacts(sliding, p, at, stage):
    """List the contacts at a configuration, with their normal forces, directions and arms; near pairs are those that
    the barrier listed. Returns whether they are the same as before.
    """
    for b in range(at.rotation.shape[0]):
        copy_matrix(at.rotation, b, sliding.back, b)
        product_transposed(stage.origin_rotation, b, sliding.back, b, sliding.origin_rotation, b)
    n, arm, count, same = stack_vector(3), stack_vector(3), 0, True
    for k in range(p.surfaces.near_count[0]):
        found, alike = freeze_contact(sliding, p, at, stage, k, count, n, arm)
        same &= alike
        count += found
    whole = count
    if sliding.spreads:
        count = _spread(sliding, p, at, stage, count)
        for k in range(whole, count):
            same &= sliding.same[k]
    same &= count == sliding.count[0]
    sliding.count[0], sliding.places[0] = count, count - whole
    return same


@kernel
def _project(sliding, k, x):
    """Make a vector tangential to the surface at a contact."""
    n = sliding.normal
    along = x[0] * n[k, 0] + x[1] * n[k, 1] + x[2] * n[k, 2]
    for c in range(3):
        x[c] -= along * n[k, c]


@kernel
def _edge_beside(surfaces, strands, i, part, side):
    """Return the edge on one side of a part of the edges at node i; −1 beyond the end of a rod."""
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    if part == 0.0 and before == after and (strands.edge_node[after] == i) == (side < 0):
        return -1
    return before if part < 0.0 or (part == 0.0 and side < 0) else after


@kernel
def _change(sliding, surfaces, strands, at, stage, k, e, change_out):
    """Write by how much slip changes along edge e, in the tangent plane of contact k [m], and return its size."""
    n, b, start = strands.edge_node[e], surfaces.body[sliding.surface[k]], stage.origin_position
    for c in range(3):
        change_out[c] = (at.position[n + 1, c] - start[n + 1, c]) - (at.position[n, c] - start[n, c])
        for d in range(3):
            turned = sliding.rotation[b, c, d] - sliding.origin_rotation[b, c, d]
            change_out[c] -= turned * (at.position[n + 1, d] - at.position[n, d])
    _project(sliding, k, change_out)
    return math.sqrt(change_out[0] ** 2 + change_out[1] ** 2 + change_out[2] ** 2)


@kernel
def _turns(slip, change, size, reach, stuck):
    """Return whether what is within a part `reach` of an edge from a contact slips less than `stuck`, or than from
    place to place.
    """
    along = first = 0.0
    for c in range(3):
        along += slip[c] * change[c]
        first += slip[c] * slip[c]
    part = min(max(-along / (size * size), min(reach, 0.0)), max(reach, 0.0))
    least = first + part * (2.0 * along + part * size * size)
    return least <= max(stuck * stuck, (size / PARTS) ** 2)


@kernel
def _spread(sliding, p, at, stage, count):
    """Spread contacts of rods by which slip has turned round over their stretches; return the number of contacts."""
    surfaces, strands, whole, step = p.surfaces, p.strands, count, stage.length
    most = sliding.load.shape[0] - surfaces.near_gap.shape[0]
    arm, lever, slip, change = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    stuck = sliding.threshold * step
    for b in range(at.rotation.shape[0]):
        product_transposed(at.rotation, b, sliding.back, b, sliding.rotation, b)
    for k in range(whole):
        if sliding.length[k] == 0.0:
            continue
        i, s, c = sliding.node[k], sliding.surface[k], sliding.part[k, 0]
        half, places = _stretch(sliding, surfaces, k)
        if count - whole + 2 * places > most:
            continue
        contact_slip(sliding, surfaces, strands, at, stage, k, arm, lever, slip)
        _project(sliding, k, slip)
        for side in range(-1, 2, 2):
            e = _edge_beside(surfaces, strands, i, c, side)
            if e < 0:
                continue
            size = _change(sliding, surfaces, strands, at, stage, k, e, change)
            if size > ALIKE * stuck:
                sliding.spread[s, i] |= _turns(slip, change, size, side * (half + BESIDE), stuck)
        if sliding.spread[s, i]:
            count = spread_contact(sliding, p, at, stage, k, count, arm, change)
    return count


@kernel
def _stretch(sliding, surfaces, k):
    """Return half the stretch of a contact as a part of an edge, all of it at an end, and how many places it has."""
    i, c = sliding.node[k], sliding.part[k, 0]
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    half = sliding.length[k] / (surfaces.edge_length[before] + surfaces.edge_length[after])
    if before == after and c == 0.0:
        half *= 2.0
    return half, int(math.ceil(PARTS * half - ROUNDING))


@kernel
def place_count(sliding, surfaces, strands, k):
    """Return how many places contact k has where it is spread."""
    count, places = 0, _stretch(sliding, surfaces, k)[1]
    for side in range(-1, 2, 2):
        if _edge_beside(surfaces, strands, sliding.node[k], sliding.part[k, 0], side) >= 0:
            count += places
    return count


@kernel
def spread_contact(sliding, p, at, stage, k, count, arm, change):
    """Spread contact k over its stretch, from contact `count` on; return the number of contacts. The last two are
    scratch.
    """
    surfaces, strands, step = p.surfaces, p.strands, stage.length
    i, c, load = sliding.node[k], sliding.part[k, 0], sliding.load[k]
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    both, ends = surfaces.edge_length[before] + surfaces.edge_length[after], before == after and c == 0.0
    half, places = _stretch(sliding, surfaces, k)
    for side in range(-1, 2, 2):
        e = _edge_beside(surfaces, strands, i, c, side)
        if e < 0:
            continue
        share = 1.0 if ends else surfaces.edge_length[e] / both if c == 0.0 else 0.5
        size = _change(sliding, surfaces, strands, at, stage, k, e, change)
        for place in range(places):
            _add_place(sliding, surfaces, at, k, c + side * half * (place + 0.5) / places, arm, count)
            sliding.load[count] = load * share / places
            sliding.smooth[count] = max(sliding.threshold, size * half / (places * step))
            count += 1
    sliding.load[k] = 0.0
    return count


@kernel
def _add_place(sliding, surfaces, at, k, part, arm, count):
    """Write the contact of a place of the stretch of contact k, at a part of an edge from its node; arm is scratch."""
    i, s, w = sliding.node[k], sliding.surface[k], sliding.part[k, 1]
    same = count < sliding.count[0] and sliding.first[count] == sliding.first[k] and sliding.surface[count] == s
    sliding.same[count] = same and sliding.part[count, 0] == part and sliding.part[count, 1] == w
    sliding.first[count], sliding.surface[count], sliding.node[count] = sliding.first[k], s, i
    sliding.part[count, 0], sliding.part[count, 1] = part, w
    sliding.last_load[count] = sliding.load[count]
    mix = min(part, 0.0), max(part, 0.0), 1.0 if part < 0.0 else 0.0, 0.0 if part < 0.0 else 1.0, 0.0, 0.0
    x, b = _on_curve(surfaces, at, i, mix), surfaces.body[s]
    for c in range(3):
        arm[c] = sliding.arm[k, c]
        sliding.arm[count, c] = arm[c]
        sliding.lever[count, c] = x[c] + arm[c] - at.pose_position[b, c]
        sliding.normal[count, c], sliding.axis[count, c] = sliding.normal[k, c], sliding.axis[k, c]
        sliding.mu[count, c] = sliding.mu[k, c]
    write_rate(surfaces, at, i, mix, arm, count, sliding.arm_rate)


@kernel
def _relax(sliding, same):
    """Relax normal forces that were frozen anew, by Aitken's acceleration."""
    before, relaxation, product, square = sliding.relaxation[0], 1.0, 0.0, 0.0
    count, load, last, change = sliding.count[0], sliding.load, sliding.last_load, sliding.change
    if same and before > 0.0:
        for k in range(count):
            difference = load[k] - last[k] - change[k]
            product += change[k] * difference
            square += difference * difference
        if square > 0.0:
            relaxation = min(max(-before * product / square, LEAST_RELAXATION), LARGEST_RELAXATION)
    for k in range(count):
        change[k] = load[k] - last[k]
        if same and relaxation != 1.0:
            load[k] = max(last[k] + relaxation * change[k], 0.0)
    sliding.relaxation[0] = relaxation if same else 0.0


@piece(int, Sliding, Problem, Configuration, Stage)
def start_surface_friction(sliding, p, start, stage):
    """Freeze the contacts at the start of a stage; returns a status."""
    if sliding.acts:
        sliding.spread[:, :] = False
        freeze_surface_contacts(sliding, p, start, stage)
        sliding.relaxation[0] = 0.0
    return READY


@piece(bool, Sliding, Problem, Configuration, Stage)
def settle_surface_friction(sliding, p, at, stage):
    """Freeze the contacts at a minimum of the potential; whether there are any, now or before."""
    if not sliding.acts:
        return False
    before = sliding.count[0]
    _relax(sliding, freeze_surface_contacts(sliding, p, at, stage))
    return before + sliding.count[0] > 0
