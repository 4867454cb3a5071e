"""Figures of a run that need a look at every step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..engine.engine import MarchReport
from ..model.model import Model
from ..model.state import State
from .stepper import Stepper, StepReport


def center_of_mass(model: Model, state: State) -> np.ndarray:
    """Mass centre of the rods [m], shape (3,)."""
    moment = model.node_mass @ state.position
    if len(model.mass_moment):
        moment += model.mass_moment @ state.director1
    return moment / model.node_mass.sum()


@dataclass
class BodyContact:
    """Contact of a body's surface with nodes: when it began [s], how many nodes took part at most, and at the end."""

    first_contact: float | None = None
    most_nodes: int = 0
    nodes: int = 0


@dataclass
class RunStatistics:
    """Counts, extremes and first contacts of a run, from `update` after every step.

    Times in s, lengths in m, forces in N, residuals in m/s, curvatures in 1/m. `max_strain` is the largest magnitude of
    the strain of an edge without its eigenstrain, `body_tops` the greatest height of each body; these two and
    `max_curvature` count the state at the start too.
    """

    steps: int = 0
    substeps: int = 0
    rejected: int = 0
    inaccurate: int = 0
    shortest: float = math.inf
    longest: float = 0.0
    iterations: int = 0
    factorisations: int = 0
    largest_residual: float = 0.0
    last_residual: float = 0.0
    min_gap: float = math.inf
    max_contact_force: float = 0.0
    com_max_height: float = -math.inf
    max_curvature: float = 0.0
    max_strain: float = 0.0
    body_tops: dict[str, float] = field(default_factory=dict)
    bodies: dict[str, BodyContact] = field(default_factory=dict)

    def update(self, report: StepReport, stepper: Stepper, state: State) -> None:
        """Take in one step."""
        self.steps += 1
        self.substeps += report.substeps
        self.rejected += report.rejected
        self.inaccurate += report.inaccurate
        self.shortest, self.longest = min(self.shortest, report.length), max(self.longest, report.length)
        self.iterations += report.iterations
        self.factorisations += report.factorisations
        self.last_residual = report.residual
        self.largest_residual = max(self.largest_residual, report.residual)
        stepper.engine.count_in(state, stepper.engine.gap)
        self.take_shape(stepper, state)

    def take_shape(self, stepper: Stepper, state: State) -> None:
        """Take in the shape of a state that no compiled loop has led to, evaluated in `stepper`."""
        rest = stepper.surroundings.rest_strains_of(state.transduction)
        stepper.engine.count_shape(state, stepper.end, rest.edge)
        self._take_extremes(stepper)

    def update_with(self, report: MarchReport, stepper: Stepper) -> None:
        """Take in the steps that a compiled loop made."""
        newton = report.newton
        self.steps += report.done
        self.substeps += report.done
        self.rejected += report.rejected
        self.inaccurate += report.inaccurate
        self.shortest, self.longest = min(self.shortest, report.shortest), max(self.longest, report.longest)
        self.iterations += newton.iterations
        self.factorisations += newton.factorisations
        self.last_residual = newton.residual if report.finished else report.largest_residual
        self.largest_residual = max(self.largest_residual, report.largest_residual)
        self._take_extremes(stepper)

    def _take_extremes(self, stepper: Stepper) -> None:
        engine, model = stepper.engine, stepper.model
        self.com_max_height, self.min_gap, self.max_contact_force, *shape = engine.figures.tolist()
        self.max_curvature, self.max_strain = shape
        self.body_tops = dict(zip(model.bodies.names, engine.body_top.tolist(), strict=True))
        if not model.meets_surfaces:
            return
        for surface, body in enumerate(model.surfaces.body):
            if body < len(model.bodies.names):
                first = float(engine.first_contact[surface])
                self.bodies[model.bodies.names[body]] = BodyContact(
                    None if math.isnan(first) else first, int(engine.most_nodes[surface]), int(engine.nodes[surface])
                )
