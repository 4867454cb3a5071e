"""Figures of a run that need a look at every step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from bilayer_core.engine.energy_account import NUMERICAL, OPEN
from bilayer_core.engine.step_outcome import IntegrationReport
from bilayer_core.model.bent_plates import BENT_PLATE
from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.model.validity import LARGE_STRAIN, THICK_CURVATURE
from bilayer_core.simulation.stepper import Stepper

FIBRE_STRAIN = f"a fibre is strained by more than {100 * LARGE_STRAIN:g} %: the law of the material is linear"
CURVATURE_BY_THICKNESS = f"curvature × thickness is above {THICK_CURVATURE:g}: it is no thin rod"


def center_of_mass(model: Model, state: State) -> np.ndarray:
    """Return the mass centre of the robot, rods and bodies that hold them or are joined to these [m], shape (3,)."""
    moment = model.rods.node_mass @ state.position + model.robot_mass @ state.body_position
    moment += model.raised.first_moment.sum(axis=1) @ state.director1[model.raised.edge]
    return moment / (model.rods.node_mass.sum() + model.robot_mass.sum())


@dataclass
class BodyContact:
    """Contact of a body's surface with nodes: when it began [s], how many nodes took part at most, and at the end."""

    first_contact: float | None = None
    most_nodes: int = 0
    nodes: int = 0


@dataclass
class RunStatistics:
    """Counts, extrema and first contacts of a run: the former from `update` after every few steps, the others from
    `take_extrema` when somebody asks for them.

    Times in s, lengths in m, forces in N, residuals in m/s, curvatures in 1/m. `max_strain` is the largest magnitude of
    the strain of an edge without its eigenstrain, `max_fibre_strain` that of the fibre strained most, and
    `max_curvature_by_thickness` the largest product of both (`engine.run_extrema`); `bent_plate` is the largest
    curvature by loads over what a beam as wide may have, and its joint (`model.bent_plates`); `body_tops` is the
    greatest height of each body. These and `max_curvature` count the state at the start too. `numerical_before` is the
    numerical energy of the state where the run began, `put_in` and `taken_out` are sums of what each step was supplied
    and lost [J]. `creased` says since when strips were creased (`simulation.strip_sections`).
    """

    steps: int = 0
    substeps: int = 0
    rejected: int = 0
    inaccurate: int = 0
    gaining: int = 0
    unresolved: int = 0
    regularised: int = 0
    shortest: float = math.inf
    longest: float = 0.0
    iterations: int = 0
    factorisations: int = 0
    settlings: int = 0
    largest_residual: float = 0.0
    last_residual: float = 0.0
    min_gap: float = math.inf
    max_contact_force: float = 0.0
    com_max_height: float = -math.inf
    max_curvature: float = 0.0
    max_strain: float = 0.0
    max_fibre_strain: float = 0.0
    max_curvature_by_thickness: float = 0.0
    bent_plate: tuple[float, int] = (0.0, 0)
    put_in: float = 0.0
    taken_out: float = 0.0
    numerical_before: float = 0.0
    body_tops: dict[str, float] = field(default_factory=dict)
    bodies: dict[str, BodyContact] = field(default_factory=dict)
    creased: dict[str, float] = field(default_factory=dict)

    @property
    def beyond_limits(self) -> tuple[str, ...]:
        """For each limit of the model that the run has passed, what it is and what that means."""
        told = (
            (self.max_fibre_strain > LARGE_STRAIN, FIBRE_STRAIN),
            (self.max_curvature_by_thickness > THICK_CURVATURE, CURVATURE_BY_THICKNESS),
            (self.bent_plate[0] > 1.0, BENT_PLATE),
        )
        return tuple(text for passed, text in told if passed)

    def take_shape(self, stepper: Stepper, state: State) -> None:
        """Take in the shape of a state to which no step has led.

        Parameters
        ----------
        stepper : Stepper
            In which it was evaluated.
        state : State
        """
        stepper.engine.count_shape(state)
        stepper.engine.open_account(state)
        self.numerical_before = float(state.account[NUMERICAL])

    def go_on(self, stepper: Stepper, state: State) -> None:
        """Take in the shape of a state that goes on in another model; energy that steps made before counts on.

        Parameters
        ----------
        stepper : Stepper
            In which it was evaluated.
        state : State
        """
        made = float(state.account[NUMERICAL]) - self.numerical_before
        state.account[OPEN] = 0.0
        self.take_shape(stepper, state)
        self.numerical_before -= made

    def update(self, report: IntegrationReport, whole: int) -> None:
        """Count some steps.

        Parameters
        ----------
        report : IntegrationReport
        whole : int
            How many of the steps are no parts of one.
        """
        self.steps += whole
        self.substeps += report.done
        self.rejected += report.rejected
        self.inaccurate += report.inaccurate
        self.gaining += report.gaining
        self.unresolved += report.unresolved
        self.regularised += report.regularised
        if report.shortest < self.shortest:
            self.shortest = report.shortest
        if report.longest > self.longest:
            self.longest = report.longest
        self.iterations += report.iterations
        self.factorisations += report.factorisations
        self.settlings += report.settlings
        self.last_residual = report.largest_residual if report.failed else report.residual
        if report.largest_residual > self.largest_residual:
            self.largest_residual = report.largest_residual

    def take_extrema(self, stepper: Stepper) -> None:
        """Take in the extrema of all steps.

        Parameters
        ----------
        stepper : Stepper
            Which made them.
        """
        extrema, model = stepper.engine.extrema, stepper.model
        found = stepper.engine.numbers_of_extrema.read()
        self.com_max_height, self.min_gap = found["height"], found["least_gap"]
        self.max_contact_force = found["contact_force"]
        self.max_curvature, self.max_strain = found["curvature"], found["strain"]
        self.max_fibre_strain, self.max_curvature_by_thickness = found["fibre_strain"], found["curvature_by_thickness"]
        self.bent_plate = found["bent_plate"], found["most_bent"]
        self.put_in, self.taken_out = found["put_in"], found["taken_out"]
        self.body_tops = dict(zip(model.bodies.names, extrema.body_top.tolist(), strict=True))
        if not model.has_surface_contact:
            return
        for surface, body in enumerate(model.surfaces.body):
            if body < len(model.bodies.names):
                first = float(extrema.first_contact[surface])
                self.bodies[model.bodies.names[body]] = BodyContact(
                    None if math.isnan(first) else first, int(extrema.most_nodes[surface]), int(extrema.nodes[surface])
                )
