"""Powers at the end of a stage: what is supplied, what is lost, and what barriers take up."""

from __future__ import annotations

from bilayer_core.contact.barrier import barrier_gradient
from bilayer_core.contact.gap import gap_normal, place_of
from bilayer_core.forces.bend_twist import bend_by_strains
from bilayer_core.forces.elements import multiple_of_edge, multiple_of_joint
from bilayer_core.forces.flattening import pull_of_rest
from bilayer_core.forces.moduli import pull_of_moduli
from bilayer_core.forces.rail_arms import write_rail_motions
from bilayer_core.forces.rod_arms import add_step_of_arm, write_material_rate
from bilayer_core.forces.rod_contact import moved_between
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.kinematics.rotating import inertia_tensor, solve_three
from bilayer_core.kinematics.vector import cross, dot, row
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, StageInputs, Work

BY_BODIES, BY_FLOW = 1, 2
"""What drives a step: prescribed bodies alone, or a flow or followers too, of which T + V has no lowest value."""
BARRIER, ROD_BARRIER = map(slot_of, ("barrier", "rod barrier"))


@kernel
def write_forces_of_laws(p, at, stage, force_out):
    """Write −∂V/∂η of each law [J] at a configuration, with the rest strains of the stage."""
    strands, drives, off_axis = p.strands, p.drives, p.off_axis
    force_out[:] = 0.0
    for k in range(drives.driven_edge.shape[0]):
        e, weight = drives.driven_edge[k], drives.driven_weight[k]
        strain = at.length[e] / strands.rest_length[e] - 1.0 - stage.rest_edge[e]
        stiffness = multiple_of_edge(p, stage, e) * strands.axial_stiffness[e]
        force_out[drives.driven_law[k]] += weight * stiffness * strain * strands.rest_length[e]
    bends = drives.driven_joint.shape[0] > 0 and off_axis.exists
    if bends:
        bend_by_strains(off_axis, strands, at, stage.rest_joint)
    if p.flattening.exists:
        pull_of_rest(p, at, stage)
    if p.moduli.exists:
        pull_of_moduli(p, at, stage)
    for k in range(drives.driven_joint.shape[0]):
        j, column = drives.driven_joint[k], drives.driven_joint_column[k]
        if p.moduli.exists and j >= p.moduli.first:
            force_out[drives.driven_joint_law[k]] -= drives.driven_joint_weight[k] * p.moduli.pull[j]
            continue
        if p.flattening.exists and p.flattening.row[j]:
            force_out[drives.driven_joint_law[k]] -= drives.driven_joint_weight[k] * p.flattening.pull[j, column]
            continue
        a, b = strands.joint_a[j], strands.joint_b[j]
        t, u = row(at.tangent, a), row(at.tangent, b)
        bend = (dot(u, row(at.director1, a)) - dot(t, row(at.director1, b))) / (1.0 + dot(t, u))
        bend -= off_axis.rest[j, 0] if bends else stage.rest_joint[j, 0]
        stiffness = multiple_of_joint(p, stage, j, 0) * strands.joint_stiffness[j, 0]
        moment = drives.driven_joint_weight[k] * stiffness * bend
        force_out[drives.driven_joint_law[k]] += moment
    return READY


@kernel
def in_barriers(p):
    """Return the energy in what stops impacts: barriers, and limits of hinges and slides [J]."""
    energy = p.sums.energy[BARRIER] + p.sums.energy[ROD_BARRIER]
    return energy + p.mechanisms.in_limits[0] if p.mechanisms.exists else energy


@kernel
def _turning_power(gradient, b, rates):
    """Return ∂Φ/∂(X, φ)·(V, ω)"""
    power = 0.0
    for c in range(6):
        power += gradient[b, c] * rates[b, c]
    return power


@kernel
def _power_of_prescribed(p, at, rates):
    """Return the power that prescribed bodies supply [W]: forces and moments that they take, ∂Φ/∂(X, φ), times their
    velocities.
    """
    sums, constrained, power = p.sums, p.constrained, 0.0
    for i in range(p.bodies.prescribed.shape[0]):
        b = p.bodies.prescribed[i]
        power += _turning_power(sums.contact, b, rates)
    for k in range(constrained.node.shape[0]):
        if constrained.free[k] >= 0:
            continue
        b = constrained.body[k]
        r, g = row(at.arm, k), row(sums.attached, k)
        w = rates[b, 3], rates[b, 4], rates[b, 5]
        power += dot(g, (rates[b, 0], rates[b, 1], rates[b, 2])) + dot(g, cross(w, r))
    for k in range(constrained.clamp_edge_free.shape[0]):
        if constrained.clamp_edge_free[k] >= 0:
            continue
        b, e = constrained.clamp_edge_body[k], p.strands.edge_count + k
        t, w = row(at.tangent, e), (rates[b, 3], rates[b, 4], rates[b, 5])
        power += dot(row(sums.edge, e), cross(w, t)) + sums.edge[e, 3] * dot(w, t)
    return power


@kernel
def _write_rates(bodies, inputs, n, at, point, rates):
    """Write (V, ω) of bodies at the end of stage n; the world, which is the last, rests."""
    tensor = stack_matrix(3, 3)
    for b in range(inputs.rates.shape[1]):
        f = bodies.free_index[b]
        if f < 0:
            for c in range(6):
                rates[b, c] = inputs.rates[n, b, c]
            continue
        inertia_tensor(bodies.second_moment, f, at.body_rotation, f, tensor)
        momentum = point.angular_momentum
        spin = solve_three(tensor, momentum[f, 0], momentum[f, 1], momentum[f, 2])
        for c in range(3):
            rates[b, c], rates[b, 3 + c] = point.body_velocity[f, c], spin[c]


@kernel
def _add_velocity(rates, b, x, at, sign, velocity_out):
    """Add ± V + ω × (x − X) of a body."""
    w = rates[b, 3], rates[b, 4], rates[b, 5]
    turned = cross(w, (x[0] - at.pose_position[b, 0], x[1] - at.pose_position[b, 1], x[2] - at.pose_position[b, 2]))
    for c in range(3):
        velocity_out[c] += sign * (rates[b, c] + turned[c])


@kernel
def _power_of_barriers(p, at, point, rates):
    """Return the power that barriers and limits take up at the velocities of a stage's end [W]: ∂V/∂d times the rates
    of gaps.
    """
    surfaces, rods, sums, mechanisms, power = p.surfaces, p.rod_contact, p.sums, p.mechanisms, 0.0
    for k in range(mechanisms.slides.shape[0]):
        power += mechanisms.limit_slope[k] * point.strain_rate[mechanisms.first + k]
    velocity = stack_vector(3)
    if surfaces.exists:
        scratch = sums.arm_rate.shape[0] - 1
        for k in range(surfaces.near_count[0]):
            if surfaces.near_gap[k] >= surfaces.d_hat or surfaces.near_weight[k] == 0.0:
                continue
            i, s = surfaces.near_contact_point[k], surfaces.near_surface[k]
            x = place_of(surfaces, at, k)
            d, n0, n1, n2, _, _, _ = gap_normal(surfaces, at, surfaces.near_radius[k], s, x[0], x[1], x[2])
            if not 0.0 < d < surfaces.d_hat:
                continue
            body, node = surfaces.contact_point_body[i], surfaces.near_node[k]
            velocity[0] = velocity[1] = velocity[2] = 0.0
            if body >= 0:
                _add_velocity(rates, body, x, at, 1.0, velocity)
            else:
                for c in range(3):
                    velocity[c] = point.velocity[node, c]
                if surfaces.near_arm[k]:
                    write_material_rate(surfaces, at, k, scratch, sums.arm_rate)
                    add_step_of_arm(
                        surfaces, p.strands, node, scratch, sums.arm_rate, point.velocity, point.spin, velocity
                    )
            _add_velocity(rates, surfaces.body[s], x, at, -1.0, velocity)
            slope = surfaces.stiffness * surfaces.near_weight[k] * barrier_gradient(d, surfaces.d_hat)
            power += slope * (velocity[0] * n0 + velocity[1] * n1 + velocity[2] * n2)
    if rods.exists:
        contacts, v, rails = rods.contacts, point.velocity, rods.rails
        if rails.exists and contacts.count[0] > 0:
            write_rail_motions(rails, p.strands, rails.meets, rails.rate, point.velocity, point.spin, rails.motion)
            v = rails.motion
        for c in range(contacts.count[0]):
            scale = 0.5 * contacts.multiplicity[c] * rods.stiffness * rods.point_weight[contacts.point[c]]
            rate = 0.0
            for m in range(3):
                rate += contacts.normal[c, m] * moved_between(v, contacts, c, m)
            if contacts.gap[c] > 0.0:
                power += scale * barrier_gradient(contacts.gap[c], rods.d_hat) * rate
    return power


@kernel
def _moves(prescribed, rates):
    for i in range(prescribed.shape[0]):
        for c in range(6):
            if rates[prescribed[i], c] != 0.0:
                return True
    return False


@piece(int, Problem, Work, StageInputs, int, float, Configuration)
def add_powers(p, work, inputs, n, weight, at):
    """Add what is supplied and lost at the end of stage n, at `at` and in `Work.end`, times `weight` [s], to the
    account of a step.
    """
    sums, flow, done = p.sums, p.flow, work.account
    supplied = lost = 0.0
    for k in range(sums.supplied.shape[0]):
        supplied += sums.supplied[k]
        lost += sums.lost[k]
    _write_rates(p.bodies, inputs, n, at, work.end, work.rates)
    done.taking_up = _power_of_barriers(p, at, work.end, work.rates) if in_barriers(p) != 0.0 else 0.0
    done.taken_up += weight * done.taking_up
    driven = p.followers.exists or p.moments.exists
    if flow.exists:
        driven |= flow.velocity[0] != 0.0 or flow.velocity[1] != 0.0 or flow.velocity[2] != 0.0
    if driven:
        done.driven = BY_FLOW
    if _moves(p.bodies.prescribed, work.rates):
        done.driven = max(done.driven, BY_BODIES)
        supplied += _power_of_prescribed(p, at, work.rates)
    done.supplying, done.losing = supplied, lost
    done.supplied += weight * supplied
    done.lost += weight * lost
    write_forces_of_laws(p, at, work.stage, work.end_force)
    for i in range(work.mean_force.shape[0]):
        work.mean_force[i] += weight * work.end_force[i]
    return READY
