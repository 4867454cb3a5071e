"""Forces of a fluid."""

from __future__ import annotations

import numpy as np

from ...forces.drag import drag, lag_directions
from ...model.model import Model
from ..configuration import Configuration
from .term import Accumulators, Kind, StepContext, Term


class Drag(Term):
    """Quadratic drag along directions frozen at the start of the step."""

    names = ("drag",)
    kind = Kind.DISSIPATIVE

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._direction = np.zeros((len(model.drag_node), 3, 3))
        self._flow = np.array(model.scene.fluid.velocity)

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        before, after = self.model.drag_edge.T
        start = context.start
        lag_directions(self.model.drag_node, before, after, start.tangent, start.director1, self._direction)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, context = self.model, self.context
        self.out.energy["drag"] = drag(
            model.drag_node,
            model.drag_coefficient,
            self._direction,
            self._flow,
            context.length,
            at.position,
            context.start.position,
            self.out.node,
            self.out.matrix.carrier_hessian,
            with_hessian,
        )
