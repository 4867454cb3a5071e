"""Static equilibrium: the potential's minimum without inertia, reached by steps that are no motion.

Each round minimises V(q) + ½ |q − q_k|²_M/h² from the shape q_k of the round before: an implicit Euler step of length h
that forgets all velocity (the proximal point method). Whatever h is, V falls in every round, and the rounds end only
where ∂V/∂q = 0; h grows tenfold while Newton's method succeeds, so that the last rounds are Newton's method on V alone.
What depends on velocities vanishes there: friction, mass damping, and drag but for that of a fluid which flows.
Forces that turn with what they act on, and moments on bodies, are taken at q_k and agree with the shape in the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, SimulationError
from ..kinematics.rotation import rotation_vector
from ..model.state import State
from ..solve.configuration import Configuration
from ..solve.newton import NewtonReport, NewtonSolver, NewtonStatus
from ..solve.terms.fluid import momentum_of_fluid
from ..solve.terms.term import StepContext
from .stepper import Stepper

Array = np.ndarray
FIRST, GROWTH, SHRINKAGE, SHORTEST = 1e-2, 10.0, 0.25, 1e-7
"""Length h of the first round [s], its factors after success and failure, and the length at which to give up [s]."""
SETTLED, LONGEST = 1.0, 100.0
"""Two rounds at least so long [s] must find the shape at rest, one after the other but for failures, which come
from rounding where nothing holds the robot; no round is longer than the second."""
MAX_ROUNDS = 300
WORTH_KEEPING = 1e-6
"""Of the longest rod: displacement of a round without convergence that is no rounding."""
OUT_OF_SIGHT = 100.0
"""Times the longest rod: displacement at which to conclude that nothing holds the robot."""
RELATIVE_TOLERANCE = 1e-10
"""Of the scene's longest rod: displacement that a round may make and still count as rest."""
WITHOUT_INERTIA = 1e9
"""Length of a step in which neither inertia nor dissipation counts [s]."""
SLOWEST_GROWTH = 0.1
"""Disturbances that grow more slowly count as neutral, as motions do that nothing resists [1/s]."""


@dataclass(frozen=True)
class StaticReport:
    """How the search for an equilibrium went.

    Attributes
    ----------
    stable : bool
        Whether every small disturbance decays or stays as it is.
    unstable_directions : int
        Dimension of the space of those that grow: negative eigenvalues of the Hessian.
    residual : float
        Largest displacement that Newton would still make [m].
    rounds, iterations, factorisations : int
        Potentials minimised, Newton corrections, and factorised Hessians.
    """

    stable: bool
    unstable_directions: int
    residual: float
    rounds: int
    iterations: int
    factorisations: int


def solve_static(stepper: Stepper, state: State, tolerance: float | None = None) -> StaticReport:
    """Bring a state to rest in an equilibrium under its present stimuli and loads; its time stays.

    Lagging layers are taken as settled, prescribed bodies stay where they are. From an unstable equilibrium nothing
    leads away but a disturbance: the report then says that it is unstable.

    Parameters
    ----------
    stepper : Stepper
    state : State
        Changed in place on success.
    tolerance : float, optional
        Displacement that counts as rest [m]; default: `RELATIVE_TOLERANCE` of the longest rod.

    Raises
    ------
    SimulationError
        If none is found; `state` is unchanged then, and the message says how close it came.
    """
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance: {tolerance} is not allowed; it must be a positive number of metres")
    search = _Search(stepper, state, tolerance)
    report = search.run()
    search.write(state)
    return report


class _Search:
    def __init__(self, stepper: Stepper, state: State, tolerance: float | None):
        model = stepper.model
        self.stepper, self.model, self.potential = stepper, model, stepper.potential
        self.time = float(state.time[0])
        self.size = max(rod.path.length for rod in model.scene.rods)
        self.tolerance = RELATIVE_TOLERANCE * self.size if tolerance is None else tolerance
        self.stimulus = stepper.surroundings.stimulus_at(state, self.time)
        self.transduction = self.stimulus[model.law_channel] if len(state.transduction) else state.transduction
        self.rest = stepper.surroundings.rest_strains_of(self.transduction)
        self.load_factor = stepper.surroundings.load_factor(self.time)
        self.start, self.end, self.trial = (Configuration(model) for _ in range(3))
        for configuration in (self.start, self.end, self.trial):
            configuration.take_state(state)
        self.first_position = state.position.copy()
        self.rounds = self.iterations = self.factorisations = 0

    def run(self) -> StaticReport:
        length, moved, settled = FIRST, math.inf, 0
        while self.rounds < MAX_ROUNDS:
            attempt = self._minimise(length)
            self.rounds += 1
            self.iterations += attempt.iterations
            self.factorisations += attempt.factorisations
            lost = not attempt.converged and attempt.status is not NewtonStatus.MAX_ITERATIONS
            if lost or (not attempt.converged and self._moved() < WORTH_KEEPING * self.size):
                length *= SHRINKAGE
                if length < SHORTEST:
                    raise self._failure(attempt.status.value, moved)
                continue
            moved = self._moved()
            if np.abs(self.end.position - self.first_position).max() > OUT_OF_SIGHT * self.size:
                raise self._failure("nothing holds the robot, or not all of it", moved)
            self.start, self.end = self.end, self.start
            self.start.turn[:] = 0.0
            if not attempt.converged:  # V has fallen all the same
                length, settled = SHRINKAGE * length, 0
                continue
            settled = settled + 1 if moved <= self.tolerance and length >= SETTLED else 0
            if settled == 2:
                unstable = self._count_unstable()
                counts = self.rounds, self.iterations, self.factorisations
                return StaticReport(unstable == 0, unstable, attempt.residual * length, *counts)
            length = min(GROWTH * length, LONGEST)
        raise self._failure("the shape does not come to rest", moved)

    def _minimise(self, length: float) -> NewtonReport:
        """One round: from `start` to `end`."""
        self.potential.start_step(self._stay(length))
        iterations = self.model.scene.solver.max_newton_iterations
        solver = NewtonSolver(self.model, self.potential, self.tolerance / length, iterations)
        self.end.set_moved(self.start, np.zeros(self.model.layout.size), np.zeros((self.model.free_count, 6)), 0.0)
        self.end.joint_strain[:, 2] = self.start.joint_strain[:, 2]
        report, end = solver.minimise(self.end, self.trial)
        if end is not self.end:
            self.end, self.trial = end, self.end
        return report

    def _stay(self, length: float) -> StepContext:
        """A step in which inertia and dissipation want everything to stay at `start`."""
        at, model = self.start, self.model
        return StepContext(
            length=length,
            start=at,
            origin_position=at.position,
            origin_turn=at.turn,
            origin_body_position=at.body_position,
            origin_body_rotation=at.body_rotation,
            origin_place=at.place,
            origin_rotation=at.rotation,
            origin_fluid_momentum=momentum_of_fluid(model, at, np.zeros_like(at.position)),
            predicted_position=at.position,
            predicted_turn=at.turn,
            predicted_body_position=at.body_position,
            predicted_body_rotation=at.body_rotation,
            rest=self.rest,
            load_factor=self.load_factor,
        )

    def _moved(self) -> float:
        """Largest displacement of a material point in the last round [m]."""
        largest = np.linalg.norm(self.end.position - self.start.position, axis=1).max()
        largest = max(largest, float(np.max(np.abs(self.end.turn) * self.model.half_width)))
        bodies = self.model.bodies
        for b, reach in enumerate(bodies.reach[bodies.body_of_free]):
            shift = np.linalg.norm(self.end.body_position[b] - self.start.body_position[b])
            turn = np.linalg.norm(rotation_vector(self.end.body_rotation[b] @ self.start.body_rotation[b].T))
            largest = max(largest, shift + reach * turn)
        return float(largest)

    def _count_unstable(self) -> int:
        self.potential.start_step(self._stay(WITHOUT_INERTIA))
        self.potential.evaluate(self.start, True)
        return self.potential.count_unstable(self.start, SLOWEST_GROWTH)

    def _failure(self, reason: str, moved: float) -> SimulationError:
        near = f"the last round moved it by {moved:.3g} m, allowed {self.tolerance:.3g} m"
        counts = f"{self.rounds} rounds, {self.iterations} iterations"
        return SimulationError(f"no static equilibrium found: {reason} ({near}; {counts})", self.time)

    def write(self, state: State) -> None:
        """The shape found, at rest."""
        model, shape = self.model, self.start
        state.position[:] = shape.position
        state.velocity.fill(0.0)
        state.director1[:] = shape.director1[: model.edge_count]
        state.spin.fill(0.0)
        state.twist[:] = shape.joint_strain[:, 2]
        state.transduction[:] = self.transduction
        state.kept.fill(0.0)
        self.stepper.restart(state)
        free = model.bodies.body_of_free
        state.body_position[free] = shape.body_position
        state.body_rotation[free] = shape.body_rotation
        state.body_velocity.fill(0.0)
        state.body_angular_velocity.fill(0.0)
