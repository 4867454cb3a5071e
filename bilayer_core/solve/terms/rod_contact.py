"""Contact and friction between rods. These terms add to the derivatives of nodes as carriers; second ones stay with the
contacts.
"""

from __future__ import annotations

import numpy as np

from ..configuration import Configuration
from .term import Kind, StepContext, Term

Array = np.ndarray


class RodBarrier(Term):
    """Barrier of rods against each other and themselves."""

    names = ("rod barrier",)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        self.out.energy["rod barrier"] = self.out.matrix.rods.barrier(at.position, self.out.carrier)


class RodFriction(Term):
    """Friction of rods that touched at the start of the step."""

    names = ("rod friction",)
    kind = Kind.DISSIPATIVE

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self.out.matrix.rods.start_step(context.start.position)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        context = self.context
        self.out.energy["rod friction"] = self.out.matrix.rods.friction(
            at.position, context.origin_position, context.length, self.out.carrier
        )

    def slip_along(self, at: Configuration, node_step: Array, body_motion: Array) -> Array:
        context = self.context
        return self.out.matrix.rods.slip_along(at.position, context.origin_position, context.length, node_step)
