"""Where everything is: frames, and what bodies carry. The compiled form of `solve.configuration`."""

from __future__ import annotations

from ..jit import inner
from ..kinematics.frames import edge_geometry, planar_frames, transport_directors
from ..kinematics.turning import turn_by
from ..solve.configuration import carry_points, carry_turns, carry_walls, second_director, take_step
from .copying import copy, copy_matrix, copy_row


@inner
def put_held(held, strands, at):
    """Nodes and clamps' directions that bodies hold."""
    carry_points(held.body, held.position, at.place, at.rotation, at.arm, at.held)
    for k in range(held.node.shape[0]):
        for c in range(3):
            at.position[held.node[k], c] = at.held[k, c]
    carry_walls(
        held.wall_body,
        held.wall_tangent,
        held.wall_director1,
        at.rotation,
        strands.edge_count,
        at.tangent,
        at.director1,
        at.director2,
    )


@inner
def put_surfaces(surfaces, at):
    """Points of bodies and surfaces."""
    if surfaces is None:
        return
    carry_points(surfaces.point_body, surfaces.point_position, at.place, at.rotation, at.point_arm, at.point)
    carry_points(surfaces.body, surfaces.position, at.place, at.rotation, at.surface_arm, at.surface_place)
    carry_turns(surfaces.body, surfaces.turn, at.rotation, at.surface_turn)


@inner
def put_carried(bodies, held, surfaces, strands, at):
    """What bodies carry, to where these are: free ones take their place in the list of all first."""
    for f in range(bodies.body_of_free.shape[0]):
        b = bodies.body_of_free[f]
        copy_row(at.body_position, f, at.place, b)
        copy_matrix(at.body_rotation, f, at.rotation, b)
    put_held(held, strands, at)
    put_surfaces(surfaces, at)


@inner
def carry_frames(space, plane, strands, base, at, angle):
    """Frames of `base`, carried to the present positions and turned by `angle` [rad]; in a plane those of positions."""
    _carry_in_space(space, strands, base, at, angle)
    _carry_in_plane(plane, strands, at)


@inner
def _carry_in_space(space, strands, base, at, angle):
    if space is None:
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


@inner
def _carry_in_plane(plane, strands, at):
    if plane is None:
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


@inner
def copy_prescribed(bodies, source_place, source_rotation, at):
    """Take the poses of prescribed bodies."""
    for k in range(bodies.prescribed.shape[0]):
        b = bodies.prescribed[k]
        copy_row(source_place, b, at.place, b)
        copy_matrix(source_rotation, b, at.rotation, b)


@inner
def move(bodies, held, surfaces, space, plane, strands, base, step, body_step, alpha, at):
    """Become `base` moved by α times a step of the unknowns and of free bodies."""
    copy_prescribed(bodies, base.place, base.rotation, at)
    take_step(
        step,
        alpha,
        strands.node_unknown,
        strands.edge_unknown,
        base.position,
        base.turn,
        at.position,
        at.angle,
        at.turn,
    )
    for b in range(bodies.mass.shape[0]):
        for c in range(3):
            at.body_position[b, c] = base.body_position[b, c] + alpha * body_step[b, c]
        turn_by(
            alpha * body_step[b, 3],
            alpha * body_step[b, 4],
            alpha * body_step[b, 5],
            base.body_rotation,
            b,
            at.body_rotation,
            b,
        )
    put_carried(bodies, held, surfaces, strands, at)
    carry_frames(space, plane, strands, base, at, at.angle)


@inner
def take_state(bodies, held, surfaces, strands, state, at):
    """Start from a state."""
    copy(state.position, at.position)
    for k in range(strands.edge_count):
        at.turn[k] = 0.0
        for c in range(3):
            at.director1[k, c] = state.director1[k, c]
    for k in range(state.twist.shape[0]):
        at.joint_strain[k, 2] = state.twist[k]
    for f in range(bodies.mass.shape[0]):
        copy_row(state.body_position, bodies.body_of_free[f], at.body_position, f)
        copy_matrix(state.body_rotation, bodies.body_of_free[f], at.body_rotation, f)
    copy_prescribed(bodies, state.body_position, state.body_rotation, at)
    put_carried(bodies, held, surfaces, strands, at)
    edge_geometry(at.position, strands.edge_node, at.length, at.tangent)
    second_director(at.tangent, at.director1, at.director2)
