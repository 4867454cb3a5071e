"""Drag and added mass."""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..model.force_places import place_of
from ..model.records.parts import Flow, Fluid
from ..model.records.problem import Problem
from ..model.records.step import Place, Stage
from .added_mass import added_mass, fluid_momentum
from .drag import drag, node_directions

DRAG, ADDED_MASS = map(place_of, ("drag", "added mass"))


@kernel
def turn_drag(flow, at):
    if not flow.exists:
        return False
    node_directions(flow.node, flow.edge_before, flow.edge_after, at.tangent, at.director1, flow.direction)
    return flow.node.shape[0] > 0


@kernel
def add_drag(flow, at, stage, sums, with_hessian):
    if not flow.exists:
        return
    if not sums.selected[DRAG]:
        return
    sums.energy[DRAG] = drag(
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


@kernel
def turn_fluid(fluid, strands, at, stage):
    if not fluid.exists:
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


@kernel
def survey(fluid, strands, at, velocity, momentum_out):
    """Momentum of the fluid at nodes with given velocities [N s], shape (n_node, 3); ∂T/∂q is left in the group."""
    if not fluid.exists:
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


@kernel
def add_fluid(fluid, strands, at, stage, sums, with_hessian):
    if not fluid.exists:
        return
    if not sums.selected[ADDED_MASS]:
        return
    sums.energy[ADDED_MASS] = added_mass(
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


@piece(float, Flow, Problem, Place, Stage, bool)
def add_drag_of_nodes(flow, p, at, stage, with_hessian):
    """Quadratic drag."""
    add_drag(flow, at, stage, p.sums, with_hessian)
    return math.inf


@piece(bool, Flow, Problem, Place, Stage)
def follow_with_drag(flow, p, at, stage):
    """Take the directions of drag from a configuration."""
    return turn_drag(flow, at)


@piece(float, Fluid, Problem, Place, Stage, bool)
def add_mass_of_fluid(fluid, p, at, stage, with_hessian):
    """Added mass."""
    add_fluid(fluid, p.strands, at, stage, p.sums, with_hessian)
    return math.inf


@piece(bool, Fluid, Problem, Place, Stage)
def follow_with_fluid(fluid, p, at, stage):
    """Take the momentum of the fluid from a configuration."""
    return turn_fluid(fluid, p.strands, at, stage)
