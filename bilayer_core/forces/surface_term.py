"""Barrier and friction of carriers against surfaces, and the list of those near each other."""

from __future__ import annotations

import math

from ..contact.near import list_near, moved_since
from ..jit import kernel, piece
from ..kinematics.copying import copy, copy_matrix
from ..kinematics.turning import product_transposed
from ..model.force_places import place_of
from ..model.records.parts import Surfaces
from ..model.records.problem import Problem
from ..model.records.status import NO_ROOM, READY
from ..model.records.step import Place, Stage
from .contact import surface_contact
from .friction import friction, lag_axes, lag_friction

BARRIER, FRICTION = map(place_of, ("barrier", "friction"))
MOTION_MARGIN = 4.0
"""Margin of a list, in units of the motion that demands it."""


@kernel
def list_pairs(surfaces, at, motion):
    """Make the list of near pairs valid at a configuration and whatever can be reached from it by `motion` [m].

    Returns a status, and whether the list was made anew.
    """
    if not surfaces.exists:
        return READY, False
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
        return READY, False
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
        return NO_ROOM, True
    surfaces.near_count[0] = count
    surfaces.margin[0] = margin
    copy(at.carrier, surfaces.listed_carrier)
    copy(at.surface_place, surfaces.listed_place)
    copy(at.surface_turn, surfaces.listed_turn)
    return READY, True


@kernel
def _add_barrier(surfaces, bodies, at, sums, with_hessian):
    """Barrier of carriers against surfaces; returns the smallest gap [m]."""
    if not surfaces.exists:
        return math.inf
    if not sums.selected[BARRIER]:
        return math.inf
    sums.energy[BARRIER], gap, sums.links[0] = surface_contact(
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
        surfaces.free_index,
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


@kernel
def lag_sliding(sliding, surfaces, start, stage):
    """Contacts at the start of a stage, for friction."""
    if not sliding.exists:
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


@kernel
def _add_sliding(sliding, surfaces, bodies, at, stage, sums, with_hessian):
    if not sliding.exists:
        return
    if not (sliding.acts and sums.selected[FRICTION]):
        return
    for b in range(at.rotation.shape[0]):
        product_transposed(at.rotation, b, sliding.back, b, sliding.turn, b)
    sums.energy[FRICTION], sums.links[0] = friction(
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
        surfaces.free_index,
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


@kernel
def add_contact(surfaces, sliding, bodies, at, stage, sums, with_hessian):
    """Barrier and friction against surfaces; returns the smallest gap [m]."""
    gap = _add_barrier(surfaces, bodies, at, sums, with_hessian)
    _add_sliding(sliding, surfaces, bodies, at, stage, sums, with_hessian)
    return gap


@kernel
def clear_contact(meets, sums):
    """Contact sums apart from other forces."""
    if not meets:
        return
    sums.carrier[:] = 0.0
    sums.contact[:] = 0.0


@kernel
def hand_on_contact(meets, bodies, sums):
    """Nodes and free bodies take their share of contact."""
    if not meets:
        return
    for i in range(sums.node.shape[0]):
        for c in range(3):
            sums.node[i, c] += sums.carrier[i, c]
    for f in range(bodies.body_of_free.shape[0]):
        for c in range(6):
            sums.body[f, c] += sums.contact[bodies.body_of_free[f], c]


@piece(float, Surfaces, Problem, Place, Stage, bool)
def add_surface_contact(surfaces, p, at, stage, with_hessian):
    """Barrier and friction of carriers against surfaces."""
    return add_contact(surfaces, p.sliding, p.bodies, at, stage, p.sums, with_hessian)


@piece(int, Surfaces, Problem, Place, Stage)
def start_surface_contact(surfaces, p, start, stage):
    """Near pairs, and the contacts of friction."""
    status, _ = list_pairs(surfaces, start, 0.0)
    if status == READY:
        lag_sliding(p.sliding, surfaces, start, stage)
    return status
