"""Barrier and friction between rods: points of one against the segments of another, or of a distant part of itself.

Contacts come from `contact.segment`, with D, t and n the distance, the fraction on the segment (j, j+1) and the unit
vector from there to the point p = (1 − s) x_i + s x_{i+1}. With the four nodes x_m = x_i, x_{i+1}, x_j, x_{j+1} and
their weights w = (1 − s, s, −(1 − t), −t), the vector between the two is r = Σ w_m x_m.

**Barrier**

    C = ± ½ K_c b(d) Δl,   d = D − r_p − r_segment        (Δl: the length of rod that p stands for)

as for surfaces (`forces.surface_barrier`). Where layers differ, the x are those of rails, in the middle between the
faces (`contact.rails`), and what follows are derivatives by these; `forces.rail_arms` hands them on to nodes and edges.
Both rods have points, so the contact of two parallel rods is counted from either side, half each: K_c b per length, on
any pair of meshes. With e the segment, u its direction and v = n × u,

    ∂D/∂x_m = w_m n                                                        (t is the minimum: its change does not count)
    ∂²D/∂x_m ∂x_l = [w_m w_l (I − n nᵀ) − a_m a_lᵀ]/D,   a_m = w_m u + (D/|e|) β_m n,   β = (0, 0, −1, 1)

where a_m = |e| ∂t/∂x_m: the second part, of the change δt = (e·δr + D n·δe)/|e|², is there if t lies within the
segment, and a = 0 at a node. So each contact adds

    w_m w_l M − κ a_m a_lᵀ,   M = c b″ n nᵀ + κ (I − n nᵀ),   κ = c b′/D ≤ 0,   c = ± ½ K_c Δl.

κ is the tendency of two round things that are pressed together to slip off each other; along v, across both, nothing
holds a pair of straight rods but friction.

**Ribbons** have facets Q(t, v) of four rails, and points between four (`contact.facet`): eight x_m with weights w_m.
With e = ∂Q/∂t, f = ∂Q/∂v, g = e·f − D n·∂²Q/∂t∂v, and β_m, γ_m the rates of −w_m with t and v,

    ∂²D/∂x_m ∂x_l = [w_m w_l (I − n nᵀ) − a_m a_lᵀ − c_m c_lᵀ]/D

    a_m = (w_m e + D β_m n)/|e|,   c_m = (w_m f + D γ_m n − g/|e| a_m)/√(|f|² − g²/|e|²)

where a is left out if t is that of an end (and then g), and c if v is that of a border.

**Friction** is lagged as in `forces.surface_friction`: s, t, n and λ = −c b′ are those at the start of the step, and

    slip g = (I − n nᵀ) [Σ w_m (x_m − x_m⁰) + ω_p × A_p − ω × A],   D = μ λ h f₀(|g|/h),   force ∓ μ λ f₁ g/|g|

of the two material points that are in the middle of the gap, at A_p = −(r_p + ½ d) n from the point and at A =
(r_segment + ½ d) n from what it faces. Each turns with its edge, by ω = t × ε/l + θ t for an increment (ε, θ) of an
edge of length l with the tangent t:

    ω × A = [(t·A) ε − (A·ε) t]/l + θ t × A

These rates, as those of rails, are frozen too, so that the slip is linear in the unknowns. The two forces are equal and
opposite at one place, so that there is no couple.

What is computed does not depend on the list of near pairs, which holds all contacts at any time, always in the same
order; see `contact.rod_list`.
"""

from __future__ import annotations

import math

from bilayer_core.contact.barrier import barrier, barrier_gradient, barrier_hessian
from bilayer_core.contact.broad_phase import near_pairs
from bilayer_core.contact.friction_law import friction_over_speed, friction_potential, friction_slope
from bilayer_core.contact.rails import most_of_swing, place_rails, write_rail_steps
from bilayer_core.contact.rod_bound import path_to_look_at, rod_step_bound
from bilayer_core.contact.rod_list import (
    FIRST,
    LEFT,
    PATH,
    begin_list,
    end_list,
    largest_motion,
    list_serves,
    reachable,
)
from bilayer_core.contact.segment import facing_contacts
from bilayer_core.forces.rail_arms import (
    hand_on,
    note_rails,
    write_rail_curvature,
    write_rail_motions,
    write_rail_rates,
    write_rail_slips,
)
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_vector
from bilayer_core.jit.record import Matrix
from bilayer_core.kinematics.vector import cross, dot, row
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.contacts import RodContact
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY, ROD_CAPACITY_EXCEEDED
from bilayer_core.model.records.step import Configuration, Stage

ROD_BARRIER, ROD_FRICTION = map(slot_of, ("rod barrier", "rod friction"))


@piece(bool, Problem, Matrix, Matrix, float, float, float)
def list_near_rods(p, position, step, fraction, move, stray):
    """Make a list of near pairs for a part of a step of rails from `position`, in which they move by `move` [m] and
    stray by `stray` [m] from a straight way; false if there is no capacity for it.
    """
    rods = p.rod_contact
    if list_serves(rods, position, step, fraction, move, stray):
        return True
    margin = begin_list(rods, position, step, fraction, move, stray)
    near_pairs(rods.search, rods.d_hat, rods.d_hat + margin)
    return end_list(rods)


@piece(bool, Problem, Configuration)
def find_rod_contacts(p, at):
    """Find where rods are nearer to each other than the barrier distance; false if there is no capacity for that."""
    rods, place = p.rod_contact, at.position
    if rods.rails.exists:
        place_rails(rods.rails, at)
        place = rods.rails.place
    if not list_near_rods(p, place, rods.no_step, 0.0, 0.0, 0.0):
        return False
    found, gap = rods.contacts.count, math.inf
    found[0] = 0
    if rods.ways[PATH] >= rods.ways[FIRST]:
        found[0], gap, rods.ways[FIRST] = facing_contacts(rods, place, rods.ways[PATH])
    rods.gap[0] = gap
    if found[0] > rods.contacts.point.shape[0]:
        return False
    if rods.rails.exists and found[0] > 0:
        note_rails(rods.rails, rods.contacts, rods.rails.meets)
        write_rail_rates(rods.rails, p.strands, at, rods.rails.meets, rods.rails.rate)
    return True


@piece(float, Problem, Configuration)
def bound_between_rods(p, at):
    """Return the largest fraction of `System.node_step` that keeps rods apart; the status is left in `Outcome`."""
    rods, step, outcome = p.rod_contact, p.system.node_step, p.outcome
    outcome.status = READY
    rails, place = rods.rails, at.position
    move, limit, swing, stray = largest_motion(step), 1.0, 0.0, 0.0
    if rails.exists:
        limit, swing = most_of_swing(rails, p.strands, p.system, at)
        move += 2.0 * swing  # the mean of all taken off
    limit = reachable(move, limit, rods.unit)
    serves = limit * move <= rods.ways[LEFT]  # whatever the ways
    if serves and path_to_look_at(rods, 2.0 * limit * move) < rods.ways[FIRST]:
        return limit
    if rails.exists:
        place_rails(rails, at)
        place = rails.place
    if rails.exists and not serves:
        write_rail_steps(rails, p.strands, p.system, at, limit)
        step, stray = rails.step, 0.5 * limit * swing
    if not serves and not list_near_rods(p, place, step, limit, limit * move, stray):
        outcome.status = ROD_CAPACITY_EXCEEDED
        return 0.0
    return rod_step_bound(rods, p.strands, p.system, at, place, limit, 2.0 * limit * move)


@piece(int, RodContact, Problem, Configuration, Stage)
def start_rod_barrier(rods, p, start, stage):
    """Find the contacts at the start of a stage."""
    return READY if find_rod_contacts(p, start) else ROD_CAPACITY_EXCEEDED


@kernel
def _freeze(rods, at):
    """Freeze the contacts found last for friction."""
    found, sliding, radius = rods.contacts, rods.sliding, rods.search.edge_radius
    sliding.count[0] = found.count[0] if rods.slides else 0
    for c in range(sliding.count[0]):
        scale = 0.5 * found.multiplicity[c] * rods.stiffness * rods.point_weight[found.point[c]]
        sliding.normal_force[c] = -scale * barrier_gradient(found.gap[c], rods.d_hat)
        sliding.node[c, 0], sliding.node[c, 1] = found.node[c, 0], found.node[c, 1]
        sliding.right[c, 0], sliding.right[c, 1] = found.right[c, 0], found.right[c, 1]
        for m in range(3):
            sliding.normal[c, m] = found.normal[c, m]
        for side in range(2):
            e = found.edge[c, side]
            sliding.edge[c, side] = e
            _write_turn(sliding.turn, at, c, side, e, -radius[e] - 0.5 * found.gap[c], row(found.normal, c))
        for m in range(found.weight.shape[1]):
            sliding.weight[c, m] = found.weight[c, m]


@kernel
def _write_turn(turn_out, at, c, side, e, arm, n):
    """Write how A = arm n of the point, or −A of what it faces, moves by the vector and turn of edge e."""
    t, length = row(at.tangent, e), at.length[e]
    turned, along = cross(t, n), dot(t, n)
    for m in range(3):
        for d in range(3):
            turn_out[c, 3 * side + m, d] = -arm * t[m] * n[d] / length
        turn_out[c, 3 * side + m, m] += arm * along / length
        turn_out[c, 3 * side + m, 3] = arm * turned[m]


@kernel
def _freeze_at(rods, strands, at):
    """Freeze contacts, and the rates of rails, for friction."""
    _freeze(rods, at)
    if rods.rails.exists and rods.sliding.count[0] > 0:
        note_rails(rods.rails, rods.sliding, rods.rails.rubs)
        write_rail_rates(rods.rails, strands, at, rods.rails.rubs, rods.rails.slip_rate)


@piece(int, RodContact, Problem, Configuration, Stage)
def start_rod_friction(rods, p, start, stage):
    """Freeze the contacts of friction at the start of a stage, which were found before."""
    _freeze_at(rods, p.strands, start)
    return READY


@piece(bool, RodContact, Problem, Configuration, Stage)
def settle_rod_friction(rods, p, at, stage):
    """Freeze the contacts of friction at a minimum; whether there are any, now or before."""
    before = rods.sliding.count[0]
    _freeze_at(rods, p.strands, at)
    return before + rods.sliding.count[0] > 0


@piece(float, RodContact, Problem, Configuration, Stage, bool)
def add_rod_barrier(rods, p, at, stage, with_hessian):
    """Add the barrier at the contacts found last; returns the smallest gap below the barrier distance [m]."""
    sums = p.sums
    if rods.contacts.count[0] > 0 and sums.selected[ROD_BARRIER]:
        rails = rods.rails
        if not rails.exists:
            sums.energy[ROD_BARRIER] = _add_barrier(rods, at.position, sums.contact_point)
        else:
            rails.gradient[:] = 0.0
            sums.energy[ROD_BARRIER] = _add_barrier(rods, rails.place, rails.gradient)
            hand_on(rails, p.strands, rails.gradient, rails.rate, sums.contact_point, sums.edge)
            if with_hessian:
                write_rail_curvature(rails, p.strands, at)
    return rods.gap[0]


@piece(float, RodContact, Problem, Configuration, Stage, bool)
def add_rod_friction(rods, p, at, stage, with_hessian):
    """Add the friction at the contacts frozen last; returns infinity, as it knows no gap."""
    sums, energy, lost = p.sums, 0.0, 0.0
    if rods.sliding.count[0] > 0 and sums.selected[ROD_FRICTION]:
        rails = rods.rails
        if not rails.exists:
            place, origin, drag = at.position, stage.origin_position, sums.contact_point
        else:
            rails.drag[:] = 0.0
            write_rail_slips(rails, p.strands, stage, at)
            place, origin, drag = rails.slip, rods.no_step, rails.drag
        energy, lost = _add_friction(rods, p.strands, stage, at, place, origin, drag, sums.edge)
        if rails.exists:
            hand_on(rails, p.strands, rails.drag, rails.slip_rate, sums.contact_point, sums.edge)
    sums.energy[ROD_FRICTION], sums.lost[ROD_FRICTION] = energy, lost
    return math.inf


@kernel
def rods_touch(rods):
    """Return whether any contacts of rods were found."""
    return rods.exists and rods.contacts.count[0] > 0


@kernel
def _add_barrier(rods, position, gradient):
    """Add the gradient of the contacts found last, write their second derivatives, and return their energy [J],
    infinite if a gap is closed.
    """
    contacts, d_hat, energy = rods.contacts, rods.d_hat, 0.0
    node, weight, normal, matrix = contacts.node, contacts.weight, contacts.normal, contacts.matrix
    direction, foot_gradient = contacts.segment_direction, contacts.foot_gradient
    for c in range(contacts.count[0]):
        d, distance = contacts.gap[c], contacts.distance[c]
        if d <= 0.0:
            return math.inf
        i, j = node[c, 0], node[c, 1]
        w0, w1, w2, w3 = weight[c, 0], weight[c, 1], weight[c, 2], weight[c, 3]
        scale = 0.5 * contacts.multiplicity[c] * rods.stiffness * rods.point_weight[contacts.point[c]]
        energy += scale * barrier(d, d_hat)
        slope = scale * barrier_gradient(d, d_hat)
        contacts.normal_force[c] = -slope
        curvature = scale * barrier_hessian(d, d_hat)
        tangential = slope / distance
        contacts.tangential_stiffness[c] = tangential
        square = 0.0
        for m in range(3):
            force = slope * normal[c, m]
            gradient[i, m] += w0 * force
            gradient[i + 1, m] += w1 * force
            gradient[j, m] += w2 * force
            gradient[j + 1, m] += w3 * force
            if weight.shape[1] > 4:
                _add_to_borders(contacts, c, m, force, gradient)
            square += (position[j + 1, m] - position[j, m]) ** 2
        length = math.sqrt(square)
        for m in range(3):
            for n in range(3):
                matrix[c, m, n] = (curvature - tangential) * normal[c, m] * normal[c, n]
            matrix[c, m, m] += tangential
            along = (position[j + 1, m] - position[j, m]) / length
            direction[c, m] = along
            across = distance / length * normal[c, m]
            foot_gradient[c, 0, m] = w0 * along
            foot_gradient[c, 1, m] = w1 * along
            foot_gradient[c, 2, m] = w2 * along - across
            foot_gradient[c, 3, m] = w3 * along + across
        if weight.shape[1] > 4:
            _write_feet(contacts, position, c)
    return energy


@kernel
def _add_to_borders(contacts, c, m, force, gradient):
    """Add component m of what acts on a contact to the right borders of its two sides."""
    for side in range(2):
        r = contacts.right[c, side]
        if r >= 0:
            gradient[r, m] += contacts.weight[c, 4 + 2 * side] * force
            gradient[r + 1, m] += contacts.weight[c, 5 + 2 * side] * force


@kernel
def _write_feet(contacts, position, c):
    """Write the gradients of the nearest place on a facet, and the direction along it."""
    t, v = contacts.place[c, 0], contacts.place[c, 1]
    along_out, across_out = contacts.foot_gradient, contacts.cross_gradient
    j, r = contacts.node[c, 1], contacts.right[c, 1]
    for n in range(8):
        for m in range(3):
            across_out[c, n, m] = 0.0
            if n > 3 or r >= 0:
                along_out[c, n, m] = 0.0
    if r < 0:  # the foot is that on a segment: its weights are those of the point's four rails
        if contacts.inner[c]:
            for m in range(3):
                for n in range(2):
                    along_out[c, 4 + n, m] = contacts.weight[c, 4 + n] * contacts.segment_direction[c, m]
        return
    e, f, turned, away = stack_vector(3), stack_vector(3), stack_vector(3), stack_vector(3)
    tt, vv, tv = 0.0, 0.0, 0.0
    for m in range(3):
        l0, l1, r0, r1 = position[j, m], position[j + 1, m], position[r, m], position[r + 1, m]
        e[m], f[m] = (1.0 - v) * (l1 - l0) + v * (r1 - r0), (1.0 - t) * (r0 - l0) + t * (r1 - l1)
        turned[m], away[m] = l0 - l1 - r0 + r1, contacts.distance[c] * contacts.normal[c, m]
        tt, vv = tt + e[m] * e[m], vv + f[m] * f[m]
        tv += e[m] * f[m] - away[m] * turned[m]
    inner, free = contacts.inner[c], 0.0 < v < 1.0
    over, length = (tv / tt, math.sqrt(tt)) if inner else (0.0, math.sqrt(tt))
    rest = vv - over * tv
    for n in range(8):
        left = 1.0 if n < 4 else 0.0  # of two borders
        end = n % 2
        of_b = 2 <= n < 4 or n >= 6
        by_t = (1.0 if end == 1 else -1.0) * ((1.0 - v) if left == 1.0 else v) if of_b else 0.0
        by_v = (-1.0 if left == 1.0 else 1.0) * (t if end == 1 else 1.0 - t) if of_b else 0.0
        for m in range(3):
            first = contacts.weight[c, n] * e[m] + by_t * away[m]
            second = contacts.weight[c, n] * f[m] + by_v * away[m]
            if inner:
                along_out[c, n, m] = first / length
            if free and rest > 0.0:
                across_out[c, n, m] = (second - over * first) / math.sqrt(rest)
    for m in range(3):
        contacts.segment_direction[c, m] = e[m] / length


@kernel
def _moved(vectors, origin, contacts, c, m):
    """Return the component m of Σ w_m (x_m − x_m⁰) at a contact [m]."""
    i, j, weight = contacts.node[c, 0], contacts.node[c, 1], contacts.weight
    moved = (
        weight[c, 0] * (vectors[i, m] - origin[i, m])
        + weight[c, 1] * (vectors[i + 1, m] - origin[i + 1, m])
        + weight[c, 2] * (vectors[j, m] - origin[j, m])
        + weight[c, 3] * (vectors[j + 1, m] - origin[j + 1, m])
    )
    if weight.shape[1] > 4:
        for side in range(2):
            r = contacts.right[c, side]
            if r >= 0:
                moved += weight[c, 4 + 2 * side] * (vectors[r, m] - origin[r, m])
                moved += weight[c, 5 + 2 * side] * (vectors[r + 1, m] - origin[r + 1, m])
    return moved


@kernel
def moved_between(vectors, contacts, c, m):
    """Return the component m of Σ w_m v_m at a contact."""
    i, j, weight = contacts.node[c, 0], contacts.node[c, 1], contacts.weight
    moved = weight[c, 0] * vectors[i, m] + weight[c, 1] * vectors[i + 1, m]
    moved += weight[c, 2] * vectors[j, m] + weight[c, 3] * vectors[j + 1, m]
    if weight.shape[1] > 4:
        for side in range(2):
            r = contacts.right[c, side]
            if r >= 0:
                moved += weight[c, 4 + 2 * side] * vectors[r, m] + weight[c, 5 + 2 * side] * vectors[r + 1, m]
    return moved


@kernel
def _add_turned(contacts, c, side, ahead, behind, ahead_before, behind_before, angle, out):
    """Add what friction's place on a side moves by with its edge, whose ends moved from places before to others, and
    which turned by an angle.
    """
    for m in range(3):
        moved = angle * contacts.turn[c, 3 * side + m, 3]
        for d in range(3):
            vector = (ahead[d] - ahead_before[d]) - (behind[d] - behind_before[d])
            moved += vector * contacts.turn[c, 3 * side + m, d]
        out[m] += moved


@kernel
def _turned_since(contacts, strands, stage, at, c, out):
    """Add what friction's places have moved by with their edges since the origin of a stage [m]."""
    x, before = at.position, stage.origin_position
    for side in range(2):
        e = contacts.edge[c, side]
        i, angle = strands.edge_node[e], at.total_angle[e] - stage.origin_angle[e]
        ends = row(x, i + 1), row(x, i), row(before, i + 1), row(before, i)
        _add_turned(contacts, c, side, ends[0], ends[1], ends[2], ends[3], angle, out)


@kernel
def _add_friction(rods, strands, stage, at, position, origin, gradient, edge_gradient):
    """Add the gradient of the dissipation potential of lagged contacts, write its second derivatives, and return it
    [J] and the power that is lost [W].
    """
    contacts, h, threshold, energy, lost = rods.sliding, stage.length, rods.threshold, 0.0, 0.0
    weight, normal, matrix = contacts.weight, contacts.normal, contacts.matrix
    slip = stack_vector(3)
    for c in range(contacts.count[0]):
        i, j = contacts.node[c, 0], contacts.node[c, 1]
        along, square = 0.0, 0.0
        for m in range(3):
            slip[m] = _moved(position, origin, contacts, c, m)
        _turned_since(contacts, strands, stage, at, c, slip)
        for m in range(3):
            along += slip[m] * normal[c, m]
        for m in range(3):
            slip[m] -= along * normal[c, m]
            square += slip[m] * slip[m]
        speed = math.sqrt(square) / h
        limit = rods.coefficient[rods.rod[i], rods.rod[j]] * contacts.normal_force[c]
        energy += limit * h * friction_potential(speed, threshold)
        over_speed = friction_over_speed(speed, threshold)
        ratio, excess = limit * over_speed / h, 0.0
        lost += ratio * square / h
        if speed > 0.0:
            excess = limit * (friction_slope(speed, threshold) - over_speed) / (speed * speed * h**3)
        for m in range(3):
            gradient[i, m] += weight[c, 0] * ratio * slip[m]
            gradient[i + 1, m] += weight[c, 1] * ratio * slip[m]
            gradient[j, m] += weight[c, 2] * ratio * slip[m]
            gradient[j + 1, m] += weight[c, 3] * ratio * slip[m]
            if weight.shape[1] > 4:
                _add_to_borders(contacts, c, m, ratio * slip[m], gradient)
            for side in range(2):
                for n in range(4):
                    edge_gradient[contacts.edge[c, side], n] += contacts.turn[c, 3 * side + m, n] * ratio * slip[m]
            for n in range(3):
                matrix[c, m, n] = excess * slip[m] * slip[n] - ratio * normal[c, m] * normal[c, n]
            matrix[c, m, m] += ratio
    return energy, lost


@kernel
def rod_slip_along(rods, strands, stage, at, system, begin, path_out):
    """Write the slip path of every lagged contact in a Newton step (`forces.friction_limit`); a is along the slip.

    Parameters
    ----------
    rods : RodContact
    strands : Strands
    stage : Stage
    at : Configuration
    system : System
        With the step.
    begin : int
        Row of the first contact.
    path_out : Array
        Written: shape (≥ begin + number of contacts, `friction_limit.PATH_SIZE`).

    Returns
    -------
    end : int
        Row after the last contact.
    """
    contacts, rails, step, angle = rods.sliding, rods.rails, system.node_step, system.angle_step
    position, origin, node_step, still = at.position, stage.origin_position, step, (0.0, 0.0, 0.0)
    if rails.exists and contacts.count[0] > 0:
        write_rail_slips(rails, strands, stage, at)
        turned = system.angle_step
        write_rail_motions(rails, strands, rails.rubs, rails.slip_rate, system.node_step, turned, rails.motion)
        position, origin, node_step = rails.slip, rods.no_step, rails.motion
    normal = contacts.normal
    slip, rate = stack_vector(3), stack_vector(3)
    for c in range(contacts.count[0]):
        of_slip, of_rate = 0.0, 0.0
        for m in range(3):
            slip[m] = _moved(position, origin, contacts, c, m)
            rate[m] = moved_between(node_step, contacts, c, m)
        _turned_since(contacts, strands, stage, at, c, slip)
        for side in range(2):
            e = contacts.edge[c, side]
            i = strands.edge_node[e]
            _add_turned(contacts, c, side, row(step, i + 1), row(step, i), still, still, angle[e], rate)
        for m in range(3):
            of_slip += slip[m] * normal[c, m]
            of_rate += rate[m] * normal[c, m]
        square, together, total = 0.0, 0.0, 0.0
        for m in range(3):
            slip[m] -= of_slip * normal[c, m]
            rate[m] -= of_rate * normal[c, m]
            square += slip[m] * slip[m]
            together += slip[m] * rate[m]
            total += rate[m] * rate[m]
        size, k = math.sqrt(square), begin + c
        along = together / size if size > 0.0 else math.sqrt(total)
        path_out[k, 0], path_out[k, 1] = size, along
        path_out[k, 2], path_out[k, 3] = 0.0, math.sqrt(max(total - along * along, 0.0))
        mu = rods.coefficient[rods.rod[contacts.node[c, 0]], rods.rod[contacts.node[c, 1]]]
        path_out[k, 4] = path_out[k, 5] = path_out[k, 6] = mu * mu
        path_out[k, 7] = contacts.normal_force[c] if mu > 0.0 else 0.0
        path_out[k, 8] = (mu if mu > 0.0 else 1.0) * stage.length
        path_out[k, 9] = rods.threshold
    return begin + contacts.count[0]
