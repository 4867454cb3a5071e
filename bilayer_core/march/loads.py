"""Forces and moments from outside; followers take their directions from where Newton moved last."""

from __future__ import annotations

from ..forces.drag import node_directions
from ..forces.load import body_moment, point_force
from ..jit import inner
from .terms import place_of

LOADS, FOLLOWERS, MOMENTS = map(place_of, ("loads", "followers", "moments"))


@inner
def scale_loads(loads, load_factor):
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
def add_loads(loads, at, sums, place):
    if loads is None:
        return
    if not sums.selected[place]:
        return
    energy = point_force(loads.node, loads.on_nodes, at.position, sums.node)
    sums.energy[place] = energy + point_force(loads.body, loads.on_bodies, at.body_position, sums.body)


@inner
def turn_followers(loads, load_factor, at):
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
def turn_moments(moments, load_factor, at):
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
def add_moments(moments, at, stage, sums, with_hessian):
    if moments is None:
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
