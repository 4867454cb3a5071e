"""Origins and predictions of the stages of a step.

Positions and momenta advance as `integrators.method` says. What is no vector needs a word:

- A rotation advances along rotation vectors: R̄ = exp(h a f₁) … Rₙ with f = log(R R̄ᵀ)/(γ h) of each earlier stage. Over
  the stage, inertia prefers R̃ = exp(γ h ω̃) R̄ with I(R̃) ω̃ = L̄: without a moment, the angular momentum L stays what
  it was. Given the moment that acts at the end of the stage, L = L̄ + γ h × moment and ω = I(R)⁻¹ L. What ω differs by
  from the rotation's own log(R R̄ᵀ)/(γ h) is of second order.
- What a body holds has the body's velocity, v + ω × r, not that of a chord of its arc, which differs at first order. So
  its origin is where R̄ := R̃ − γ h ω × R̃ has it: (R − R̄)/(γ h) is dR/dt to second order. A prescribed body has its
  own velocity, not that of a chord either: the same with its pose at the end of the stage and its rates.
- Material directors of raised edges are vectors with velocities of their own among the strains (`forces.raised`).
- The angle of an edge counts from the start of the stage, where its frame was last re-based; its origin lies
  before or behind that.
"""

from __future__ import annotations

from bilayer_core.engine.configuration import clear_departure
from bilayer_core.forces.added_mass import momentum_at
from bilayer_core.forces.elements import measure_strains
from bilayer_core.forces.mechanisms import measure_mechanisms
from bilayer_core.forces.raised import copy_directors, measure_directors, predict_directors
from bilayer_core.forces.restitution import measure_gaps
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.copying import add_scaled, copy, copy_matrix, copy_row
from bilayer_core.kinematics.rotating import inertia_tensor, rotate_by, rotation_vector_between, solve_three
from bilayer_core.kinematics.vector import row
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import (
    IN_MOTION,
    Configuration,
    Method,
    Point,
    Stage,
    StageInputs,
    StateArrays,
    Work,
)

SPIN_ITERATIONS = 50
SPIN_CHANGE = 1e-15


@kernel
def _tensor_times(second_moment, f, rotation, b, x, y, z, scratch):
    """Return I ω of free body f at rotation[b], as a tuple."""
    inertia_tensor(second_moment, f, rotation, b, scratch)
    return (
        scratch[0, 0] * x + scratch[0, 1] * y + scratch[0, 2] * z,
        scratch[1, 0] * x + scratch[1, 1] * y + scratch[1, 2] * z,
        scratch[2, 0] * x + scratch[2, 1] * y + scratch[2, 2] * z,
    )


@piece(int, Problem, StateArrays, Configuration, Point)
def start_step_point(p, state, start, first):
    """Set `first` to the start of a step."""
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
    measure_strains(p, start, first.strain)
    measure_gaps(p, start, first.strain)
    measure_mechanisms(p, start, first.strain)
    measure_directors(p.raised, start, first.strain)
    copy(state.strain_rate, first.strain_rate)
    momentum_at(p, start, state.velocity, state.strain_rate, first.fluid_momentum)
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
    add_scaled(point.strain, along * h, state.strain_rate)
    if bend != 0.0:
        add_scaled(point.strain, bend * h * h, state.strain_acceleration)
    add_scaled(point.strain_rate, momenta * h, state.strain_acceleration)
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
    """Return ω̃ with I(exp(length ω̃) R̄) ω̃ = L̄ [rad/s], by iteration; exp(length ω̃) R̄ is left in turned[f]."""
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
    """Freeze the data of stage n from its origin; put the origin of what bodies hold to where it has their velocity.

    `previous` is the end of the stage before, or the start of the step, and `start` its configuration. The turn of
    edges in `work` is that from the start of the step, where positions are those of `state`, to `start`.
    """
    origin, stage, bodies = work.origin, work.stage, p.bodies
    position, rotation, rates = inputs.position[n], inputs.rotation[n], inputs.rates[n]
    length = stage.length
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
    stage.still[0] = IN_MOTION
    copy(origin.strain, stage.origin_strain)
    predict_directors(p.raised, origin, length, stage.predicted_director)
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
    """Freeze the data of a stage in which inertia wants everything to stay where it is.

    Forces see velocities as displacements from an origin. `with_fluid` says whether inertia of the fluid wants the
    fluid's momentum at `start` with these velocities to stay, too, instead of asking for nothing.
    """
    bodies, length = p.bodies, stage.length
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
    measure_strains(p, start, stage.origin_strain)
    measure_gaps(p, start, stage.origin_strain)
    measure_mechanisms(p, start, stage.origin_strain)
    measure_directors(p.raised, start, stage.origin_strain)
    copy_directors(p.raised, start, stage.predicted_director)
    add_scaled(stage.origin_strain, -length, state.strain_rate)
    stage.still[0] = IN_MOTION
    stage.origin_fluid_momentum[:] = 0.0
    if with_fluid:
        momentum_at(p, start, state.velocity, state.strain_rate, stage.origin_fluid_momentum)
    _take_twist(start, stage)
    return READY


@kernel
def _set_back(rotation, b, length, w0, w1, w2, out, c):
    """Write out[c] = (1 − length [ω]×) rotation[b]."""
    for j in range(3):
        u0, u1, u2 = rotation[b, 0, j], rotation[b, 1, j], rotation[b, 2, j]
        out[c, 0, j] = u0 - length * (w1 * u2 - w2 * u1)
        out[c, 1, j] = u1 - length * (w2 * u0 - w0 * u2)
        out[c, 2, j] = u2 - length * (w0 * u1 - w1 * u0)


@kernel
def _origin_of_constrained(constrained, origin, state, stage):
    length = stage.length
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
