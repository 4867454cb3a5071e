"""Momentum and energy of the fluid around moving rods."""

from __future__ import annotations

import numpy as np

from ..forces.added_mass import fluid_momentum
from ..model.model import Model
from ..model.records.step import Place

Array = np.ndarray


def momentum_of_fluid(model: Model, at: Place, velocity: Array) -> Array:
    """Momentum of the fluid at each node [N s], shape (n_node, 3); (0, 3) without added mass."""
    if not len(model.fluid_mass):
        return np.zeros((0, 3))
    momentum = np.empty((model.node_count, 3))
    survey_fluid(model, at, velocity, np.zeros(model.edge_count), momentum, np.empty((model.edge_count, 4)))
    return momentum


def energy_of_fluid(model: Model, at: Place, velocity: Array, spin: Array) -> float:
    """Kinetic energy of the fluid relative to its flow [J]."""
    return survey_fluid(model, at, velocity, spin, np.empty((model.node_count, 3)), np.empty((model.edge_count, 4)))


def survey_fluid(
    model: Model, at: Place, velocity: Array, spin: Array, momentum: Array, shape_gradient: Array
) -> float:
    """Write P and ∂T/∂q, return T [J]; see `forces.added_mass.fluid_momentum`."""
    frames = (at.length, at.tangent, at.director1, at.director2)
    flow = np.array(model.scene.fluid.velocity)
    return fluid_momentum(model.fluid_mass, model.edge_node, *frames, flow, velocity, spin, momentum, shape_gradient)
