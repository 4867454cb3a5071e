"""Figures of a run that need a look at every step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..jit import kernel
from ..model.model import Model
from ..model.state import State
from .stepper import Stepper, StepReport


@kernel
def largest_row(rows):
    """Largest Euclidean norm of the rows of an (n, 3) array; 0 if it is empty."""
    largest = 0.0
    for i in range(rows.shape[0]):
        largest = max(largest, rows[i, 0] ** 2 + rows[i, 1] ** 2 + rows[i, 2] ** 2)
    return largest**0.5


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
    """Counts, extremes and first contacts, from `update` after every step.

    Times in s, lengths in m, forces in N, residuals in m/s.
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
    bodies: dict[str, BodyContact] = field(default_factory=dict)

    def update(self, report: StepReport, stepper: Stepper, state: State) -> None:
        """Take in one step."""
        model, potential = stepper.model, stepper.potential
        self.steps += 1
        self.substeps += report.substeps
        self.rejected += report.rejected
        self.inaccurate += report.inaccurate
        self.shortest, self.longest = min(self.shortest, report.length), max(self.longest, report.length)
        self.iterations += report.iterations
        self.factorisations += report.factorisations
        self.last_residual = report.residual
        self.largest_residual = max(self.largest_residual, report.residual)
        self.com_max_height = max(self.com_max_height, float(center_of_mass(model, state)[2]))
        if not potential.has_contact:
            return
        self.min_gap = min(self.min_gap, potential.min_gap)
        nodes = potential.carrier_gradient[: model.node_count]
        self.max_contact_force = max(self.max_contact_force, largest_row(nodes))
        if potential.near is not None:
            self._count_contacts(report.time, stepper)

    def _count_contacts(self, time: float, stepper: Stepper) -> None:
        model, near = stepper.model, stepper.potential.near
        touching = near.gap[: near.count] < model.scene.contact.barrier_distance
        touching &= near.carrier[: near.count] < model.node_count
        nodes = np.bincount(near.surface[: near.count][touching], minlength=len(model.surfaces.names))
        for surface, body in enumerate(model.surfaces.body):
            if body == len(model.bodies.names):
                continue
            found = self.bodies.setdefault(model.bodies.names[body], BodyContact())
            found.nodes = int(nodes[surface])
            found.most_nodes = max(found.most_nodes, found.nodes)
            if found.nodes and found.first_contact is None:
                found.first_contact = time
