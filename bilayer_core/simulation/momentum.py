"""Momentum and angular momentum of rods and bodies, without that of a fluid."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.model import Model
from bilayer_core.model.state import State, director_rates

Array = np.ndarray


def momentum_off_curve(model: Model, state: State) -> Array:
    """Return the momentum of nodes that masses off the curve add to m v [N s], shape (n_node, 3); see
    `forces.raised`.
    """
    raised, rates, momentum = model.raised, director_rates(model, state), np.zeros((model.node_count, 3))
    for half in range(raised.first_moment.shape[1]):
        np.add.at(momentum, model.rods.edge_node[raised.edge] + half, raised.first_moment[:, half, None] * rates)
    return momentum


def momentum_of(model: Model, state: State) -> Array:
    """Return the momentum of rods and free bodies [N s], shape (3,)."""
    of_bodies = model.free_bodies.mass @ state.body_velocity[model.free_bodies.body_of_free]
    return model.rods.node_mass @ state.velocity + momentum_off_curve(model, state).sum(axis=0) + of_bodies


def angular_momentum_of(model: Model, state: State) -> Array:
    """Return the angular momentum of rods and free bodies about the origin [N m s], shape (3,)."""
    rods, raised, free = model.rods, model.raised, model.free_bodies
    momentum = rods.node_mass[:, None] * state.velocity + momentum_off_curve(model, state)
    total = np.cross(state.position, momentum).sum(axis=0)
    edges = state.position[rods.edge_node + 1] - state.position[rods.edge_node]
    tangent = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    total += (rods.spin_inertia * state.spin) @ tangent
    node, director = rods.edge_node[raised.edge], state.director1[raised.edge]
    pushed = raised.second_moment[:, None] * director_rates(model, state)
    for half in range(raised.first_moment.shape[1]):
        pushed += raised.first_moment[:, half, None] * state.velocity[node + half]
    total += np.cross(director, pushed).sum(axis=0)
    for f, b in enumerate(free.body_of_free):
        rotation, spin = state.body_rotation[b], state.body_angular_velocity[b]
        moment = rotation @ free.second_moment[f] @ rotation.T
        total += free.mass[f] * np.cross(state.body_position[b], state.body_velocity[b])
        total += np.trace(moment) * spin - moment @ spin
    return total
