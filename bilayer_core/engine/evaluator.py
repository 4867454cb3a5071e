"""The potential of a model at configurations of the caller's own: for the energy budget, and for tests."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np

from bilayer_core.engine.configuration import move, take_state, transport_frames
from bilayer_core.engine.engine import new_inputs
from bilayer_core.engine.evaluate import (
    bound_step,
    evaluate_at,
    evaluate_laws,
    measure_kinetic_energy,
    speed_of_step,
)
from bilayer_core.engine.linear.newton_matrix import EXACT, assemble, factorise, solve
from bilayer_core.engine.potential import start_stage, update_lagged
from bilayer_core.engine.stages import predict_stage, stand_still_stage, start_step_point
from bilayer_core.engine.step import write_rest_strains
from bilayer_core.engine.step_ends import write_shape
from bilayer_core.engine.storage import Storage, new_configuration, new_work
from bilayer_core.forces.elements import start_elements
from bilayer_core.forces.force_register import memory_size
from bilayer_core.forces.mechanisms import REMEMBERED
from bilayer_core.model.force_slots import NAMES
from bilayer_core.model.model import Model
from bilayer_core.model.records.problem import Problem, Sums
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Point, Stage, StateArrays
from bilayer_core.model.state import State, initial_state
from bilayer_core.model.stimulated_strains import RestStrains

Array = np.ndarray


@dataclass(frozen=True)
class StepBound:
    """How far a step of the unknowns may go.

    Attributes
    ----------
    fraction : float
        Of the step, at which all gaps are still open.
    pair : int
        The near pair that sets it, −1 without one.
    friction_fraction : float
        Fraction, at most `fraction`, at which friction holds the step up.
    slip : Array
        Slip of each lagged contact along the step; see `forces.friction_limit`.
    """

    fraction: float
    pair: int
    friction_fraction: float
    slip: Array


class Evaluator:
    """Evaluates forces of a model, one or several or all, through the functions that steps use.

    Its arrays are its own, so that evaluations leave a run as it is. A stage is what a step freezes (`predict` or
    `stand_still`, then `start_stage`).

    Attributes
    ----------
    stage : Stage
    point : Point
        Start of a step, or origin of a stage: it may be changed between `start_point` and `predict`.
    """

    def __init__(self, model: Model, stages: int = 1, history: bool = False):
        self.model = model
        self._storage = Storage(model)
        self._state = initial_state(model, history, memory=memory_size(model))
        self._arrays = StateArrays(**{name: getattr(self._state, name) for name in StateArrays.names})
        sizes = self._storage.sizes
        self._work, self._inputs = new_work(sizes, [], stages), new_inputs(model, sizes, stages)
        self.stage: Stage = self._work.stage
        self.point: Point = self._work.origin
        self._flags: dict[tuple[str, ...], Array] = {}  # of forces, by those that are selected

    @property
    def problem(self) -> Problem:
        """Its records; others after capacity has grown."""
        return self._storage.problem

    @property
    def sums(self) -> Sums:
        """Sums that forces added in the last evaluation."""
        return self.problem.sums

    def _grow(self, status: int) -> None:
        if not self._storage.grow(status):
            raise ArithmeticError(f"the evaluation ended with status {status}")

    # configurations

    def new(self) -> Configuration:
        """Return a configuration in which only the parts that do not move are set."""
        return new_configuration(self.model, self._storage.sizes)

    def take_state(self, state: State, at: Configuration) -> None:
        """Make a configuration that of a state."""
        self._take(state)
        take_state(self.problem, self._arrays, at)
        if self.problem.surfaces.exists and self.problem.surfaces.divides:
            self.problem.surfaces.margin[0] = -1.0  # no list serves another state

    def _take(self, state: State) -> None:
        self._storage.set_friction(state.friction)
        if state.places == self._state.places:
            self._state.take(state)
            return
        for name in StateArrays.names:
            if name != "values":
                own, values = getattr(self._state, name), getattr(state, name)
                if own.size:
                    own[...] = values

    def move(self, base: Configuration, step: Array, body_step: Array, at: Configuration) -> None:
        """Make a configuration `base`, moved by a step of the unknowns, shape (size,), and of free bodies, shape
        (n_free, 6), both in space.
        """
        self._put(step, body_step)
        move(self.problem, base, 1.0, self.stage, at)

    def write_shape(self, at: Configuration, state: State) -> None:
        """Give a state, which may be one of the same scene in another dimension, the shape of a configuration."""
        write_shape(self.problem, at, self._arrays)
        for name in ("position", "position_low", "director1", "twist", "body_position", "body_position_low"):
            mine, part = getattr(self._state, name), getattr(state, name)
            if mine.shape == part.shape:
                part[...] = mine
        state.body_rotation[:] = self._state.body_rotation
        turned = REMEMBERED * len(self.model.mechanisms)  # first of the memory in both dimensions
        state.memory[:turned] = self._state.memory[:turned]

    def _put(self, step: Array, body_step: Array) -> None:
        system = self.problem.system
        system.step[:], system.body_step[:] = step, body_step

    def transport_frames(self, base: Configuration, angle: Array, at: Configuration) -> None:
        """Write the frames of `base`, carried to the positions of `at` and turned by `angle` [rad], shape (n_edge,)."""
        at.angle[:] = angle
        transport_frames(self.problem, base, at)

    # stages

    def rest_strains_of(self, transduction: Array) -> RestStrains:
        """Return the strains without stress from the stimuli that modes have reached, shape (n_mode,)."""
        self._state.transduction[:] = transduction
        write_rest_strains(self.problem, self._arrays, self._work)
        stage = self.stage
        return RestStrains(stage.rest_edge.copy(), stage.rest_joint.copy(), self._work.strain.copy())

    def start_point(self, state: State, at: Configuration) -> Point:
        """Return the positions and momenta at the start of a step from a state, whose configuration is `at`."""
        self._take(state)
        start_step_point(self.problem, self._arrays, at, self.point)
        return self.point

    def predict(
        self,
        at: Configuration,
        lengths: tuple[float, float],
        rest_edge: Array,
        rest_joint: Array,
        load_factor: Array,
        start_angle: Array | float = 0.0,
    ) -> None:
        """Freeze what a stage is from its origin, `point`; prescribed bodies rest where they are.

        Parameters
        ----------
        at : Configuration
            From which Newton begins.
        lengths : tuple of float
            γ h and γ′ h [s].
        rest_edge, rest_joint : Array
            Strains without stress, shapes (n_edge,), (n_joint, 3).
        load_factor : Array
            Of loads, shape (n_load,).
        start_angle : Array or float
            Turn of edges from the start of the step to `at` [rad], shape (n_edge,).
        """
        self.set_drive(rest_edge, rest_joint, load_factor)
        self.stage.length, self.stage.momentum_length = lengths
        self._work.start_angle[:] = start_angle
        inputs = self._inputs
        inputs.position[0], inputs.rotation[0], inputs.rates[0] = at.pose_position[:-1], at.rotation[:-1], 0.0
        predict_stage(self.problem, self._arrays, self._work, inputs, 0, self.point, at)

    def stand_still(
        self, state: State, at: Configuration, length: float, rest_edge: Array, rest_joint: Array, load_factor: Array
    ) -> None:
        """Freeze a stage that ends where it begins, at `at`, with the velocities of a state: inertia asks for nothing.

        Other parameters as for `predict`; `length` is both of `lengths`.
        """
        self._take(state)
        self.set_drive(rest_edge, rest_joint, load_factor)
        self.stage.length = self.stage.momentum_length = length
        stand_still_stage(self.problem, self._arrays, at, False, self.stage)

    def set_drive(self, rest_edge: Array, rest_joint: Array, load_factor: Array) -> None:
        """Set the strains without stress, and the factors of loads."""
        stage = self.stage
        stage.rest_edge[:], stage.rest_joint[:], stage.load_factor[:] = rest_edge, rest_joint, load_factor

    def start_stage(self, at: Configuration) -> None:
        """Freeze contacts for friction, and have everything follow the configuration that follows one."""
        while (status := start_stage(self.problem, at, self.stage)) != READY:
            self._grow(status)
        self.update_lagged(at)

    def update_lagged(self, at: Configuration) -> None:
        """Let directions of drag and of followers, and the momentum of the fluid, be those of a configuration."""
        update_lagged(self.problem, at, self.stage)

    # forces

    def select(self, at: Configuration, forces: Iterable[str] | None) -> None:
        """Select the forces to compute, all that the scene has or some by name, and start the elements.

        Raises
        ------
        LookupError
            If one does not act in the scene.
        """
        forces = self.model.forces if forces is None else tuple(forces)
        if forces not in self._flags:
            for name in forces:
                if name not in self.model.forces:
                    raise LookupError(f"force {name!r}: does not act in the scene, but: {', '.join(self.model.forces)}")
            self._flags[forces] = np.array([name in forces for name in NAMES])
        self.sums.selected[:] = self._flags[forces]
        start_elements(0, self.problem, at, self.stage)

    def forces(self, at: Configuration, forces: Iterable[str] | None = None) -> dict[str, float]:
        """Return the energies [J] of all forces or of some by name; `sums` holds their derivatives by nodes, edges,
        pairs, and free bodies, of which nothing has been handed on to the unknowns.
        """
        return self._evaluate(at, forces, second=False, expands=False)

    def evaluate(
        self, at: Configuration, forces: Iterable[str] | None = None, second: bool = False
    ) -> dict[str, float]:
        """Return the energies [J] of all forces or of some by name; their derivatives by the unknowns and by free
        bodies are in `sums`, with `second` those for `assemble` as well.
        """
        return self._evaluate(at, forces, second=second, expands=True)

    def _evaluate(
        self, at: Configuration, forces: Iterable[str] | None, *, second: bool, expands: bool
    ) -> dict[str, float]:
        self.select(at, forces)
        while (status := evaluate_at(self.problem, at, self.stage, second, expands)) != READY:
            self._grow(status)
        outcome, sums = self._storage.outcome, self.sums
        self.total, self.gap = outcome.energy, outcome.gap
        return {name: float(sums.energy[k]) for k, name in enumerate(NAMES) if sums.selected[k]}

    def forces_of_laws(self, at: Configuration) -> Array:
        """Return −∂V/∂η of each law [J] at a configuration, with the rest strains of the stage, shape (n_law,)."""
        evaluate_laws(self.problem, self._work, at)
        return self._work.end_force.copy()

    def kinetic_energy(self, state: State) -> float:
        """Return the kinetic energy of nodes, edges and free bodies [J]."""
        self._take(state)
        return measure_kinetic_energy(self.problem, self._arrays)

    # the matrix

    def assemble(self, at: Configuration) -> tuple[Array, Array, Array]:
        """Return the matrix of the selected forces in the last evaluation with second derivatives, that of `at`.

        It is A as a band (`engine.linear.band`), and U and D of free bodies, shapes (size + half-bandwidth,
        half-bandwidth + 1), (size, 6 n_free), (6 n_free, 6 n_free).

        None of them has the coupling of two edges by contacts of rods, see `newton_step`.
        """
        problem, size = self.problem, self.model.solved_layout.size
        length, momentum_length = self.stage.length, self.stage.momentum_length
        selected = {name for k, name in enumerate(NAMES) if self.sums.selected[k]}
        factor = "inertia" in selected and 1.0 / (length * momentum_length)
        factor += "damping" in selected and problem.damping / length
        with ExitStack() as undo:
            rods = problem.rod_contact
            for name, contacts in (("rod barrier", rods.contacts), ("rod friction", rods.sliding)):
                if rods.exists and name not in selected:
                    undo.callback(contacts.count.__setitem__, 0, contacts.count[0])
                    contacts.count[0] = 0
            assemble(problem, at, factor, EXACT)
        if not problem.border.exists:
            return problem.system.band, np.zeros((size, 0)), np.zeros((0, 0))
        return problem.system.band, problem.border.border[:size], problem.border.corner

    def factorise(self, at: Configuration) -> tuple[float, int]:
        """Factorise the matrix of the last evaluation of all forces with second derivatives, that of `at`.

        Returns
        -------
        shift : float
            Multiple of the masses that had to be added.
        simplified : int
            How far contacts of rods had to be simplified.
        """
        while (status := factorise(self.problem, at, self.stage, False)) != READY:
            self._grow(status)
            self.evaluate(at, second=True)
        outcome = self._storage.outcome
        return outcome.shift, outcome.simplified

    def newton_step(self, gradient: Array, body_gradient: Array) -> tuple[Array, Array]:
        """Return minus the inverse of the factorised matrix times a gradient: of unknowns, shape (size,), and of free
        bodies, shape (n_free, 6), both in space.
        """
        problem = self.problem
        self.sums.gradient[:], self.sums.body[:] = gradient, body_gradient
        solve(problem)
        return problem.system.step.copy(), problem.system.body_step.copy()

    def speed(self, step: Array, body_step: Array) -> float:
        """Return the largest displacement of a material point in a step over the length of the stage [m/s]."""
        self._put(step, body_step)
        return speed_of_step(self.problem, self.stage)

    def bound(self, at: Configuration, step: Array, body_step: Array) -> StepBound:
        """Return how far a step may go from the configuration of the last evaluation."""
        self._put(step, body_step)
        status = bound_step(self.problem, at, self.stage)
        if status != READY:
            self._grow(status)
            raise LookupError("there was too little capacity: evaluate with second derivatives again")
        problem, outcome = self.problem, self._storage.outcome
        count = int(problem.sliding.count[0]) if problem.sliding.exists else 0
        count += int(problem.rod_contact.sliding.count[0]) if problem.rod_contact.exists else 0
        slip = problem.slips.path[:count].copy() if problem.slips.exists else np.zeros((0, 0))
        return StepBound(outcome.fraction, outcome.pair, outcome.friction_fraction, slip)
