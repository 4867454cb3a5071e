"""Kinetic energy of a state."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.model import Model
from bilayer_core.model.state import State

_UNIT = np.eye(3)


def kinetic_energy(model: Model, state: State) -> float:
    """Return the kinetic energy of nodes, of edges about their tangents, and of free bodies [J]."""
    kinetic = 0.5 * float(model.rods.node_mass @ np.square(state.velocity).sum(axis=1))
    kinetic += 0.5 * float(model.rods.spin_inertia @ np.square(state.spin))
    for slot, body in enumerate(model.free_bodies.body_of_free):
        velocity, spin = state.body_velocity[body], state.body_angular_velocity[body]
        rotation, second = state.body_rotation[body], model.free_bodies.second_moment[slot]
        trace = second[0, 0] + second[1, 1] + second[2, 2]
        inertia = rotation @ (trace * _UNIT - second) @ rotation.T
        kinetic += 0.5 * float(model.free_bodies.mass[slot] * velocity @ velocity + spin @ inertia @ spin)
    return kinetic
