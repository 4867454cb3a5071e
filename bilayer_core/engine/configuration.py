"""Where everything is: frames, and what bodies carry."""

from __future__ import annotations

from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.copying import copy, copy_matrix, copy_row
from bilayer_core.kinematics.frames import edge_geometry, planar_frames, transport_directors
from bilayer_core.kinematics.rotating import compose_quaternion, rotate_by, rotated_by, rotation_vector_between
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage, StateArrays


@kernel
def take_step(step, alpha, node_unknown, edge_unknown, position, total_angle, position_out, angle_out, total_angle_out):
    """Write x + α δx of nodes, α δθ of edges and their turn since the start of the step."""
    for i in range(node_unknown.shape[0]):
        d = node_unknown[i]
        for c in range(3):
            position_out[i, c] = position[i, c] + alpha * step[d + c]
    for k in range(edge_unknown.shape[0]):
        angle = alpha * step[edge_unknown[k]]
        angle_out[k] = angle
        total_angle_out[k] = total_angle[k] + angle


@kernel
def second_director(tangent, director1, director2_out):
    """Write m2 = t × m1."""
    for k in range(tangent.shape[0]):
        director2_out[k, 0] = tangent[k, 1] * director1[k, 2] - tangent[k, 2] * director1[k, 1]
        director2_out[k, 1] = tangent[k, 2] * director1[k, 0] - tangent[k, 0] * director1[k, 2]
        director2_out[k, 2] = tangent[k, 0] * director1[k, 1] - tangent[k, 1] * director1[k, 0]


@kernel
def attached_positions(body, local, position, rotation, arm_out, position_out):
    """Write X + R r of points r of bodies, and the arms R r [m]."""
    for k in range(body.shape[0]):
        b = body[k]
        for i in range(3):
            arm = rotation[b, i, 0] * local[k, 0] + rotation[b, i, 1] * local[k, 1] + rotation[b, i, 2] * local[k, 2]
            arm_out[k, i] = arm
            position_out[k, i] = position[b, i] + arm


@kernel
def attached_clamp_edges(body, local_tangent, local_director1, rotation, first, tangent, director1, director2):
    """Write t and m1 of clamp edges, edges from `first` on, turned with their bodies, and m2 = t × m1."""
    for k in range(body.shape[0]):
        b, w = body[k], first + k
        for i in range(3):
            tangent[w, i] = director1[w, i] = 0.0
            for j in range(3):
                tangent[w, i] += rotation[b, i, j] * local_tangent[k, j]
                director1[w, i] += rotation[b, i, j] * local_director1[w, j]
        director2[w, 0] = tangent[w, 1] * director1[w, 2] - tangent[w, 2] * director1[w, 1]
        director2[w, 1] = tangent[w, 2] * director1[w, 0] - tangent[w, 0] * director1[w, 2]
        director2[w, 2] = tangent[w, 0] * director1[w, 1] - tangent[w, 1] * director1[w, 0]


@kernel
def attached_rotations(body, local, rotation, rotation_out):
    """Write R L of matrices L of bodies."""
    for k in range(body.shape[0]):
        b = body[k]
        for i in range(3):
            for j in range(3):
                total = 0.0
                for m in range(3):
                    total += rotation[b, i, m] * local[k, m, j]
                rotation_out[k, i, j] = total


@kernel
def _update_constrained(constrained, strands, at):
    """Update the nodes and the directions of clamps that bodies hold."""
    attached_positions(
        constrained.body, constrained.position, at.pose_position, at.rotation, at.arm, at.attached_position
    )
    for k in range(constrained.node.shape[0]):
        for c in range(3):
            at.position[constrained.node[k], c] = at.attached_position[k, c]
    attached_clamp_edges(
        constrained.clamp_edge_body,
        constrained.clamp_edge_tangent,
        constrained.clamp_edge_director1,
        at.rotation,
        strands.edge_count,
        at.tangent,
        at.director1,
        at.director2,
    )


@kernel
def _update_surfaces(surfaces, at):
    """Update the points of bodies and the surfaces."""
    if not surfaces.exists:
        return
    position, rotation = at.pose_position, at.rotation
    attached_positions(surfaces.point_body, surfaces.point_position, position, rotation, at.point_arm, at.point)
    attached_positions(surfaces.body, surfaces.position, position, rotation, at.surface_arm, at.surface_position)
    attached_rotations(surfaces.body, surfaces.rotation, rotation, at.surface_rotation)


@piece(int, Problem, Configuration)
def update_attached(p, at):
    """Move the parts that bodies carry to where these are; free bodies take their place in the list of all first."""
    bodies = p.bodies
    for f in range(bodies.body_of_free.shape[0]):
        b = bodies.body_of_free[f]
        copy_row(at.body_position, f, at.pose_position, b)
        copy_matrix(at.body_rotation, f, at.rotation, b)
    _update_constrained(p.constrained, p.strands, at)
    _update_surfaces(p.surfaces, at)
    return READY


@piece(int, Problem, Configuration, Configuration)
def transport_frames(p, base, at):
    """Return the frames of `base`, carried to the positions of `at` and turned by its angles; in a plane those of
    positions.
    """
    _transport_in_space(p.space, p.strands, base, at, at.angle)
    _frames_in_plane(p.plane, p.strands, at)
    return READY


@kernel
def _transport_in_space(space, strands, base, at, angle):
    if not space.exists:
        return
    edge_geometry(at.position, strands.edge_node, at.length, at.tangent)
    transport_directors(
        strands.edge_count,
        base.tangent,
        base.director1,
        base.director2,
        angle,
        at.tangent,
        at.director1,
        at.director2,
    )


@kernel
def _frames_in_plane(plane, strands, at):
    if not plane.exists:
        return
    planar_frames(
        at.position,
        strands.edge_node,
        plane.normal,
        plane.side,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
    )


@kernel
def copy_prescribed(bodies, source_position, source_rotation, at):
    """Take the poses of prescribed bodies."""
    for k in range(bodies.prescribed.shape[0]):
        b = bodies.prescribed[k]
        copy_row(source_position, b, at.pose_position, b)
        copy_matrix(source_rotation, b, at.rotation, b)


@piece(int, Problem, Configuration, float, Stage, Configuration)
def move(p, base, alpha, stage, at):
    """Copy `base`, moved by α times the step in `System`."""
    bodies, strands, step, body_step = p.bodies, p.strands, p.system.step, p.system.body_step
    copy_prescribed(bodies, base.pose_position, base.rotation, at)
    take_step(
        step,
        alpha,
        strands.node_unknown,
        strands.edge_unknown,
        base.position,
        base.total_angle,
        at.position,
        at.angle,
        at.total_angle,
    )
    for i in range(strands.node_unknown.shape[0]):
        d = strands.node_unknown[i]
        for c in range(3):
            at.departure[i, c] = base.departure[i, c] + alpha * step[d + c]
    for b in range(bodies.mass.shape[0]):
        for c in range(3):
            at.body_position[b, c] = base.body_position[b, c] + alpha * body_step[b, c]
            at.body_departure[b, c] = base.body_departure[b, c] + alpha * body_step[b, c]
        v0, v1, v2 = alpha * body_step[b, 3], alpha * body_step[b, 4], alpha * body_step[b, 5]
        rotate_by(v0, v1, v2, base.body_rotation, b, at.body_rotation, b)
        compose_quaternion(v0, v1, v2, base.body_departure_quaternion, at.body_departure_quaternion, b)
    update_attached(p, at)
    departure_of_constrained(p.constrained, stage, at)
    transport_frames(p, base, at)
    return READY


@kernel
def departure_of_constrained(constrained, stage, at):
    """Write the departure of nodes that bodies hold: that of a free body, and of the arm R̃ r with it; a prescribed one
    has digits to spare, because its inertia moves nothing.
    """
    for k in range(constrained.node.shape[0]):
        f, i = constrained.free[k], constrained.node[k]
        if f < 0:
            for c in range(3):
                at.departure[i, c] = at.position[i, c] - stage.predicted_position[i, c]
            continue
        u = stage.attached_arm[k, 0], stage.attached_arm[k, 1], stage.attached_arm[k, 2]
        turned = rotated_by(at.body_departure_quaternion, f, u[0], u[1], u[2])
        for c in range(3):
            at.departure[i, c] = at.body_departure[f, c] + turned[c] + stage.attached_lag[k, c]


@kernel
def clear_departure(at):
    """Clear the departure: everything is where inertia takes it."""
    at.departure[:] = 0.0
    at.body_departure[:] = 0.0
    at.body_departure_quaternion[:] = 0.0


@kernel
def measure_departure(bodies, stage, at):
    """Measure how far a configuration that was not moved is from where inertia takes everything: to last digits of its
    positions.
    """
    for i in range(at.position.shape[0]):
        for c in range(3):
            at.departure[i, c] = at.position[i, c] - stage.predicted_position[i, c]
    for f in range(bodies.mass.shape[0]):
        for c in range(3):
            at.body_departure[f, c] = at.body_position[f, c] - stage.predicted_body_position[f, c]
            at.body_departure_quaternion[f, c] = 0.0
        x, y, z = rotation_vector_between(stage.predicted_body_rotation, f, at.body_rotation, f)
        compose_quaternion(x, y, z, at.body_departure_quaternion, at.body_departure_quaternion, f)


@piece(int, Problem, StateArrays, Configuration)
def take_state(p, state, at):
    """Start from a state."""
    bodies, strands = p.bodies, p.strands
    copy(state.position, at.position)
    copy(state.memory, p.memory)
    clear_departure(at)
    for k in range(strands.edge_count):
        at.total_angle[k] = 0.0
        for c in range(3):
            at.director1[k, c] = state.director1[k, c]
    for k in range(state.twist.shape[0]):
        at.joint_strain[k, 2] = state.twist[k]
    for f in range(bodies.mass.shape[0]):
        copy_row(state.body_position, bodies.body_of_free[f], at.body_position, f)
        copy_matrix(state.body_rotation, bodies.body_of_free[f], at.body_rotation, f)
    copy_prescribed(bodies, state.body_position, state.body_rotation, at)
    update_attached(p, at)
    edge_geometry(at.position, strands.edge_node, at.length, at.tangent)
    second_director(at.tangent, at.director1, at.director2)
    return READY
