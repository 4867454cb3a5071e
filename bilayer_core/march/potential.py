"""The incremental potential of one implicit step: the sum of all forces that a scene needs, and its gradient."""

from __future__ import annotations

import math

from ..jit import inner
from ..solve.assembly import expand_gradient
from ..solve.clamps import hand_gradient_to_bodies
from .contact import add_contact, clear_contact, hand_on_contact, lag_sliding, list_pairs
from .copying import copy
from .elasticity import add_in_plane, add_in_space, take_rest
from .fluid import add_drag, add_fluid, turn_drag, turn_fluid
from .inertia import add_inertia
from .loads import FOLLOWERS, LOADS, add_loads, add_moments, scale_loads, turn_followers, turn_moments
from .status import NO_ROOM_FOR_RODS, READY
from .threads import add_threads, lag_threads


@inner
def start_stage(p, start, stage):
    """Freeze what a stage depends on: near pairs, friction's contacts, loads. Returns whether a loop can go on."""
    status, _ = list_pairs(p.surfaces, start, 0.0)
    if status != READY:
        return status
    if not lag_threads(p.threads, p.strands, start):
        return NO_ROOM_FOR_RODS
    lag_sliding(p.sliding, p.surfaces, start, stage)
    scale_loads(p.loads, stage.load_factor)
    take_rest(p.off_axis, stage)
    return READY


@inner
def follow(p, at, stage):
    """Let forces take from a configuration what they hold fixed between moves; whether any does."""
    moved = turn_followers(p.followers, stage.load_factor, at)
    moved |= turn_moments(p.moments, stage.load_factor, at)
    moved |= turn_drag(p.flow, at)
    moved |= turn_fluid(p.fluid, p.strands, at, stage)
    return moved


@inner
def evaluate(p, at, stage, with_hessian, again):
    """Potential at a configuration [J], infinite behind a surface, and the smallest gap to a surface or a rod [m].

    Gradients always, second derivatives on request, are left in `Sums`. The contacts of rods are those found last. With
    `again` the configuration is that of the last evaluation, and only what `follow` has changed since is found anew,
    without second derivatives and the gap.
    """
    gap = add_forces(p, at, stage, with_hessian, again)
    expand(p, at)
    energy = 0.0
    for k in range(p.sums.energy.shape[0]):
        energy += p.sums.energy[k]
    return energy, gap


@inner
def add_forces(p, at, stage, with_hessian, again):
    """Energies and first derivatives by nodes, edges, pairs and bodies, second ones on request; parameters as for
    `evaluate`. Returns the smallest gap [m].
    """
    strands, bodies, sums = p.strands, p.bodies, p.sums
    gap = math.inf
    if again:
        copy(sums.lasting, sums.first)
    else:
        sums.energy[:] = 0.0
        sums.first[:] = 0.0
        if with_hessian:
            sums.second[:] = 0.0
            sums.links[0] = 0
        add_in_space(p.space, p.off_axis, p.bonds, strands, at, stage, sums, with_hessian)
        add_in_plane(p.plane, p.off_axis, p.bonds, strands, at, stage, sums, with_hessian)
        add_inertia(p.gravity, p.damping, p.border, strands, bodies, at, stage, sums, with_hessian)
        add_loads(p.loads, at, sums, LOADS)
        clear_contact(p.meets, sums)
        gap = add_contact(p.surfaces, p.sliding, bodies, at, stage, sums, with_hessian)
        gap = min(gap, add_threads(p.threads, strands, at, stage, sums))
        hand_on_contact(p.meets, bodies, sums)
        _keep_lasting(p.followers, p.moments, p.flow, p.fluid, sums)
    add_loads(p.followers, at, sums, FOLLOWERS)
    add_moments(p.moments, at, stage, sums, with_hessian)
    add_drag(p.flow, at, stage, sums, with_hessian)
    add_fluid(p.fluid, strands, at, stage, sums, with_hessian)
    return gap


@inner
def _keep_lasting(followers, moments, flow, fluid, sums):
    """Keep what stays as it is when other parts follow the configuration, if any does."""
    if followers is None and moments is None and flow is None and fluid is None:
        return
    copy(sums.first, sums.lasting)


@inner
def expand(p, at):
    """First derivatives from nodes, edges, pairs and bodies to the unknowns."""
    held, strands, sums = p.held, p.strands, p.sums
    _expand_edges(p.bonds, strands, sums)
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
