"""Steps of a model: the arrays that they compute into, and what they leave."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bilayer_core.engine import (  # noqa: F401 (declares pieces)
    friction_differences,
    gradient_differences,
    light_differences,
    step_response,
)
from bilayer_core.engine.actuation import Actuation
from bilayer_core.engine.capacity import CapacityError
from bilayer_core.engine.energy_account import open_account
from bilayer_core.engine.error_norm import ErrorNorm
from bilayer_core.engine.integrate import Attempt, Clock, Counts, Failure, Integration, StepControl, integrate
from bilayer_core.engine.linear import krylov_solution  # noqa: F401 (likewise)
from bilayer_core.engine.observables import Observables, observe
from bilayer_core.engine.potential import add_forces, expand_to_unknowns
from bilayer_core.engine.run_extrema import count_shape
from bilayer_core.engine.step import make_step, treat_state, write_rest_strains
from bilayer_core.engine.step_outcome import FAILURES, IntegrationReport
from bilayer_core.engine.step_size import tolerance_in
from bilayer_core.engine.steps_again import begin_step
from bilayer_core.engine.storage import Storage, new_configuration, new_work
from bilayer_core.errors import SimulationError
from bilayer_core.forces.joints import Joints
from bilayer_core.integrators.method import Method
from bilayer_core.integrators.sdirk2 import METHOD as SELF_STARTING
from bilayer_core.jit.record import Numbers
from bilayer_core.model.bend_faces import bend_faces
from bilayer_core.model.bent_plates import plates_of_bends
from bilayer_core.model.contact_points import contact_point_names
from bilayer_core.model.model import Model
from bilayer_core.model.records.contacts import RodContact, Surfaces
from bilayer_core.model.records.parts import Mechanisms
from bilayer_core.model.records.problem import Problem, Sums
from bilayer_core.model.records.step import RunExtrema, StageInputs, StateArrays
from bilayer_core.model.state import State

Array = np.ndarray
NO_LIMIT = 2**62
"""Passes of Newton's method."""


class Engine:
    """Compiled steps of a model, and the arrays that they compute into.

    Parameters
    ----------
    model : Model
    method : Method
    control : StepControl
    newton_tolerance : float
        Speed of a material point below which Newton's correction is the last [m/s].
    max_iterations : int
        Of Newton's method.

    Attributes
    ----------
    actuation : Actuation or None
        What acts from outside; to be set before the first step.
    end : Configuration
        The configuration that was evaluated last.
    gap : float
        The smallest to a surface or another rod there [m], infinite without contact; between rods those below the
        barrier distance count.
    stimulus : Array
        Value of each channel at the end of the last step, shape (n_channel,).
    extrema : RunExtrema
        Of the run.
    numbers_of_extrema : Numbers
    passes : int
        Of Newton's method, in the last steps.
    methods : list of Method
        The integrator's coefficients, and last those of what stands in for one with a history.
    """

    def __init__(
        self, model: Model, method: Method, control: StepControl, newton_tolerance: float, max_iterations: int
    ):
        self._model, self._storage, self._control = model, Storage(model), control
        sizes = self._storage.sizes
        self._newton = newton_tolerance, max_iterations
        self._outcome, self.gap, self.passes = self._storage.outcome, math.inf, 0
        self._numbers_of_outcome = Numbers(self._outcome)
        methods = (method, SELF_STARTING) if method.history else (method,)
        self.methods = [used.arrays() for used in methods]
        self._configurations = [new_configuration(model, sizes) for _ in range(3)]
        self.end = self._configurations[1]
        self._work = new_work(sizes, self._configurations, max(len(used.nodes) for used in methods))
        self._inputs = new_inputs(model, sizes, max(len(used.points) for used in methods))
        self.stimulus = self._inputs.applied
        self.actuation: Actuation | None = None
        self._error_norm, self._counts = error_norm_of(model), Counts(shortest=math.inf)
        self._failure, self._attempt = Failure(), Attempt()
        self._numbers, self._numbers_of_failure = Numbers(self._counts), Numbers(self._failure)
        self._state: State | None = None
        self._integration: Integration | None = None
        self._no_joints = Joints.absent()
        self._evaluated = True  # whether forces are those of `end`
        (faces, thickness), (plate, free) = bend_faces(model), plates_of_bends(model)
        self.extrema = RunExtrema.zeros(
            sizes,
            faces=faces,
            thickness=thickness,
            plate=plate,
            free=free,
            mass=float(model.rods.node_mass.sum() + model.robot_mass.sum()),
            robot_mass=model.robot_mass,
            voronoi_length=model.voronoi_length,
        )
        self.numbers_of_extrema = Numbers(self.extrema)
        self.start_over(-math.inf)

    def take_scene(self, model: Model, control: StepControl, newton_tolerance: float, max_iterations: int) -> None:
        """Take another scene of the same model, of which the arrays know nothing but coefficients of friction."""
        self._model, self._control, self._newton = model, control, (newton_tolerance, max_iterations)
        self._storage.take_scene(model)
        self._state = self._integration = None

    def start_over(self, height: float) -> None:
        """Forget the extrema of the run; the mass centre is at `height` [m]."""
        extrema = self.extrema
        for name in extrema.changing:
            setattr(extrema, name, 0)
        extrema.height, extrema.least_gap = height, math.inf
        extrema.body_top[:] = -math.inf
        extrema.nodes[:], extrema.most_nodes[:], extrema.first_contact[:] = 0, 0, math.nan

    def take_extrema(self, other: RunExtrema) -> None:
        """Go on from the extrema of a run in another model."""
        for name in other.changing:
            setattr(self.extrema, name, getattr(other, name))
        for name in other.shapes:
            getattr(self.extrema, name)[:] = getattr(other, name)

    def integrate(
        self, state: State, until: float, due: float, most: int, passes: int, patience: int, goes_on: bool
    ) -> IntegrationReport:
        """Make at most so many steps, by `integrate.integrate`. One that fails leaves `state` as it is.

        After so many `passes` of Newton's method they pause before the next attempt at a step, after `patience` more
        within one. A step that did so may go on, from the same state.
        """
        self._storage.set_friction(state.friction)
        self._numbers.reset()
        done = integrate(self._parts_for(state), until, due, most, passes, patience, goes_on, *self._newton)
        found = self._numbers_of_outcome.read()
        status = found["status"]
        self.passes = passes - found["passes"]
        if done > 0 or status in FAILURES:
            self._take_end(found)
            self._evaluated = False
        figures = self._numbers.read()
        if status in FAILURES:
            figures |= self._numbers_of_failure.read()
        return IntegrationReport(done, status, found["pair"], **figures)

    def make_again(self, state: State, stood_in: bool, length: float, same: float) -> int:
        """Make a step of a given length [s] by the method, or by what stands in for it, whatever its error is; return
        its status. Times that differ by less than `same` [s] are the same.
        """
        begin, used = float(state.time[0]), self.methods[-1 if stood_in else 0]
        self._storage.set_friction(state.friction)
        while True:
            run, problem, work = self._parts_for(state), self._storage.problem, self._work
            run.start_state.values[:] = state.values
            self._outcome.passes, self._outcome.patience = NO_LIMIT, 0
            acts, when = (self.actuation, self._inputs, work), (begin, length, same)
            begin_step(problem, run.state, used, *acts, *when, self._configurations[0])
            tolerance = tolerance_in.py_func(length, self._newton[0])
            by = used, self.methods[0].history, self._inputs, work
            status = make_step(problem, run.state, run.start_state, *by, length, tolerance, self._newton[1])
            if not self.reserve(status, state):
                return status

    def do_once(self, state: State, mode: int, length: float = 0.0, tolerance: float = math.inf) -> IntegrationReport:
        """Execute a request (`engine.request_modes`) on a state at rest, with the drive set; return a report."""
        self._storage.set_friction(state.friction)
        while True:
            run = self._parts_for(state)
            self._outcome.passes, self._outcome.patience = NO_LIMIT, 0
            status = treat_state(run.problem, run.state, run.work, mode, length, tolerance, self._newton[1])
            if not self.reserve(status, state):
                break
        found = self._numbers_of_outcome.read()
        self._take_end(found)
        self._evaluated = True
        figures = {name: found[name] for name in ("pair", "iterations", "factorisations", "settlings", "residual")}
        return IntegrationReport(1, status, **figures)

    def _parts_for(self, state: State) -> Integration:
        """Return the record that compiled steps take; the same object as long as all its parts are the same."""
        problem, parts = self._storage.problem, self._integration
        known = parts is not None and parts.problem is problem and parts.actuation is self.actuation
        if not known or state is not self._state:
            methods, start_state = self.methods, state.copy()
            arrays, start_arrays = (
                StateArrays(**{name: getattr(of, name) for name in StateArrays.names}) for of in (state, start_state)
            )
            self._state = state
            self._integration = parts = Integration(
                problem=problem,
                state=arrays,
                clock=Clock(**{name: getattr(state, name) for name in Clock.names}),
                method=methods[0],
                starter=methods[-1],
                inputs=self._inputs,
                actuation=self.actuation,
                control=self._control,
                error_norm=self._error_norm,
                work=self._work,
                start_state=start_arrays,
                extrema=self.extrema,
                counts=self._counts,
                failure=self._failure,
                attempt=self._attempt,
            )
        return parts

    def _take_end(self, found: dict[str, Any]) -> None:
        """Note which configuration was evaluated last, and the smallest gap there."""
        self.end, self.gap = self._configurations[found["configuration"]], found["gap"]

    def reserve(self, status: int, state: State) -> bool:
        """Add the capacity that a step from a state lacked; return false if that is not what it lacked.

        Raises
        ------
        SimulationError
            If there may not be so much.
        """
        try:
            return self._storage.grow(status)
        except CapacityError as refusal:
            raise SimulationError(refusal.reason, float(state.time[0]), refusal.remedy) from None

    @property
    def problem(self) -> Problem:
        """All records of forces."""
        return self._storage.problem

    @property
    def sums(self) -> Sums:
        """Sums that forces added at the configuration evaluated last."""
        return self._storage.problem.sums

    @property
    def surfaces(self) -> Surfaces:
        """Points and surfaces that are near each other, with their gaps there."""
        return self._storage.problem.surfaces

    @property
    def rod_contact(self) -> RodContact:
        """Rods that meet there."""
        return self._storage.problem.rod_contact

    @property
    def joints(self) -> Joints:
        """Joints between bodies, with what they exerted there; without any, absent."""
        return next((own for own in self._storage.problem.forces.holds if isinstance(own, Joints)), self._no_joints)

    @property
    def mechanisms(self) -> Mechanisms:
        """Turns and ways that something resists, likewise."""
        return self._storage.problem.mechanisms

    @property
    def touching(self) -> Array:
        """Which contact points something pushed at the last evaluation, shape (n_contact_point,)."""
        return np.any(self.sums.contact_point != 0.0, axis=1)

    def who_blocks(self, pair: int) -> str:
        """Return the clause of a message that names the near pair which blocks prescribed motion."""
        if pair < 0:
            return "a rod would reach another"
        near = self._storage.problem.surfaces
        surface = self._model.surface_names[near.near_surface[pair]]
        return f"{contact_point_names(self._model)[near.near_contact_point[pair]]} would reach the surface of {surface}"

    @property
    def deepest_pair(self) -> int:
        """Near pair that reaches deepest into each other, −1 if none does."""
        near = self._storage.problem.surfaces
        gaps = near.near_gap[: near.near_count[0]] if near.exists else np.zeros(0)
        return int(gaps.argmin()) if gaps.min(initial=1.0) <= 0.0 else -1

    @property
    def moved(self) -> float:
        """Largest displacement of a material point in the last round of statics [m]."""
        return float(self._work.moved[0])

    @property
    def stood_in(self) -> bool:
        """True if the last steps were made by what stands in for a method with a history."""
        return self._counts.restarts > 0

    @property
    def spread(self) -> np.ndarray:
        """Places in `Work.spread` of the contacts that friction has spread in the last step."""
        return np.flatnonzero(self._work.spread)

    @property
    def unstable(self) -> int:
        """How many directions were found unstable when they were last counted."""
        return int(self._storage.problem.system.negative[0])

    def set_drive(self, state: State, load_factor: Array) -> None:
        """Set the rest strains of a state, and load factors, that act on it in modes other than steps."""
        run = self._parts_for(state)
        write_rest_strains(run.problem, run.state, run.work)
        run.work.stage.load_factor[:] = load_factor

    def evaluate_end(self) -> None:
        """Find the gradients at the end of the last step, after Newton's last correction, with all that its last stage
        had frozen: forces are then those of the end to the last digit. A step does not depend on it, and energies
        stay as it left them.
        """
        if not self._evaluated:
            problem = self._storage.problem
            energy = problem.sums.energy.copy()
            add_forces(problem, self.end, self._work.stage, False, False)
            expand_to_unknowns(problem, self.end)
            problem.sums.energy[:] = energy
            self._evaluated = True

    def observe(self, state: State, out: Observables) -> None:
        """Evaluate the observables of a state that is `end`, with forces as they are there."""
        self.evaluate_end()
        run = self._parts_for(state)
        observe(run.problem, self.joints, run.state, self.end, out)

    def open_account(self, state: State) -> None:
        """Begin with the energy of a state that was evaluated, unless its account is its own."""
        run = self._parts_for(state)
        open_account(run.problem, run.state, self._work.stage, self.end)

    def count_shape(self, state: State) -> None:
        """Take the shape of a state that was evaluated, and to which no step has led, into the extrema."""
        run = self._parts_for(state)
        count_shape(run.problem, run.state, self.end, self._work.stage, self.extrema)


def new_inputs(model: Model, sizes: dict[str, int], ends: int) -> StageInputs:
    """Return the arrays for what acts at so many ends of stages, with prescribed bodies at the start of their paths."""
    inputs = StageInputs.zeros(sizes | {"stage end": ends})
    for b in np.flatnonzero(model.free_bodies.free_index[:-1] < 0):
        inputs.position[:, b], inputs.rotation[:, b] = model.bodies.start_position[b], model.bodies.start_rotation[b]
    return inputs


def error_norm_of(model: Model) -> ErrorNorm:
    """Return the error norm that measures the defect of a model's steps."""
    ends = [strand.first_node for strand in model.strands] + [model.node_count]
    shares = np.array(model.node_length)
    return ErrorNorm(
        length=float(max(rod.path.length for rod in model.scene.rods)),
        first_node=np.array(ends, dtype=np.int64),
        weight=shares / np.repeat(np.add.reduceat(shares, ends[:-1]), np.diff(ends)),
        half_width=np.zeros(0) if model.plane.exists else model.rods.half_width,
        body_of_free=model.free_bodies.body_of_free,
        bounding_radius=model.free_bodies.bounding_radius,
    )
