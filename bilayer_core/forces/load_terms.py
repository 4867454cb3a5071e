"""Forces and moments from outside; followers take their directions from where Newton moved last."""

from __future__ import annotations

import math

from ..jit import kernel, piece
from ..model.force_places import place_of
from ..model.records.parts import Moments, PointForces
from ..model.records.problem import Problem
from ..model.records.status import READY
from ..model.records.step import Place, Stage
from .drag import node_directions
from .load import body_moment, point_force

LOADS, FOLLOWERS, MOMENTS = map(place_of, ("loads", "followers", "moments"))


@kernel
def scale_loads(loads, load_factor):
    """Dead loads, by their present factors."""
    if not loads.exists:
        return
    for k in range(loads.node.shape[0]):
        for c in range(3):
            loads.on_nodes[k, c] = load_factor[loads.node_load[k]] * loads.node_vector[k, c]
    for k in range(loads.body.shape[0]):
        for c in range(3):
            loads.on_bodies[k, c] = load_factor[loads.body_load[k]] * loads.body_vector[k, c]


@kernel
def add_loads(loads, at, sums, place):
    if not loads.exists:
        return
    if not sums.selected[place]:
        return
    energy = point_force(loads.node, loads.on_nodes, at.position, sums.node)
    sums.energy[place] = energy + point_force(loads.body, loads.on_bodies, at.body_position, sums.body)


@kernel
def turn_followers(loads, load_factor, at):
    """Followers take the directions of a configuration; whether there are any."""
    if not loads.exists:
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


@kernel
def turn_moments(moments, load_factor, at):
    """Moments, those that follow in the axes of their bodies; whether any does."""
    if not moments.exists:
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


@kernel
def add_moments(moments, at, stage, sums, with_hessian):
    if not moments.exists:
        return
    if not sums.selected[MOMENTS]:
        return
    sums.energy[MOMENTS] = body_moment(
        moments.body,
        moments.present,
        at.body_rotation,
        stage.predicted_body_rotation,
        sums.body,
        sums.body_hessian,
        with_hessian,
    )


@piece(float, PointForces, Problem, Place, Stage, bool)
def add_dead_loads(loads, p, at, stage, with_hessian):
    """Forces of fixed direction."""
    add_loads(loads, at, p.sums, LOADS)
    return math.inf


@piece(int, PointForces, Problem, Place, Stage)
def start_dead_loads(loads, p, start, stage):
    """Forces of fixed direction by their factors at the stage."""
    scale_loads(loads, stage.load_factor)
    return READY


@piece(float, PointForces, Problem, Place, Stage, bool)
def add_follower_loads(loads, p, at, stage, with_hessian):
    """Forces that turn with what they act on."""
    add_loads(loads, at, p.sums, FOLLOWERS)
    return math.inf


@piece(bool, PointForces, Problem, Place, Stage)
def follow_with_loads(loads, p, at, stage):
    """Take their directions from a configuration."""
    return turn_followers(loads, stage.load_factor, at)


@piece(float, Moments, Problem, Place, Stage, bool)
def add_body_moments(moments, p, at, stage, with_hessian):
    """Moments on bodies."""
    add_moments(moments, at, stage, p.sums, with_hessian)
    return math.inf


@piece(bool, Moments, Problem, Place, Stage)
def follow_with_moments(moments, p, at, stage):
    """Take the axes of those that follow from a configuration."""
    return turn_moments(moments, stage.load_factor, at)
