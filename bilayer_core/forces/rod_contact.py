"""Barrier and friction between rods: points of one against the segments of another, or of a distant part of itself.

Contacts come from `contact.segment`, with D, t and n the distance, the fraction on the segment (j, j+1) and the unit
vector from there to the point p = (1 − s) x_i + s x_{i+1}. With the four nodes x_m = x_i, x_{i+1}, x_j, x_{j+1} and
their weights w = (1 − s, s, −(1 − t), −t), the vector between the two is r = Σ w_m x_m.

**Barrier**

    C = ± ½ K_c b(d) Δl,   d = D − r_p − r_segment        (Δl: the length of rod that p stands for)

as for surfaces (`forces.contact`). Both rods have points, so the contact of two parallel rods is counted from either
side, half each: K_c b per length, on any pair of meshes. With e the segment, u its direction and v = n × u,

    ∂D/∂x_m = w_m n                                                        (t is the minimum: its change does not count)
    ∂²D/∂x_m ∂x_l = [w_m w_l (I − n nᵀ) − a_m a_lᵀ]/D,   a_m = w_m u + (D/|e|) β_m n,   β = (0, 0, −1, 1)

where the second part, of the change δt = (e·δr + D n·δe)/|e|², is there if t lies within the segment, and a = 0 at a
node. So each contact adds

    w_m w_l M − κ a_m a_lᵀ,   M = c b″ n nᵀ + κ (I − n nᵀ),   κ = c b′/D ≤ 0,   c = ± ½ K_c Δl.

κ is the tendency of two round things that are pressed together to slip off each other; along v, across both, nothing
holds a pair of straight rods but friction. That is so for threads. The faces of ribbons are flat, and the width is not
seen here.

**Friction** is lagged as in `forces.friction`: s, t, n and λ = −c b′ are those at the start of the step, and

    slip g = (I − n nᵀ) Σ w_m (x_m − x_m⁰),   D = μ λ h f₀(|g|/h),   force ∓ μ λ f₁ g/|g|, shared out with w_m

The two forces are equal and opposite. They act on the two centrelines, a distance D apart along n, so a couple of D
times the friction remains: rods have no moment about their tangent from friction on their faces.
"""

from __future__ import annotations

import math

from ..contact.barrier import barrier, barrier_gradient, barrier_hessian
from ..contact.friction_law import friction_over_speed, friction_potential, friction_slope
from ..jit import kernel
from ..jit.stack import stack_vector


@kernel
def rod_barrier(
    d_hat,
    stiffness,
    position,
    contact_count,
    point,
    edge,
    fraction,
    inner,
    times,
    gap,
    edge_node,
    edge_radius,
    point_edge,
    point_fraction,
    point_weight,
    gradient_out,
    node_out,
    weight_out,
    normal_out,
    load_out,
    matrix_out,
    side_out,
    turn_out,
    lean_out,
    along_out,
):
    """Add the barrier of contacts and return its energy [J], infinite if a gap is closed.

    Parameters
    ----------
    d_hat, stiffness : float
        d̂ [m] and K_c [Pa].
    position : Array
        Of nodes [m], shape (n_node, 3).
    contact_count, point, edge, fraction, inner, times, gap
        From `contact.segment.facing_contacts`.
    edge_node, edge_radius, point_edge, point_fraction, point_weight
        See `model.rod_surfaces`.
    gradient_out : Array
        Of nodes [N], shape (≥ n_node, 3); added to.
    node_out, weight_out : Array
        Written: i and j, and w_m, of each contact, shapes (·, 2), (·, 4).
    normal_out, load_out : Array
        Written: n, shape (·, 3), and λ [N].
    matrix_out, side_out, turn_out : Array
        Written: M, κ (0 at a node) and a_m, shapes (·, 3, 3), (·,), (·, 4, 3).
    lean_out, along_out : Array
        Written: κ (at nodes, too) and u, shapes (·,), (·, 3).
    """
    energy = 0.0
    for c in range(contact_count):
        d = gap[c]
        if d <= 0.0:
            return math.inf
        p, k = point[c], edge[c]
        a = point_edge[p]
        i, j, s, t = edge_node[a], edge_node[k], point_fraction[p], fraction[c]
        node_out[c, 0], node_out[c, 1] = i, j
        w0, w1, w2, w3 = 1.0 - s, s, t - 1.0, -t
        weight_out[c, 0], weight_out[c, 1], weight_out[c, 2], weight_out[c, 3] = w0, w1, w2, w3
        distance = d + edge_radius[a] + edge_radius[k]
        scale = 0.5 * times[c] * stiffness * point_weight[p]
        energy += scale * barrier(d, d_hat)
        slope = scale * barrier_gradient(d, d_hat)
        curve = scale * barrier_hessian(d, d_hat)
        side = slope / distance
        load_out[c] = -slope
        lean_out[c] = side
        side_out[c] = side if inner[c] else 0.0
        size = 0.0
        for m in range(3):
            normal_out[c, m] = (
                w0 * position[i, m] + w1 * position[i + 1, m] + w2 * position[j, m] + w3 * position[j + 1, m]
            ) / distance
            force = slope * normal_out[c, m]
            gradient_out[i, m] += w0 * force
            gradient_out[i + 1, m] += w1 * force
            gradient_out[j, m] += w2 * force
            gradient_out[j + 1, m] += w3 * force
            size += (position[j + 1, m] - position[j, m]) ** 2
        size = math.sqrt(size)
        for m in range(3):
            for n in range(3):
                matrix_out[c, m, n] = (curve - side) * normal_out[c, m] * normal_out[c, n]
            matrix_out[c, m, m] += side
            along = (position[j + 1, m] - position[j, m]) / size
            along_out[c, m] = along
            across = distance / size * normal_out[c, m]
            turn_out[c, 0, m] = w0 * along
            turn_out[c, 1, m] = w1 * along
            turn_out[c, 2, m] = w2 * along - across
            turn_out[c, 3, m] = w3 * along + across
    return energy


@kernel
def rod_friction(
    coefficient,
    threshold,
    step_length,
    position,
    origin_position,
    contact_count,
    node,
    weight,
    normal,
    load,
    gradient_out,
    matrix_out,
):
    """Add the dissipation potential of lagged contacts and return it [J].

    Parameters
    ----------
    coefficient, threshold, step_length : float
        μ, ε_v [m/s], h [s].
    position, origin_position : Array
        Of nodes now and where their velocity is counted from [m], shape (≥ n_node, 3).
    contact_count, node, weight, normal, load
        As `rod_barrier` wrote them at the start of the step.
    gradient_out : Array
        Of nodes [N]; added to.
    matrix_out : Array
        Written: M of each contact, shape (·, 3, 3).
    """
    energy = 0.0
    for c in range(contact_count):
        i, j = node[c, 0], node[c, 1]
        n0, n1, n2 = normal[c, 0], normal[c, 1], normal[c, 2]
        w0, w1, w2, w3 = weight[c, 0], weight[c, 1], weight[c, 2], weight[c, 3]
        g0, g1, g2 = 0.0, 0.0, 0.0
        for m in range(3):
            moved = (
                w0 * (position[i, m] - origin_position[i, m])
                + w1 * (position[i + 1, m] - origin_position[i + 1, m])
                + w2 * (position[j, m] - origin_position[j, m])
                + w3 * (position[j + 1, m] - origin_position[j + 1, m])
            )
            if m == 0:
                g0 = moved
            elif m == 1:
                g1 = moved
            else:
                g2 = moved
        along = g0 * n0 + g1 * n1 + g2 * n2
        g0, g1, g2 = g0 - along * n0, g1 - along * n1, g2 - along * n2
        speed = math.sqrt(g0 * g0 + g1 * g1 + g2 * g2) / step_length
        limit = coefficient * load[c]
        energy += limit * step_length * friction_potential(speed, threshold)
        ratio = limit * friction_over_speed(speed, threshold) / step_length
        excess = 0.0
        if speed > 0.0:
            bend = friction_slope(speed, threshold) - friction_over_speed(speed, threshold)
            excess = limit * bend / (speed * speed * step_length**3)
        for m in range(3):
            nm = n0 if m == 0 else (n1 if m == 1 else n2)
            gm = g0 if m == 0 else (g1 if m == 1 else g2)
            gradient_out[i, m] += w0 * ratio * gm
            gradient_out[i + 1, m] += w1 * ratio * gm
            gradient_out[j, m] += w2 * ratio * gm
            gradient_out[j + 1, m] += w3 * ratio * gm
            matrix_out[c, m, 0] = excess * gm * g0 - ratio * nm * n0
            matrix_out[c, m, 1] = excess * gm * g1 - ratio * nm * n1
            matrix_out[c, m, 2] = excess * gm * g2 - ratio * nm * n2
            matrix_out[c, m, m] += ratio
    return energy


@kernel
def rod_slip_along(
    coefficient,
    step_length,
    position,
    origin_position,
    contact_count,
    node,
    weight,
    normal,
    load,
    node_step,
    begin,
    way_out,
):
    """Write the way of every lagged contact in a Newton step, see `forces.slip`: a is the direction of the slip.

    Parameters
    ----------
    coefficient … load
        As for `rod_friction`.
    node_step : Array
        Displacement of nodes [m], shape (n_node, 3).
    begin : int
        Row of the first contact.
    way_out : Array
        Written: shape (≥ begin + contact_count, `slip.WAY`).
    """
    slip, rate = stack_vector(3), stack_vector(3)
    for c in range(contact_count):
        i, j = node[c, 0], node[c, 1]
        w0, w1, w2, w3 = weight[c, 0], weight[c, 1], weight[c, 2], weight[c, 3]
        of_slip, of_rate = 0.0, 0.0
        for m in range(3):
            rate[m] = w0 * node_step[i, m] + w1 * node_step[i + 1, m] + w2 * node_step[j, m] + w3 * node_step[j + 1, m]
            slip[m] = (
                w0 * (position[i, m] - origin_position[i, m])
                + w1 * (position[i + 1, m] - origin_position[i + 1, m])
                + w2 * (position[j, m] - origin_position[j, m])
                + w3 * (position[j + 1, m] - origin_position[j + 1, m])
            )
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
        way_out[k, 0], way_out[k, 1] = size, along
        way_out[k, 2], way_out[k, 3] = 0.0, math.sqrt(max(total - along * along, 0.0))
        way_out[k, 4] = way_out[k, 5] = way_out[k, 6] = coefficient * coefficient
        way_out[k, 7], way_out[k, 8] = load[c], coefficient * step_length
