"""Forces of a fluid."""

from __future__ import annotations

import numpy as np

from ...forces.added_mass import added_mass, fluid_momentum
from ...forces.drag import drag, node_directions
from ...model.layout import columns
from ...model.model import Model
from ..configuration import Configuration
from .term import Accumulators, Kind, StepContext, Term

Array = np.ndarray


class Drag(Term):
    """Quadratic drag, along the directions of the configuration to which Newton moved last."""

    names = ("drag",)
    kind = Kind.DISSIPATIVE

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._direction = np.zeros((len(model.drag_node), 3, 3))
        self._edges = columns(model.drag_edge)
        self._flow = np.array(model.scene.fluid.velocity)

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self.follow(context.start)

    def follow(self, at: Configuration) -> bool:
        node_directions(self.model.drag_node, *self._edges, at.tangent, at.director1, self._direction)
        return True

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, context = self.model, self.context
        self.out.energy["drag"] = drag(
            model.drag_node,
            model.drag_coefficient,
            self._direction,
            self._flow,
            context.length,
            at.position,
            context.origin_position,
            self.out.node,
            self.out.matrix.node_hessian,
            with_hessian,
        )


class AddedMass(Term):
    """Inertia of the fluid, along the directions of the configuration to which Newton moved last."""

    names = ("added mass",)
    kind = Kind.INERTIAL

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        edges = model.edge_count + model.wall_count
        self._flow = np.array(model.scene.fluid.velocity)
        self._direction1, self._direction2 = np.zeros((edges, 3)), np.zeros((edges, 3))
        self._shape_gradient = np.zeros((model.edge_count, 4))
        self._momentum = np.zeros((model.node_count, 3))
        self._still = np.zeros(model.edge_count)  # P and ∂T/∂q do not depend on spins

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self.follow(context.start)

    def follow(self, at: Configuration) -> bool:
        velocity = (at.position - self.context.origin_position) / self.context.length
        survey_fluid(self.model, at, velocity, self._still, self._momentum, self._shape_gradient)
        self._direction1[:], self._direction2[:] = at.director1, at.director2
        return True

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, context, out = self.model, self.context, self.out
        out.energy["added mass"] = added_mass(
            model.fluid_mass,
            model.edge_node,
            self._direction1,
            self._direction2,
            self._shape_gradient,
            context.origin_fluid_momentum,
            self._flow,
            context.length,
            context.momentum_length,
            at.position,
            context.origin_position,
            at.turn,
            context.predicted_turn,
            out.node,
            out.matrix.node_hessian,
            out.edge,
            out.matrix.edge_hessian,
            with_hessian,
        )


def momentum_of_fluid(model: Model, at: Configuration, velocity: Array) -> Array:
    """Momentum of the fluid at each node [N s], shape (n_node, 3); (0, 3) without added mass."""
    if not len(model.fluid_mass):
        return np.zeros((0, 3))
    momentum = np.empty((model.node_count, 3))
    survey_fluid(model, at, velocity, np.zeros(model.edge_count), momentum, np.empty((model.edge_count, 4)))
    return momentum


def energy_of_fluid(model: Model, at: Configuration, velocity: Array, spin: Array) -> float:
    """Kinetic energy of the fluid relative to its flow [J]."""
    return survey_fluid(model, at, velocity, spin, np.empty((model.node_count, 3)), np.empty((model.edge_count, 4)))


def survey_fluid(
    model: Model, at: Configuration, velocity: Array, spin: Array, momentum: Array, shape_gradient: Array
) -> float:
    """Write P and ∂T/∂q, return T [J]; see `forces.added_mass.fluid_momentum`."""
    frames = (at.length, at.tangent, at.director1, at.director2)
    flow = np.array(model.scene.fluid.velocity)
    return fluid_momentum(model.fluid_mass, model.edge_node, *frames, flow, velocity, spin, momentum, shape_gradient)
