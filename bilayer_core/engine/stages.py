"""Origins and predictions of the stages of a step, and where the step ends.

Positions and momenta advance as `integrators.method` says. What is no vector needs a word:

- A rotation advances along rotation vectors: R̄ = exp(h a f₁) … Rₙ with f = log(R R̄ᵀ)/(γ h) of each earlier stage. Over
  the stage, inertia prefers R̃ = exp(γ h ω̃) R̄ with I(R̃) ω̃ = L̄: without a moment, the angular momentum L stays what
  it was. Given the moment that acts at the end of the stage, L = L̄ + γ h × moment and ω = I(R)⁻¹ L. What ω differs by
  from the rotation's own log(R R̄ᵀ)/(γ h) is of second order.
- What a body holds has the body's velocity, v + ω × r, not that of a chord of its arc, which differs at first order. So
  its origin is where R̄ := R̃ − γ h ω × R̃ has it: (R − R̄)/(γ h) is dR/dt to second order. A prescribed body has its
  own velocity, not that of a chord either: the same with its pose at the end of the stage and its rates.
- The momentum of the fluid is no fixed multiple of a velocity. Where the end of a step lies beyond its last stage, both
  are extrapolated, and what they differ by at the end (second order in h) is kept in the state; the momentum counts.
- The angle of an edge counts from the start of the stage, where its frame was last re-based; its origin lies
  before or behind that.
"""

from __future__ import annotations

import math

from ..forces.added_mass import momentum_at
from ..forces.inertia import moment_of_rotation
from ..jit import kernel, piece
from ..jit.stack import stack_matrix
from ..kinematics.compensated import add_exactly
from ..kinematics.copying import add_scaled, copy, copy_matrix, copy_row
from ..kinematics.rotating import inertia_tensor, rotate_by, rotation_vector_between, solve_three
from ..kinematics.vector import row
from ..model.records.problem import Problem
from ..model.records.status import READY
from ..model.records.step import Configuration, Method, Point, Stage, StageInputs, StateArrays, Work
from .configuration import clear_departure

SPIN_ITERATIONS = 50
SPIN_CHANGE = 1e-15


@kernel
def _tensor_times(second_moment, f, rotation, b, x, y, z, scratch):
    """I ω of free body f at rotation[b], as a tuple."""
    inertia_tensor(second_moment, f, rotation, b, scratch)
    return (
        scratch[0, 0] * x + scratch[0, 1] * y + scratch[0, 2] * z,
        scratch[1, 0] * x + scratch[1, 1] * y + scratch[1, 2] * z,
        scratch[2, 0] * x + scratch[2, 1] * y + scratch[2, 2] * z,
    )


@piece(int, Problem, StateArrays, Configuration, Point)
def start_step_point(p, state, start, first):
    """The start of a step."""
    bodies = p.bodies
    first.displacement[:] = 0.0
    first.body_displacement[:] = 0.0
    copy(state.body_rotation, first.rotation)
    first.angle[:] = 0.0
    copy(state.velocity, first.velocity)
    copy(state.spin, first.spin)
    scratch = stack_matrix(3, 3)
    for f in range(bodies.mass.shape[0]):
        b = bodies.body_of_free[f]
        copy_row(state.body_velocity, b, first.body_velocity, f)
        w0, w1, w2 = row(state.body_angular_velocity, b)
        momentum = _tensor_times(bodies.second_moment, f, start.body_rotation, f, w0, w1, w2, scratch)
        for c in range(3):
            first.angular_momentum[f, c] = momentum[c]
    momentum_at(p.fluid, start, state.velocity, first.fluid_momentum)
    add_scaled(first.fluid_momentum, 1.0, state.fluid_excess)
    return READY


@piece(int, Work, Method, int)
def set_origin(work, method, n):
    """Put the origin of stage n, or a step's end beyond its last stage, to where earlier stages have it.

    First note what the stage before has gained over its own origin: vectors, and rotation vectors of bodies. Rotations
    advance on their group.
    """
    origin, end, gained, turned = work.origin, work.end, work.gained, work.gained_rotation_vector
    if n > 0:
        for i in range(origin.vectors.shape[0]):
            gained[n - 1, i] = end.vectors[i] - origin.vectors[i]
        for b in range(origin.rotation.shape[0]):
            x, y, z = rotation_vector_between(origin.rotation, b, end.rotation, b)
            turned[n - 1, b, 0], turned[n - 1, b, 1], turned[n - 1, b, 2] = x, y, z
    copy(work.first.vectors, origin.vectors)
    copy(work.first.rotation, origin.rotation)
    for j in range(n):
        weight = method.couplings[n, j]
        for i in range(origin.vectors.shape[0]):
            origin.vectors[i] += weight * gained[j, i]
        copy(origin.rotation, work.rotation)
        for b in range(origin.rotation.shape[0]):
            x, y, z = weight * turned[j, b, 0], weight * turned[j, b, 1], weight * turned[j, b, 2]
            rotate_by(x, y, z, work.rotation, b, origin.rotation, b)
    return READY


@piece(int, Problem, StateArrays, Work, Method, int, float)
def add_history_to_origin(p, state, work, method, n, h):
    """Move the origin of stage n by what the stage derivatives at the start of a step of length h add to it."""
    bodies, point, first, scratch = p.bodies, work.origin, work.first, work.rotation
    along, bend, momenta = method.along[n], method.bend, method.momenta[n]  # weights of q̇ h, q̈ h² and ṗ h
    add_scaled(point.displacement, along * h, state.velocity)
    add_scaled(point.body_displacement, along * h, state.body_velocity)
    add_scaled(point.angle, along * h, state.spin)
    if bend != 0.0:
        add_scaled(point.displacement, bend * h * h, state.acceleration)
        add_scaled(point.angle, bend * h * h, state.spin_acceleration)
    add_scaled(point.velocity, momenta * h, state.acceleration)
    add_scaled(point.spin, momenta * h, state.spin_acceleration)
    add_scaled(point.body_velocity, momenta * h, state.body_acceleration)
    add_scaled(point.angular_momentum, momenta * h, state.body_moment)
    add_scaled(point.fluid_momentum, momenta * h, state.fluid_force)
    tensor = stack_matrix(3, 3)
    copy(point.rotation, scratch)
    for b in range(point.rotation.shape[0]):
        f = bodies.free_index[b]
        w = row(state.body_angular_velocity, b)
        x, y, z = along * h * w[0], along * h * w[1], along * h * w[2]
        if f >= 0:
            for c in range(3):
                point.body_displacement[b, c] += bend * h * h * state.body_acceleration[f, c]
            m = row(first.angular_momentum, f)
            inertia_tensor(bodies.second_moment, f, state.body_rotation, b, tensor)
            rate = solve_three(
                tensor,
                state.body_moment[f, 0] - (w[1] * m[2] - w[2] * m[1]),
                state.body_moment[f, 1] - (w[2] * m[0] - w[0] * m[2]),
                state.body_moment[f, 2] - (w[0] * m[1] - w[1] * m[0]),
            )
            x += bend * h * h * rate[0]
            y += bend * h * h * rate[1]
            z += bend * h * h * rate[2]
        rotate_by(x, y, z, scratch, b, point.rotation, b)
    return READY


@kernel
def _spin_without_moment(second_moment, f, rotation, b, momentum, length, turned, scratch):
    """ω̃ with I(exp(length ω̃) R̄) ω̃ = L̄ [rad/s], by iteration; exp(length ω̃) R̄ is left in turned[f]."""
    x = y = z = 0.0
    copy_matrix(rotation, b, turned, f)
    if momentum[f, 0] == 0.0 and momentum[f, 1] == 0.0 and momentum[f, 2] == 0.0:
        return x, y, z
    for _ in range(SPIN_ITERATIONS):
        inertia_tensor(second_moment, f, turned, f, scratch)
        u, v, w = solve_three(scratch, momentum[f, 0], momentum[f, 1], momentum[f, 2])
        change = max(abs(u - x), abs(v - y), abs(w - z))
        x, y, z = u, v, w
        rotate_by(length * x, length * y, length * z, rotation, b, turned, f)
        if change <= SPIN_CHANGE * max(abs(x), abs(y), abs(z)):
            break
    return x, y, z


@piece(int, Problem, StateArrays, Work, StageInputs, int, Point, Configuration)
def predict_stage(p, state, work, inputs, n, previous, start):
    """Frozen data of stage n from its origin; puts the origin of what bodies hold to where it has their velocity.

    `previous` is the end of the stage before, or the start of the step, and `start` its configuration. The turn of
    edges in `work` is that from the start of the step, where positions are those of `state`, to `start`.
    """
    origin, stage, bodies = work.origin, work.stage, p.bodies
    position, rotation, rates = inputs.position[n], inputs.rotation[n], inputs.rates[n]
    length = stage.lengths[0]
    for b in range(origin.rotation.shape[0]):
        f = bodies.free_index[b]
        if f < 0:
            w0, w1, w2 = rates[b, 3], rates[b, 4], rates[b, 5]
            for c in range(3):
                stage.origin_pose_position[b, c] = position[b, c] - length * rates[b, c]
            _set_back(rotation, b, length, w0, w1, w2, stage.origin_rotation, b)
        else:
            w0, w1, w2 = _spin_without_moment(
                bodies.second_moment,
                f,
                origin.rotation,
                b,
                origin.angular_momentum,
                length,
                stage.predicted_body_rotation,
                stack_matrix(3, 3),
            )
            stage.body_spin[f, 0], stage.body_spin[f, 1], stage.body_spin[f, 2] = w0, w1, w2
            _set_back(stage.predicted_body_rotation, f, length, w0, w1, w2, stage.origin_rotation, b)
            for c in range(3):
                moved = origin.body_displacement[b, c]
                stage.origin_pose_position[b, c] = state.body_position[b, c] + moved
                stage.origin_body_position[f, c] = stage.origin_pose_position[b, c]
                ahead = length * origin.body_velocity[f, c]
                stage.predicted_body_position[f, c] = stage.origin_pose_position[b, c] + ahead
                stage.predicted_body_shift[f, c] = (moved - previous.body_displacement[b, c]) + ahead
            x, y, z = rotation_vector_between(start.body_rotation, f, stage.predicted_body_rotation, f)
            vector = stage.predicted_body_rotation_vector
            vector[f, 0], vector[f, 1], vector[f, 2] = x, y, z
    for i in range(origin.displacement.shape[0]):
        for c in range(3):
            moved, ahead = origin.displacement[i, c], length * origin.velocity[i, c]
            stage.origin_position[i, c] = state.position[i, c] + moved
            stage.predicted_position[i, c] = stage.origin_position[i, c] + ahead
            stage.predicted_shift[i, c] = (moved - previous.displacement[i, c]) + ahead
    _origin_of_constrained(p.constrained, origin, state, stage)
    for k in range(origin.angle.shape[0]):
        stage.origin_angle[k] = origin.angle[k] - work.start_angle[k]
        stage.predicted_angle[k] = stage.origin_angle[k] + length * origin.spin[k]
    for i in range(origin.fluid_momentum.shape[0]):
        for c in range(3):
            stage.origin_fluid_momentum[i, c] = origin.fluid_momentum[i, c]
    _take_twist(start, stage)
    return READY


@piece(int, Problem, StateArrays, Work, StageInputs, int, Point, Configuration)
def predict_end(p, state, work, inputs, n, previous, start):
    """Predict just the end of a step, which lies beyond its last stage; prescribed bodies are put there.

    Parameters as for `predict_stage`.
    """
    end, stage, bodies = work.origin, work.stage, p.bodies
    for i in range(end.displacement.shape[0]):
        for c in range(3):
            stage.predicted_position[i, c] = state.position[i, c] + end.displacement[i, c]
            stage.predicted_shift[i, c] = end.displacement[i, c] - previous.displacement[i, c]
    for k in range(end.angle.shape[0]):
        stage.predicted_angle[k] = end.angle[k] - work.start_angle[k]
    for b in range(end.rotation.shape[0]):
        f = bodies.free_index[b]
        if f < 0:
            copy_matrix(inputs.rotation[n], b, end.rotation, b)
            continue
        for c in range(3):
            stage.predicted_body_position[f, c] = state.body_position[b, c] + end.body_displacement[b, c]
            stage.predicted_body_shift[f, c] = end.body_displacement[b, c] - previous.body_displacement[b, c]
        copy_matrix(end.rotation, b, stage.predicted_body_rotation, f)
        x, y, z = rotation_vector_between(start.body_rotation, f, stage.predicted_body_rotation, f)
        vector = stage.predicted_body_rotation_vector
        vector[f, 0], vector[f, 1], vector[f, 2] = x, y, z
    _take_twist(start, stage)
    return READY


@kernel
def _take_twist(start, stage):
    for k in range(stage.twist.shape[0]):
        stage.twist[k] = start.joint_strain[k, 2]


@piece(int, Problem, StateArrays, Configuration, bool, Stage)
def stand_still_stage(p, state, start, with_fluid, stage):
    """Frozen data of a stage in which inertia wants everything to stay where it is.

    Forces see velocities as displacements from an origin. `with_fluid` says whether inertia of the fluid wants the
    fluid's momentum at `start` with these velocities to stay, too, instead of asking for nothing.
    """
    bodies, length = p.bodies, stage.lengths[0]
    for b in range(state.body_position.shape[0]):
        w0, w1, w2 = row(state.body_angular_velocity, b)
        for c in range(3):
            stage.origin_pose_position[b, c] = start.pose_position[b, c] - length * state.body_velocity[b, c]
        rotate_by(-length * w0, -length * w1, -length * w2, start.rotation, b, stage.origin_rotation, b)
    for f in range(bodies.body_of_free.shape[0]):
        copy_row(stage.origin_pose_position, bodies.body_of_free[f], stage.origin_body_position, f)
    copy(start.body_position, stage.predicted_body_position)
    copy(start.body_rotation, stage.predicted_body_rotation)
    stage.predicted_body_rotation_vector[:] = 0.0
    stage.predicted_shift[:] = 0.0
    stage.predicted_body_shift[:] = 0.0
    copy(start.arm, stage.attached_arm)
    stage.attached_lag[:] = 0.0
    clear_departure(start)
    copy(start.position, stage.predicted_position)
    copy(start.position, stage.origin_position)
    add_scaled(stage.origin_position, -length, state.velocity)
    stage.predicted_angle[:] = 0.0
    stage.origin_angle[:] = 0.0
    add_scaled(stage.origin_angle, -length, state.spin)
    stage.origin_fluid_momentum[:] = 0.0
    if with_fluid:
        momentum_at(p.fluid, start, state.velocity, stage.origin_fluid_momentum)
    _take_twist(start, stage)
    return READY


@piece(float, Problem, Configuration, Configuration)
def distance(p, start, end):
    """Largest displacement of a material point from one configuration to another [m]."""
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


@kernel
def _set_back(rotation, b, length, w0, w1, w2, out, c):
    """out[c] = (1 − length [ω]×) rotation[b]"""
    for j in range(3):
        u0, u1, u2 = rotation[b, 0, j], rotation[b, 1, j], rotation[b, 2, j]
        out[c, 0, j] = u0 - length * (w1 * u2 - w2 * u1)
        out[c, 1, j] = u1 - length * (w2 * u0 - w0 * u2)
        out[c, 2, j] = u2 - length * (w0 * u1 - w1 * u0)


@kernel
def _origin_of_constrained(constrained, origin, state, stage):
    length = stage.lengths[0]
    for k in range(constrained.node.shape[0]):
        b, i, f = constrained.body[k], constrained.node[k], constrained.free[k]
        for c in range(3):
            position = stage.origin_pose_position[b, c]
            for m in range(3):
                position += stage.origin_rotation[b, c, m] * constrained.position[k, m]
            origin.displacement[i, c] = position - state.position[i, c]
            stage.origin_position[i, c] = position
            stage.predicted_position[i, c] = position + length * origin.velocity[i, c]
        if f < 0:
            continue
        for c in range(3):
            stage.attached_arm[k, c] = 0.0
            for m in range(3):
                stage.attached_arm[k, c] += stage.predicted_body_rotation[f, c, m] * constrained.position[k, m]
        w0, w1, w2 = row(stage.body_spin, f)
        u0, u1, u2 = row(stage.attached_arm, k)
        v0, v1, v2 = row(origin.velocity, i)
        stage.attached_lag[k, 0] = length * (origin.body_velocity[f, 0] + (w1 * u2 - w2 * u1) - v0)
        stage.attached_lag[k, 1] = length * (origin.body_velocity[f, 1] + (w2 * u0 - w0 * u2) - v1)
        stage.attached_lag[k, 2] = length * (origin.body_velocity[f, 2] + (w0 * u1 - w1 * u0) - v2)


@piece(int, Problem, StateArrays, Work, StageInputs, int, Configuration)
def end_stage(p, state, work, inputs, n, end):
    """The end of stage n, which was solved with the configuration `end`.

    Velocities and displacements are those of inertia's motion and what the end departs from it.
    """
    origin, point, stage, bodies = work.origin, work.end, work.stage, p.bodies
    position, rotation, length = inputs.position[n], inputs.rotation[n], stage.lengths[0]
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
    momentum_at(p.fluid, end, point.velocity, point.fluid_momentum)
    return READY


@piece(int, Problem, StateArrays, Point, Configuration, StageInputs, int)
def write_end(p, state, last, end, inputs, n):
    """Take the end of a step, its point n, into the state."""
    bodies, constrained, position, rates = p.bodies, p.constrained, inputs.position[n], inputs.rates[n]
    copy(last.velocity, state.velocity)
    _write_velocity_of_constrained(constrained, end, rates, state)
    momentum_at(p.fluid, end, last.velocity, state.fluid_excess)
    for i in range(state.fluid_excess.shape[0]):
        for c in range(3):
            state.fluid_excess[i, c] = last.fluid_momentum[i, c] - state.fluid_excess[i, c]
    copy(last.spin, state.spin)
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
    """The rotation nearest to `matrix[f]` to first order in its error: 1.5 R − 0.5 R Rᵀ R."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += matrix[f, i, k] * matrix[f, m, k] * matrix[f, m, j]
            out[b, i, j] = 1.5 * matrix[f, i, j] - 0.5 * total


@kernel
def _keep_derivative(rate, end, origin, length, carry):
    a, b, c = rate.reshape(rate.size), end.reshape(end.size), origin.reshape(origin.size)
    for i in range(a.shape[0]):
        a[i] = ((b[i] - c[i]) / length - carry * a[i]) / (1.0 - carry)


@piece(int, StateArrays, Point, Point, float, float)
def keep_stage_derivatives(state, origin, end, momentum_length, carry):
    """Write the stage derivatives of momenta at the end of the last stage of a step into the state."""
    _keep_derivative(state.acceleration, end.velocity, origin.velocity, momentum_length, carry)
    _keep_derivative(state.spin_acceleration, end.spin, origin.spin, momentum_length, carry)
    _keep_derivative(state.body_acceleration, end.body_velocity, origin.body_velocity, momentum_length, carry)
    _keep_derivative(state.body_moment, end.angular_momentum, origin.angular_momentum, momentum_length, carry)
    _keep_derivative(state.fluid_force, end.fluid_momentum, origin.fluid_momentum, momentum_length, carry)
    state.has_history[0] = 1.0
    return READY
