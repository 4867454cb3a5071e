"""The potential of a model at configurations of the caller's own: for the energy budget, and for tests."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..model.force_places import NAMES
from ..model.model import Model
from ..model.records.outcome import ENERGY, GAP, HELD_UP, PAIR, SHIFT
from ..model.records.problem import Problem
from ..model.records.status import READY
from ..model.records.step import Place, Point, Stage, StateArrays
from ..model.state import State, initial_state
from .allocate import configuration
from .evaluate import (
    ASSEMBLE,
    BOUND,
    CARRY_FRAMES,
    FACTORISE,
    FOLLOW,
    FORCES,
    MOVE,
    PREDICT,
    SOLVE,
    SPEED,
    STAND_STILL,
    START_POINT,
    START_STAGE,
    TAKE_STATE,
    UNKNOWNS,
    Evaluation,
    evaluate_at,
    solve_at,
)
from .storage import Storage
from .workspace import point_of, stage_of

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
    held_up : float
        Fraction, at most `fraction`, at which friction holds the step up.
    slip : Array
        Slip of each lagged contact along the step; see `forces.friction_limit`.
    """

    fraction: float
    pair: int
    held_up: float
    slip: Array


class Evaluator:
    """Evaluates forces of a model, one or several or all, through the functions that steps use.

    Its arrays are its own, so that evaluations leave a run as it is. A configuration is a `Place`; a stage is what a
    step freezes (`predict` or `stand_still`, then `start_stage`).

    Attributes
    ----------
    stage : Stage
    point : Point
        Start of a step, or origin of a stage: it may be changed between `start_point` and `predict`.
    first : FirstDerivatives
        Of the last evaluation.
    near : NearSurfaces or None
        Pairs of carriers and surfaces near each other; None where nothing can meet a surface.
    rods : NearRods or None
        Likewise of rods.
    """

    def __init__(self, model: Model):
        self.model = model
        # a stiffness of its own, whose columns are set to zero where bending or twisting is left out
        self._stiffness = model.joint_stiffness.copy()
        self._storage = Storage(replace(model, joint_stiffness=self._stiffness.view()))
        self.first, self.near, self.rods = self._storage.first, self._storage.near, self._storage.rods
        self._state = initial_state(model)
        self._arrays = StateArrays(**{name: getattr(self._state, name) for name in StateArrays.names})
        self.stage: Stage = stage_of(model)
        self.point: Point = point_of(model)
        bodies = len(model.bodies.names)
        self._turned = np.zeros(model.edge_count)
        self._poses = np.zeros((bodies, 3)), np.zeros((bodies, 3, 3)), np.zeros((bodies, 6))
        self._take_problem()

    @property
    def _problem(self) -> Problem:
        return self._storage.problem

    def _take_problem(self) -> None:
        """Have the present problem evaluated."""
        position, rotation, rates = self._poses
        self._call = Evaluation(
            problem=self._problem,
            state=self._arrays,
            stage=self.stage,
            point=self.point,
            turned=self._turned,
            position=position,
            rotation=rotation,
            rates=rates,
        )

    def _grow(self, status: int) -> None:
        if not self._storage.grow(status):
            raise ArithmeticError(f"the evaluation ended with status {status}")
        self._take_problem()

    def _do(self, operation: int, at: Place, base: Place | None = None, second: bool = False) -> tuple[float, float]:
        while True:
            status = evaluate_at(self._call, operation, base or at, at, second)
            if status == READY:
                figures = self._storage.outcome.figures
                return float(figures[ENERGY]), float(figures[GAP])
            self._grow(status)

    def _solve(self, operation: int, at: Place) -> tuple[float, float, int]:
        status, found = solve_at(self._call, operation, at), self._storage.outcome
        if status != READY:
            self._grow(status)
            raise LookupError("there was too little room: evaluate with second derivatives again")
        return float(found.figures[SHIFT]), float(found.figures[HELD_UP]), int(found.counts[PAIR])

    # configurations

    def new(self) -> Place:
        """A configuration, of which only what does not move is in place."""
        return configuration(self.model)

    def take_state(self, state: State, at: Place) -> None:
        """Make a configuration that of a state."""
        self._take(state)
        self._do(TAKE_STATE, at)

    def _take(self, state: State) -> None:
        for name in StateArrays.names:
            if name != "values":
                own, values = getattr(self._state, name), getattr(state, name)
                if own.size:
                    own[...] = values

    def move(self, base: Place, step: Array, body_step: Array, at: Place) -> None:
        """Make a configuration `base`, moved by a step of the unknowns, shape (size,), and of free bodies, shape
        (n_free, 6), both in space.
        """
        self._put(step, body_step)
        self._do(MOVE, at, base)

    def _put(self, step: Array, body_step: Array) -> None:
        system = self._problem.system
        system.step[:], system.body_step[:] = step, body_step

    def carry_frames(self, base: Place, angle: Array, at: Place) -> None:
        """Have frames of `base`, carried to the positions of `at` and turned by `angle` [rad], shape (n_edge,)."""
        at.angle[:] = angle
        self._do(CARRY_FRAMES, at, base)

    # stages

    def start_point(self, state: State, at: Place) -> Point:
        """Positions and momenta at the start of a step from a state, whose configuration is `at`."""
        self._take(state)
        self._do(START_POINT, at)
        return self.point

    def predict(
        self,
        at: Place,
        lengths: tuple[float, float],
        rest_edge: Array,
        rest_joint: Array,
        load_factor: Array,
        turned: Array | float = 0.0,
    ) -> None:
        """Freeze what a stage is from its origin, `point`; prescribed bodies rest where they are.

        Parameters
        ----------
        at : Place
            From which Newton begins.
        lengths : tuple of float
            γ h and γ′ h [s].
        rest_edge, rest_joint : Array
            Strains without stress, shapes (n_edge,), (n_joint, 3).
        load_factor : Array
            Of loads, shape (n_load,).
        turned : Array or float
            Turn of edges from the start of the step to `at` [rad], shape (n_edge,).
        """
        self.set_drive(rest_edge, rest_joint, load_factor)
        self.stage.lengths[:] = lengths
        self._turned[:] = turned
        position, rotation, rates = self._poses
        position[:], rotation[:], rates[:] = at.place[:-1], at.rotation[:-1], 0.0
        self._do(PREDICT, at)

    def stand_still(
        self, state: State, at: Place, length: float, rest_edge: Array, rest_joint: Array, load_factor: Array
    ) -> None:
        """Freeze a stage that ends where it begins, at `at`, with the velocities of a state: inertia asks for nothing.

        Other parameters as for `predict`; `length` is both of `lengths`.
        """
        self._take(state)
        self.set_drive(rest_edge, rest_joint, load_factor)
        self.stage.lengths[:] = length
        self._do(STAND_STILL, at)

    def set_drive(self, rest_edge: Array, rest_joint: Array, load_factor: Array) -> None:
        """Strains without stress, and factors of loads."""
        stage = self.stage
        stage.rest_edge[:], stage.rest_joint[:], stage.load_factor[:] = rest_edge, rest_joint, load_factor

    def start_stage(self, at: Place) -> None:
        """Freeze contacts for friction, and have everything follow the configuration that follows one."""
        self._do(START_STAGE, at)

    def follow(self, at: Place) -> None:
        """Let directions of drag and of followers, and the momentum of the fluid, be those of a configuration."""
        self._do(FOLLOW, at)

    # forces

    def select(self, forces: Iterable[str] | None) -> None:
        """Which forces are computed, all that the scene has or some by name.

        Raises
        ------
        LookupError
            If one does not act in the scene.
        """
        forces = self.model.forces if forces is None else tuple(forces)
        for name in forces:
            if name not in self.model.forces:
                raise LookupError(f"force {name!r}: does not act in the scene, but: {', '.join(self.model.forces)}")
        self._problem.sums.selected[:] = [name in forces for name in NAMES]
        bends = slice(self.model.bend_count)
        self._stiffness[bends] = self.model.joint_stiffness[bends]
        if "bending" not in forces:
            self._stiffness[bends, :2] = 0.0
        if "twisting" not in forces:
            self._stiffness[bends, 2] = 0.0

    def forces(self, at: Place, forces: Iterable[str] | None = None) -> dict[str, float]:
        """Energies [J] of all forces or of some by name; `first` holds their derivatives by nodes, edges, pairs, and
        free bodies, of which nothing has been handed on to the unknowns.
        """
        self.select(forces)
        self._do(FORCES, at)
        return self._energies()

    def evaluate(self, at: Place, forces: Iterable[str] | None = None, second: bool = False) -> dict[str, float]:
        """Energies [J] of all forces or of some by name; their derivatives by the unknowns and by free bodies are in
        `first`, with `second` those for `assemble` as well.
        """
        self.select(forces)
        self.total, self.gap = self._do(UNKNOWNS, at, second=second)
        return self._energies()

    def _energies(self) -> dict[str, float]:
        selected, energy = self._problem.sums.selected, self._storage.energy
        return {name: float(energy[k]) for k, name in enumerate(NAMES) if selected[k]}

    # the matrix

    def assemble(self, at: Place) -> tuple[Array, Array, Array]:
        """The matrix of the last evaluation with second derivatives, that of `at`: A as a band
        (`engine.linear.band`), U and D of free bodies, shapes (size + half-bandwidth, half-bandwidth + 1),
        (size, 6 n_free), (6 n_free, 6 n_free).

        What contacts of rods couple between two edges is in none of them, see `newton_step`.
        """
        self._solve(ASSEMBLE, at)
        problem, size = self._problem, self.model.solved_layout.size
        if not problem.border.exists:
            return problem.system.band, np.zeros((size, 0)), np.zeros((0, 0))
        return problem.system.band, problem.border.border[:size], problem.border.corner

    def factorise(self, at: Place) -> tuple[float, int]:
        """Factorise the matrix of the last evaluation of all forces with second derivatives, that of `at`.

        Returns
        -------
        shift : float
            Multiple of the masses that had to be added.
        simplified : int
            How far contacts of rods had to be simplified.
        """
        while True:
            try:
                shift, simplified, _ = self._solve(FACTORISE, at)
            except LookupError:
                self.evaluate(at, second=True)
                continue
            return shift, int(simplified)

    def newton_step(self, gradient: Array, body_gradient: Array) -> tuple[Array, Array]:
        """Minus the inverse of the factorised matrix times a gradient: of unknowns, shape (size,), and of free bodies,
        shape (n_free, 6), both in space.
        """
        problem = self._problem
        self.first.unknowns[:], self.first.body[:] = gradient, body_gradient
        self._solve(SOLVE, self._any())
        return problem.system.step.copy(), problem.system.body_step.copy()

    def speed(self, step: Array, body_step: Array) -> float:
        """Largest displacement of a material point in a step over the length of the stage [m/s]."""
        self._put(step, body_step)
        return self._solve(SPEED, self._any())[0]

    def bound(self, at: Place, step: Array, body_step: Array) -> StepBound:
        """How far a step may go from the configuration of the last evaluation."""
        self._put(step, body_step)
        fraction, held_up, pair = self._solve(BOUND, at)
        problem, count = self._problem, 0
        if problem.sliding.exists:
            count += int(problem.sliding.count[0])
        if self.rods is not None:
            count += self.rods.sliding.count
        slip = problem.slips.way[:count].copy() if problem.slips.exists else np.zeros((0, 0))
        return StepBound(fraction, pair, held_up, slip)

    def _any(self) -> Place:
        """A configuration where none is looked at."""
        if not hasattr(self, "_place"):
            self._place = self.new()
        return self._place
