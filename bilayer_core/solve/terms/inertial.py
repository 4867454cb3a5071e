"""Inertia, mass damping and gravity of nodes, edge angles and free bodies."""

from __future__ import annotations

import numpy as np

from ...forces.body import body_spring
from ...forces.quadratic import angle_spring, gravity, node_spring
from ...model.model import Model
from ..configuration import Configuration
from .term import Accumulators, Kind, Term


class Inertia(Term):
    """Half the squared distance from the predictions, in the norm of mass over h²."""

    names = ("inertia",)
    kind = Kind.INERTIAL

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, context, out, bodies = self.model, self.context, self.out, self.model.bodies
        factor = context.inertia_factor
        energy = node_spring(model.node_mass, factor, at.position, context.predicted_position, out.node)
        energy += angle_spring(model.spin_inertia, factor, at.turn, context.predicted_turn, out.edge)
        if model.free_count:
            energy += body_spring(
                bodies.mass,
                bodies.second_moment,
                factor,
                at.body_position,
                at.body_rotation,
                context.predicted_body_position,
                context.predicted_body_rotation,
                out.body,
                out.matrix.body_hessian,
                with_hessian,
            )
        self.out.energy["inertia"] = energy


class Damping(Term):
    """Mass damping of rods."""

    names = ("damping",)
    kind = Kind.DISSIPATIVE

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, context = self.model, self.context
        factor = model.scene.damping.mass / context.length
        energy = node_spring(model.node_mass, factor, at.position, context.origin_position, self.out.node)
        energy += angle_spring(model.spin_inertia, factor, at.turn, context.origin_turn, self.out.edge)
        self.out.energy["damping"] = energy


class Gravity(Term):
    """Weight of rods and free bodies."""

    names = ("gravity",)

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._acceleration = np.array(model.scene.gravity)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, out = self.model, self.out
        energy = gravity(model.node_mass, self._acceleration, at.position, out.node)
        if model.free_count:
            energy += gravity(model.bodies.mass, self._acceleration, at.body_position, out.body)
        self.out.energy["gravity"] = energy
