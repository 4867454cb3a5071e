"""Where stages and steps end: positions, momenta and frames there, and what a state takes of them.

The momentum of the fluid is no fixed multiple of a velocity. Where the end of a step lies beyond its last stage, both
are extrapolated, and differ there (second order in h). The momentum counts, and velocities are those that it asks for;
of nodes that a body holds, which move as it does, and of those beside raised edges, whose momenta hang together
(`forces.raised`), the difference is kept in the state.
"""

from __future__ import annotations

import math

from bilayer_core.forces.added_mass import momentum_at, write_inertia
from bilayer_core.forces.elements import measure_strains
from bilayer_core.forces.inertia import moment_of_rotation
from bilayer_core.forces.mechanisms import measure_mechanisms, remember_mechanisms
from bilayer_core.forces.raised import measure_directors
from bilayer_core.forces.restitution import measure_gaps
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import flat, stack_matrix
from bilayer_core.kinematics.compensated import add_exactly
from bilayer_core.kinematics.copying import copy, copy_matrix, copy_row
from bilayer_core.kinematics.rotating import inertia_tensor, rotation_vector_between, solve_three
from bilayer_core.kinematics.vector import row
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Point, StageInputs, StateArrays, Work

HELD = 0.0
"""In place of the inertia of a node whose velocity stays."""


@piece(int, Problem, StateArrays, Work, StageInputs, int, Configuration)
def end_stage(p, state, work, inputs, n, end):
    """Set the end of stage n, which was solved with the configuration `end`.

    Velocities and displacements are those of inertia's motion plus the departure of the end from it.
    """
    origin, point, stage, bodies = work.origin, work.end, work.stage, p.bodies
    position, rotation, length = inputs.position[n], inputs.rotation[n], stage.length
    for b in range(point.rotation.shape[0]):
        f = bodies.free_index[b]
        if f < 0:
            for c in range(3):
                point.body_displacement[b, c] = position[b, c] - state.body_position[b, c]
            copy_matrix(rotation, b, point.rotation, b)
            continue
        copy_matrix(end.body_rotation, f, point.rotation, b)
        # moment of inertia's potential at the end: −ax(R̃ J Rᵀ)/(γ γ′ h²), see `forces.inertia`
        reference, beyond = stage.predicted_body_rotation, end.body_departure_quaternion
        moment = moment_of_rotation(bodies.second_moment, f, reference, beyond)
        factor = 1.0 / length  # γ′ h times 1/(γ γ′ h²)
        for c in range(3):
            velocity, departure = origin.body_velocity[f, c], end.body_departure[f, c]
            moved = origin.body_displacement[b, c]
            point.body_velocity[f, c] = velocity + departure / length
            point.body_displacement[b, c] = moved + (length * velocity + departure)
            point.angular_momentum[f, c] = origin.angular_momentum[f, c] - factor * moment[c]
    for i in range(point.displacement.shape[0]):
        for c in range(3):
            velocity, departure = origin.velocity[i, c], end.departure[i, c]
            point.velocity[i, c] = velocity + departure / length
            point.displacement[i, c] = origin.displacement[i, c] + (length * velocity + departure)
    for k in range(point.angle.shape[0]):
        point.angle[k] = work.start_angle[k] + end.total_angle[k]
        point.spin[k] = (end.total_angle[k] - stage.origin_angle[k]) / length
    measure_strains(p, end, point.strain)
    measure_gaps(p, end, point.strain)
    measure_mechanisms(p, end, point.strain)
    measure_directors(p.raised, end, point.strain)
    for k in range(point.strain.shape[0]):
        point.strain_rate[k] = (point.strain[k] - stage.origin_strain[k]) / length
    momentum_at(p, end, point.velocity, point.strain_rate, point.fluid_momentum)
    return READY


@piece(int, Problem, StateArrays, Point, Configuration, StageInputs, int)
def write_end(p, state, last, end, inputs, n):
    """Take the end of a step, its point n, into the state."""
    bodies, constrained, position, rates = p.bodies, p.constrained, inputs.position[n], inputs.rates[n]
    copy(last.velocity, state.velocity)
    _write_velocity_of_constrained(constrained, end, rates, state)
    if p.fluid.exists:
        _take_momentum(p, end, last, state)
    copy(last.spin, state.spin)
    copy(last.strain_rate, state.strain_rate)
    _move_positions(state.position, state.position_low, last.displacement)
    for k in range(constrained.node.shape[0]):
        i = constrained.node[k]
        for c in range(3):
            state.position[i, c], state.position_low[i, c] = end.position[i, c], 0.0
    _move_positions(state.body_position, state.body_position_low, last.body_displacement)
    copy(last.rotation, state.body_rotation)
    _write_frames(bodies, p.strands, end, state)
    tensor = stack_matrix(3, 3)
    for b in range(rates.shape[0]):
        f = bodies.free_index[b]
        if f < 0:
            for c in range(3):
                state.body_position[b, c], state.body_position_low[b, c] = position[b, c], 0.0
                state.body_velocity[b, c], state.body_angular_velocity[b, c] = rates[b, c], rates[b, 3 + c]
            continue
        inertia_tensor(bodies.second_moment, f, end.body_rotation, f, tensor)
        momentum = row(last.angular_momentum, f)
        spin = solve_three(tensor, momentum[0], momentum[1], momentum[2])
        for c in range(3):
            state.body_velocity[b, c], state.body_angular_velocity[b, c] = last.body_velocity[f, c], spin[c]
    return READY


@piece(int, Problem, Configuration, StateArrays)
def write_shape(p, at, state):
    """Take positions, frames, and the poses of free bodies into the state."""
    bodies = p.bodies
    copy(at.position, state.position)
    state.position_low[:] = 0.0
    state.body_position_low[:] = 0.0
    for f in range(bodies.mass.shape[0]):
        copy_row(at.body_position, f, state.body_position, bodies.body_of_free[f])
    _write_frames(bodies, p.strands, at, state)
    remember_mechanisms(p, at, state.memory)
    return READY


@kernel
def _move_positions(position, low, displacement):
    """Add displacements, also those smaller than the last digit."""
    for i in range(position.shape[0]):
        for c in range(3):
            position[i, c], low[i, c] = add_exactly(position[i, c], low[i, c], displacement[i, c])


@kernel
def _write_frames(bodies, strands, at, state):
    for k in range(strands.edge_count):
        copy_row(at.director1, k, state.director1, k)
    write_twist(at, state)
    for f in range(bodies.mass.shape[0]):
        b = bodies.body_of_free[f]
        _write_orthonormal(at.body_rotation, f, state.body_rotation, b)


@kernel
def _share(inertia, excess, first, copy):
    """Give a node that is there twice, and its copy, what both have; if one is held, hold both."""
    if inertia[first, 0, 0] == HELD or inertia[copy, 0, 0] == HELD:
        inertia[first, 0, 0] = inertia[copy, 0, 0] = HELD
        return
    for m in range(3):
        excess[first, m] += excess[copy, m]
        excess[copy, m] = excess[first, m]
        for n in range(3):
            inertia[first, m, n] += inertia[copy, m, n]
            inertia[copy, m, n] = inertia[first, m, n]


@kernel
def _take_momentum(p, end, last, state):
    """Change velocities v of nodes by w so that m (v + w) + P(v + w) is their momentum: (m + ∂P/∂v) w = P − P(v)."""
    fluid, excess, velocity = p.fluid, state.fluid_excess, state.velocity
    momentum_at(p, end, last.velocity, last.strain_rate, excess)
    apart = False
    for i in range(excess.shape[0]):
        for c in range(3):
            excess[i, c] = last.fluid_momentum[i, c] - excess[i, c]
            apart |= excess[i, c] != 0.0
    if not apart:
        return
    write_inertia(fluid, p.strands.node_mass, end)
    for k in range(p.constrained.node.shape[0]):
        fluid.inertia[p.constrained.node[k], 0, 0] = HELD
    for k in range(p.raised.edge.shape[0]):
        i = p.strands.edge_node[p.raised.edge[k]]
        fluid.inertia[i, 0, 0] = fluid.inertia[i + 1, 0, 0] = HELD
    for k in range(fluid.joined.shape[0]):
        _share(fluid.inertia, excess, fluid.joined[k, 0], fluid.joined[k, 1])
    for i in range(velocity.shape[0]):
        if fluid.inertia[i, 0, 0] == HELD:
            continue
        gained = solve_three(fluid.inertia[i], excess[i, 0], excess[i, 1], excess[i, 2])
        for c in range(3):
            velocity[i, c] += gained[c]
            excess[i, c] = 0.0


@kernel
def _write_velocity_of_constrained(constrained, end, rates, state):
    for k in range(constrained.node.shape[0]):
        if constrained.free[k] >= 0:
            continue
        b, i = constrained.body[k], constrained.node[k]
        w0, w1, w2 = rates[b, 3], rates[b, 4], rates[b, 5]
        state.velocity[i, 0] = rates[b, 0] + w1 * end.arm[k, 2] - w2 * end.arm[k, 1]
        state.velocity[i, 1] = rates[b, 1] + w2 * end.arm[k, 0] - w0 * end.arm[k, 2]
        state.velocity[i, 2] = rates[b, 2] + w0 * end.arm[k, 1] - w1 * end.arm[k, 0]


@kernel
def write_twist(at, state):
    """Take the unwrapped twists of joints, as they were found when the potential was evaluated, into the state."""
    for k in range(state.twist.shape[0]):
        state.twist[k] = at.joint_strain[k, 2]


@kernel
def _write_orthonormal(matrix, f, out, b):
    """Write the rotation nearest to `matrix[f]` to first order in its error: 1.5 R − 0.5 R Rᵀ R."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += matrix[f, i, k] * matrix[f, m, k] * matrix[f, m, j]
            out[b, i, j] = 1.5 * matrix[f, i, j] - 0.5 * total


@kernel
def _keep_derivative(rate, end, origin, length, carry):
    a, b, c = flat(rate), flat(end), flat(origin)
    for i in range(a.shape[0]):
        a[i] = ((b[i] - c[i]) / length - carry * a[i]) / (1.0 - carry)


@piece(int, StateArrays, Point, Point, float, float)
def keep_stage_derivatives(state, origin, end, momentum_length, carry):
    """Write the stage derivatives of momenta at the end of the last stage of a step into the state."""
    _keep_derivative(state.acceleration, end.velocity, origin.velocity, momentum_length, carry)
    _keep_derivative(state.spin_acceleration, end.spin, origin.spin, momentum_length, carry)
    _keep_derivative(state.body_acceleration, end.body_velocity, origin.body_velocity, momentum_length, carry)
    _keep_derivative(state.body_moment, end.angular_momentum, origin.angular_momentum, momentum_length, carry)
    _keep_derivative(state.strain_acceleration, end.strain_rate, origin.strain_rate, momentum_length, carry)
    _keep_derivative(state.fluid_force, end.fluid_momentum, origin.fluid_momentum, momentum_length, carry)
    state.has_history[0] = 1.0
    return READY


@piece(float, Problem, Configuration, Configuration)
def distance(p, start, end):
    """Return the largest displacement of a material point from one configuration to another [m]."""
    bodies, strands, largest = p.bodies, p.strands, 0.0
    for i in range(start.position.shape[0]):
        square = 0.0
        for c in range(3):
            square += (end.position[i, c] - start.position[i, c]) ** 2
        largest = max(largest, math.sqrt(square))
    for k in range(end.total_angle.shape[0]):
        largest = max(largest, abs(end.total_angle[k]) * strands.half_width[k])
    for f in range(bodies.mass.shape[0]):
        square = 0.0
        for c in range(3):
            square += (end.body_position[f, c] - start.body_position[f, c]) ** 2
        x, y, z = rotation_vector_between(start.body_rotation, f, end.body_rotation, f)
        turn = math.sqrt(x * x + y * y + z * z)
        largest = max(largest, math.sqrt(square) + bodies.bounding_radius[bodies.body_of_free[f]] * turn)
    return largest
