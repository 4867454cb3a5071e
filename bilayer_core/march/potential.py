"""The incremental potential in one compiled function: the sum of `solve.potential` without the interpreter."""

from __future__ import annotations

import math

from ..contact.near import list_near, moved_since
from ..forces.added_mass import added_mass, fluid_momentum
from ..forces.bend_twist import bend_twist
from ..forces.body import body_spring
from ..forces.contact import surface_contact
from ..forces.coupling import bond_translation
from ..forces.drag import drag, node_directions
from ..forces.friction import friction, lag_axes, lag_friction
from ..forces.load import body_moment, point_force
from ..forces.planar import (
    in_plane_frames,
    planar_bend,
    planar_bond,
    planar_stretch,
    planar_stretch_bend,
    polar_to_edges,
)
from ..forces.quadratic import angle_spring, gravity, node_spring
from ..forces.stretch import stretch
from ..forces.stretch_bend import natural_curvature, stretch_bend
from ..jit import inner, part
from ..kinematics.turning import product_transposed
from ..solve.assembly import expand_gradient
from ..solve.clamps import hand_gradient_to_bodies
from .copying import copy, copy_matrix
from .threads import rods_touch

TERMS = (
    "stretching",
    "bending",
    "twisting",
    "bond",
    "inertia",
    "damping",
    "gravity",
    "loads",
    "followers",
    "moments",
    "drag",
    "added mass",
    "barrier",
    "friction",
)
"""Places of energies in `Sums.energy`, in the order of the sum."""
READY, NO_ROOM, RODS_FAR, RODS_TOUCH, JUMPED = 0, 1, 2, 3, 4
"""What keeps a loop from going on by itself: no room for near pairs, rods that have moved farther than their list of
near pairs reaches, rods that touch, a jump that asks for another integrator.
"""


# elasticity, inertia, bodies


@inner
def _add_in_space(space, off_axis, bonds, strands, at, stage, sums, with_hessian):
    """Stretching, bending, twisting and bonds of dimension 3."""
    if space is None:
        return
    sums.energy[0] = stretch(
        strands.axial_stiffness,
        strands.rest_length,
        stage.rest_edge,
        at.length,
        at.tangent,
        sums.edge,
        sums.edge_hessian,
        with_hessian,
    )
    sums.energy[1], sums.energy[2] = bend_twist(
        strands.first_bend,
        strands.bend_count,
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        _rest_of_joints(off_axis, strands, at, stage),
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        stage.twist,
        at.joint_strain,
        sums.edge,
        sums.edge_hessian,
        sums.cross_hessian,
        with_hessian,
    )
    _add_off_axis(off_axis, strands, at, sums, with_hessian)
    _add_bonds(bonds, space, strands, at, stage, sums, with_hessian)


@inner
def _rest_of_joints(off_axis, strands, at, stage):
    if off_axis is None:
        return stage.rest_joint
    copy(stage.rest_joint, off_axis.rest_out)
    natural_curvature(
        off_axis.joint,
        off_axis.coupling,
        strands.joint_a,
        strands.joint_b,
        strands.rest_length,
        at.length,
        stage.rest_joint,
        off_axis.rest_out,
    )
    return off_axis.rest


@inner
def _add_off_axis(off_axis, strands, at, sums, with_hessian):
    if off_axis is None:
        return
    stretch_bend(
        off_axis.joint,
        off_axis.coupling,
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        off_axis.rest,
        at.joint_strain,
        strands.rest_length,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        sums.edge,
        sums.edge_hessian,
        sums.cross_hessian,
        with_hessian,
    )


@inner
def _add_in_plane(plane, off_axis, bonds, strands, at, stage, sums, with_hessian):
    """Stretching, bending and bonds of dimension 2."""
    if plane is None:
        return
    plane.polar_gradient[:] = 0.0
    in_plane_frames(strands.axes, at.length, at.tangent, plane.frame)
    sums.energy[0] = planar_stretch(
        strands.axial_stiffness,
        strands.rest_length,
        stage.rest_edge,
        at.length,
        plane.polar_gradient,
        plane.polar_hessian,
        with_hessian,
    )
    rest = _rest_of_joints(off_axis, strands, at, stage)
    sums.energy[1] = planar_bend(
        strands.first_bend,
        strands.bend_count,
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        rest,
        plane.side,
        plane.frame,
        at.joint_strain,
        plane.polar_gradient,
        plane.polar_hessian,
        sums.cross_hessian,
        with_hessian,
    )
    _add_off_axis_in_plane(plane, off_axis, strands, at, sums, with_hessian)
    _add_bonds_in_plane(plane, bonds, strands, at, stage, sums, with_hessian)
    polar_to_edges(strands.axes, plane.frame, plane.polar_gradient, sums.edge)


@inner
def _add_off_axis_in_plane(plane, off_axis, strands, at, sums, with_hessian):
    if off_axis is None:
        return
    planar_stretch_bend(
        off_axis.joint,
        off_axis.coupling,
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        off_axis.rest,
        at.joint_strain,
        strands.rest_length,
        plane.side,
        plane.frame,
        plane.polar_gradient,
        plane.polar_hessian,
        sums.cross_hessian,
        with_hessian,
    )


@inner
def _add_bonds_in_plane(plane, bonds, strands, at, stage, sums, with_hessian):
    if bonds is None:
        return
    rotation = planar_bend(
        strands.bend_count,
        strands.joint_a.shape[0],
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        stage.rest_joint,
        plane.side,
        plane.frame,
        at.joint_strain,
        plane.polar_gradient,
        plane.polar_hessian,
        sums.cross_hessian,
        with_hessian,
    )
    sums.energy[3] = rotation + planar_bond(
        strands.bend_count,
        strands.axes,
        at.position,
        strands.edge_node,
        bonds.top,
        bonds.bottom,
        bonds.stiffness,
        bonds.rest,
        plane.side,
        plane.frame,
        plane.polar_gradient,
        plane.polar_hessian,
        sums.cross_hessian,
        sums.pair,
        sums.pair_hessian,
        plane.mixed_hessian,
        with_hessian,
    )


@inner
def _add_bonds(bonds, space, strands, at, stage, sums, with_hessian):
    if bonds is None:
        return
    bending, twisting = bend_twist(
        strands.bend_count,
        strands.joint_a.shape[0],
        strands.joint_a,
        strands.joint_b,
        strands.joint_stiffness,
        stage.rest_joint,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        stage.twist,
        at.joint_strain,
        sums.edge,
        sums.edge_hessian,
        sums.cross_hessian,
        with_hessian,
    )
    translation = bond_translation(
        at.position,
        strands.edge_node,
        bonds.top,
        bonds.bottom,
        bonds.stiffness,
        bonds.rest,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        sums.edge,
        sums.edge_hessian,
        sums.pair,
        sums.pair_hessian,
        space.top_hessian,
        space.bottom_hessian,
        space.bond_hessian,
        with_hessian,
    )
    sums.energy[3] = bending + twisting + translation


@inner
def _add_inertia_of_bodies(border, bodies, factor, at, stage, sums, with_hessian):
    if border is None:
        return 0.0
    return body_spring(
        bodies.mass,
        bodies.second_moment,
        factor,
        at.body_position,
        at.body_rotation,
        stage.predicted_body_position,
        stage.predicted_body_rotation,
        sums.body,
        sums.body_hessian,
        with_hessian,
    )


@inner
def _add_inertia(gravitation, damping, border, strands, bodies, at, stage, sums, with_hessian):
    factor = 1.0 / (stage.lengths[0] * stage.lengths[1])
    energy = node_spring(strands.node_mass, factor, at.position, stage.predicted_position, sums.node)
    energy += angle_spring(strands.spin_inertia, factor, at.turn, stage.predicted_turn, sums.edge)
    energy += _add_inertia_of_bodies(border, bodies, factor, at, stage, sums, with_hessian)
    sums.energy[4] = energy
    if damping > 0.0:
        factor = damping / stage.lengths[0]
        energy = node_spring(strands.node_mass, factor, at.position, stage.origin_position, sums.node)
        energy += angle_spring(strands.spin_inertia, factor, at.turn, stage.origin_turn, sums.edge)
        sums.energy[5] = energy
    if gravitation[0] != 0.0 or gravitation[1] != 0.0 or gravitation[2] != 0.0:
        energy = gravity(strands.node_mass, gravitation, at.position, sums.node)
        energy += gravity(bodies.mass, gravitation, at.body_position, sums.body)
        sums.energy[6] = energy


# loads


@inner
def _scale_loads(loads, load_factor):
    """Dead loads, by their present factors."""
    if loads is None:
        return
    for k in range(loads.node.shape[0]):
        for c in range(3):
            loads.on_nodes[k, c] = load_factor[loads.node_load[k]] * loads.node_vector[k, c]
    for k in range(loads.body.shape[0]):
        for c in range(3):
            loads.on_bodies[k, c] = load_factor[loads.body_load[k]] * loads.body_vector[k, c]


@inner
def _add_loads(loads, at, sums, place):
    if loads is None:
        return
    energy = point_force(loads.node, loads.on_nodes, at.position, sums.node)
    sums.energy[place] = energy + point_force(loads.body, loads.on_bodies, at.body_position, sums.body)


@inner
def _turn_followers(loads, load_factor, at):
    """Followers take the directions of a configuration; whether there are any."""
    if loads is None:
        return False
    if loads.node.shape[0] + loads.body.shape[0] == 0:
        return False
    node_directions(loads.node, loads.edge_before, loads.edge_after, at.tangent, at.director1, loads.direction)
    for k in range(loads.node.shape[0]):
        factor = load_factor[loads.node_load[k]]
        for c in range(3):
            loads.on_nodes[k, c] = 0.0
            for a in range(3):
                loads.on_nodes[k, c] += factor * loads.node_vector[k, a] * loads.direction[k, a, c]
    for k in range(loads.body.shape[0]):
        f, factor = loads.body[k], load_factor[loads.body_load[k]]
        for c in range(3):
            loads.on_bodies[k, c] = 0.0
            for a in range(3):
                loads.on_bodies[k, c] += factor * at.body_rotation[f, c, a] * loads.body_vector[k, a]
    return True


@inner
def _turn_moments(moments, load_factor, at):
    """Moments, those that follow in the axes of their bodies; whether any does."""
    if moments is None:
        return False
    count = moments.body.shape[0]
    for k in range(count):
        factor, f = load_factor[moments.load[k]], moments.body[k]
        for c in range(3):
            if k < moments.dead:
                moments.present[k, c] = factor * moments.vector[k, c]
                continue
            moments.present[k, c] = 0.0
            for a in range(3):
                moments.present[k, c] += factor * at.body_rotation[f, c, a] * moments.vector[k, a]
    return count > moments.dead


@inner
def _add_moments(moments, at, stage, sums, with_hessian):
    if moments is None:
        return
    sums.energy[9] = body_moment(
        moments.body,
        moments.present,
        at.body_rotation,
        stage.predicted_body_rotation,
        sums.body,
        sums.body_hessian,
        with_hessian,
    )


# fluid


@inner
def _turn_drag(flow, at):
    if flow is None:
        return False
    node_directions(flow.node, flow.edge_before, flow.edge_after, at.tangent, at.director1, flow.direction)
    return flow.node.shape[0] > 0


@inner
def _add_drag(flow, at, stage, sums, with_hessian):
    if flow is None:
        return
    sums.energy[10] = drag(
        flow.node,
        flow.coefficient,
        flow.direction,
        flow.velocity,
        stage.lengths[0],
        at.position,
        stage.origin_position,
        sums.node,
        sums.node_hessian,
        with_hessian,
    )


@inner
def _turn_fluid(fluid, strands, at, stage):
    if fluid is None:
        return False
    velocity = fluid.node_velocity
    if velocity.shape[0] == 0:
        return False
    for i in range(velocity.shape[0]):
        for c in range(3):
            velocity[i, c] = (at.position[i, c] - stage.origin_position[i, c]) / stage.lengths[0]
    survey(fluid, strands, at, velocity, fluid.momentum)
    for k in range(fluid.direction1.shape[0]):
        for c in range(3):
            fluid.direction1[k, c], fluid.direction2[k, c] = at.director1[k, c], at.director2[k, c]
    return True


@inner
def survey(fluid, strands, at, velocity, momentum_out):
    """Momentum of the fluid at nodes with given velocities [N s], shape (n_node, 3); ∂T/∂q is left in the group."""
    if fluid is None:
        return
    fluid_momentum(
        fluid.mass,
        strands.edge_node,
        at.length,
        at.tangent,
        at.director1,
        at.director2,
        fluid.velocity,
        velocity,
        fluid.still,
        momentum_out,
        fluid.shape_gradient,
    )


@inner
def _add_fluid(fluid, strands, at, stage, sums, with_hessian):
    if fluid is None:
        return
    sums.energy[11] = added_mass(
        fluid.mass,
        strands.edge_node,
        fluid.direction1,
        fluid.direction2,
        fluid.shape_gradient,
        stage.origin_fluid_momentum,
        fluid.velocity,
        stage.lengths[0],
        stage.lengths[1],
        at.position,
        stage.origin_position,
        at.turn,
        stage.predicted_turn,
        sums.node,
        sums.node_hessian,
        sums.edge,
        sums.edge_hessian,
        with_hessian,
    )


# contact


@inner
def list_pairs(surfaces, at, motion):
    """Make the list of near pairs valid at a configuration and whatever can be reached from it by `motion` [m]."""
    if surfaces is None:
        return READY
    moved = moved_since(
        at.carrier,
        surfaces.listed_carrier,
        at.surface_place,
        surfaces.listed_place,
        at.surface_turn,
        surfaces.listed_turn,
        surfaces.extent,
    )
    if moved + motion <= surfaces.margin[0]:
        return READY
    margin = max(surfaces.d_hat, MOTION_MARGIN * motion)
    count = list_near(
        surfaces.d_hat,
        margin,
        surfaces.kind,
        surfaces.size,
        surfaces.rounding,
        surfaces.bound,
        at.surface_place,
        at.surface_turn,
        surfaces.radius,
        surfaces.group,
        surfaces.meets,
        at.carrier,
        surfaces.near_carrier,
        surfaces.near_surface,
        surfaces.extent,
    )
    if count > surfaces.near_carrier.shape[0]:
        surfaces.margin[0] = -1.0
        surfaces.near_count[0] = 0
        return NO_ROOM
    surfaces.near_count[0] = count
    surfaces.margin[0] = margin
    copy(at.carrier, surfaces.listed_carrier)
    copy(at.surface_place, surfaces.listed_place)
    copy(at.surface_turn, surfaces.listed_turn)
    return READY


MOTION_MARGIN = 4.0
"""Margin of a list, in units of the motion that demands it."""


@inner
def _add_barrier(surfaces, bodies, at, sums, with_hessian):
    """Barrier of carriers against surfaces; returns the smallest gap [m]."""
    if surfaces is None:
        return math.inf
    sums.energy[12], gap, sums.links[0] = surface_contact(
        surfaces.d_hat,
        surfaces.stiffness,
        surfaces.near_count[0],
        surfaces.near_carrier,
        surfaces.near_surface,
        at.carrier,
        surfaces.radius,
        surfaces.weight,
        surfaces.carrier_body,
        surfaces.kind,
        surfaces.size,
        surfaces.rounding,
        at.surface_place,
        at.surface_turn,
        surfaces.body,
        at.place,
        bodies.free_index,
        sums.carrier,
        sums.contact,
        surfaces.near_gap,
        sums.node_hessian,
        sums.body_hessian,
        sums.links[0],
        sums.link_node,
        sums.link_body,
        sums.link_hessian,
        with_hessian,
    )
    return gap


@inner
def _lag_sliding(sliding, surfaces, start, stage):
    """Contacts at the start of a stage, for friction."""
    if sliding is None:
        return
    if not sliding.acts:
        return
    for b in range(start.rotation.shape[0]):
        copy_matrix(start.rotation, b, sliding.back, b)
        product_transposed(stage.origin_rotation, b, sliding.back, b, sliding.origin_turn, b)
    sliding.count[0] = lag_friction(
        surfaces.d_hat,
        surfaces.stiffness,
        surfaces.near_count[0],
        surfaces.near_carrier,
        surfaces.near_surface,
        start.carrier,
        surfaces.radius,
        surfaces.weight,
        surfaces.carrier_body,
        surfaces.kind,
        surfaces.size,
        surfaces.rounding,
        start.surface_place,
        start.surface_turn,
        surfaces.body,
        start.place,
        sliding.first,
        sliding.surface,
        sliding.load,
        sliding.normal,
        sliding.arm,
        sliding.lever,
    )
    lag_axes(
        sliding.count[0],
        sliding.first,
        sliding.normal,
        sliding.node_edges,
        sliding.node_axis,
        start.tangent,
        start.director1,
        sliding.axis,
    )


@inner
def _add_sliding(sliding, surfaces, bodies, at, stage, sums, with_hessian):
    if sliding is None:
        return
    if not sliding.acts:
        return
    for b in range(at.rotation.shape[0]):
        product_transposed(at.rotation, b, sliding.back, b, sliding.turn, b)
    sums.energy[13], sums.links[0] = friction(
        sliding.count[0],
        sliding.first,
        sliding.surface,
        sliding.load,
        sliding.normal,
        sliding.axis,
        sliding.arm,
        sliding.lever,
        sliding.coefficient,
        stage.lengths[0],
        sliding.threshold,
        at.position,
        stage.origin_position,
        surfaces.carrier_body,
        surfaces.body,
        at.place,
        stage.origin_place,
        sliding.turn,
        sliding.origin_turn,
        bodies.free_index,
        sums.carrier,
        sums.contact,
        sums.node_hessian,
        sums.body_hessian,
        sums.links[0],
        sums.link_node,
        sums.link_body,
        sums.link_hessian,
        with_hessian,
    )


# the sum


@part
def start_stage(p, start, stage):
    """Freeze what a stage depends on: near pairs, friction's contacts, loads. Returns whether a loop can go on."""
    status = list_pairs(p.surfaces, start, 0.0)
    if status != READY:
        return status
    if rods_touch(p.threads, p.strands, start):
        return RODS_TOUCH
    _lag_sliding(p.sliding, p.surfaces, start, stage)
    _scale_loads(p.loads, stage.load_factor)
    return READY


@inner
def follow(p, at, stage):
    """Let forces take from a configuration what they hold fixed between moves; whether any does."""
    moved = _turn_followers(p.followers, stage.load_factor, at)
    moved |= _turn_moments(p.moments, stage.load_factor, at)
    moved |= _turn_drag(p.flow, at)
    moved |= _turn_fluid(p.fluid, p.strands, at, stage)
    return moved


@part
def evaluate(p, at, stage, with_hessian):
    """Potential at a configuration [J], infinite behind a surface, and the smallest gap to a surface [m].

    Gradients always, second derivatives on request, are left in `Sums`.
    """
    strands, bodies, sums = p.strands, p.bodies, p.sums
    sums.energy[:] = 0.0
    sums.first[:] = 0.0
    if with_hessian:
        sums.second[:] = 0.0
        sums.links[0] = 0
    _add_in_space(p.space, p.off_axis, p.bonds, strands, at, stage, sums, with_hessian)
    _add_in_plane(p.plane, p.off_axis, p.bonds, strands, at, stage, sums, with_hessian)
    _add_inertia(p.gravity, p.damping, p.border, strands, bodies, at, stage, sums, with_hessian)
    _add_loads(p.loads, at, sums, 7)
    _add_loads(p.followers, at, sums, 8)
    _add_moments(p.moments, at, stage, sums, with_hessian)
    _add_drag(p.flow, at, stage, sums, with_hessian)
    _add_fluid(p.fluid, strands, at, stage, sums, with_hessian)
    gap = _add_contact(p.surfaces, p.sliding, bodies, at, stage, sums, with_hessian)
    _expand(p.bonds, p.held, strands, at, sums)
    energy = 0.0
    for k in range(sums.energy.shape[0]):
        energy += sums.energy[k]
    return energy, gap


@inner
def _add_contact(surfaces, sliding, bodies, at, stage, sums, with_hessian):
    """Barrier and friction, which sum apart from other forces; returns the smallest gap [m]."""
    if surfaces is None:
        return math.inf
    sums.carrier[:] = 0.0
    sums.contact[:] = 0.0
    gap = _add_barrier(surfaces, bodies, at, sums, with_hessian)
    _add_sliding(sliding, surfaces, bodies, at, stage, sums, with_hessian)
    for i in range(sums.node.shape[0]):
        for c in range(3):
            sums.node[i, c] += sums.carrier[i, c]
    for f in range(bodies.body_of_free.shape[0]):
        for c in range(6):
            sums.body[f, c] += sums.contact[bodies.body_of_free[f], c]
    return gap


@inner
def _expand(bonds, held, strands, at, sums):
    """From nodes, edges, pairs and bodies to the unknowns."""
    _expand_edges(bonds, strands, sums)
    hand_gradient_to_bodies(
        held.unknown,
        held.free,
        at.arm,
        held.wall_free,
        at.tangent,
        sums.edge,
        strands.edge_count,
        sums.gradient,
        sums.attached,
        sums.body,
    )


@inner
def _expand_edges(bonds, strands, sums):
    top = strands.joint_a[:0] if bonds is None else bonds.top
    bottom = strands.joint_a[:0] if bonds is None else bonds.bottom
    expand_gradient(
        strands.edge_node,
        strands.node_unknown,
        strands.edge_unknown,
        top,
        bottom,
        sums.edge,
        sums.pair,
        sums.node,
        sums.gradient,
    )
