"""Momentum and energy of the fluid around moving rods."""

from __future__ import annotations

import numpy as np

from bilayer_core.forces.added_mass import fluid_momentum
from bilayer_core.model.model import Model
from bilayer_core.model.records.parts import Fluid
from bilayer_core.model.records.step import Configuration
from bilayer_core.model.sizes import sizes_of

Array = np.ndarray


def momentum_of_fluid(model: Model, at: Configuration, velocity: Array) -> Array:
    """Momentum of the fluid at each node [N s], shape (n_node, 3); (0, 3) without added mass."""
    if not model.fluid.exists:
        return np.zeros((0, 3))
    return survey_fluid(model, at, velocity, np.zeros(model.rods.edge_count))[1].momentum


def energy_of_fluid(
    model: Model, at: Configuration, velocity: Array, spin: Array, director_rate: Array | float = 0.0
) -> float:
    """Kinetic energy of the fluid relative to its flow [J]."""
    return survey_fluid(model, at, velocity, spin, director_rate)[0]


def survey_fluid(
    model: Model, at: Configuration, velocity: Array, spin: Array, director_rate: Array | float = 0.0
) -> tuple[float, Fluid]:
    """T [J], and the fluid with P and ∂T/∂q; see `forces.added_mass.fluid_momentum`."""
    fluid = model.fluid.allocated(sizes_of(model))
    fluid.node_velocity[:], fluid.spin[:], fluid.director_rate[:] = velocity, spin, director_rate
    return fluid_momentum(fluid, at), fluid
