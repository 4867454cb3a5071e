"""Newton's method on the incremental potential, with line search and a step bound.

The Hessian is exact. Once factorised it serves several corrections as long as each is less than `KEEP_FACTOR_BELOW`
times the one before;
a new correction of the gradient at hand costs a fraction of a new factorisation. The measure of convergence is the
speed of the fastest material point in the last of them [m/s], which is still taken.
What the potential takes at the configuration (`IncrementalPotential.follow`) moves along with every correction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..jit import kernel
from ..kinematics.rotation import rotation_matrix, rotation_vector
from ..model.carriers import carrier_names
from ..model.model import Model
from .configuration import Configuration
from .potential import IncrementalPotential
from .terms.term import StepContext

Array = np.ndarray
ARMIJO = 1e-4  # least fraction of the predicted decrease (Nocedal and Wright 2006, ch. 3)
KEEP_FACTOR_BELOW = 0.2  # ratio of successive corrections
BACKTRACKING = 0.5
MAX_BACKTRACKS = 30
ROUNDING = 1e-13  # of the sum of the terms' magnitudes: differences of the potential below it mean nothing


@kernel
def largest_move(step, node_unknown, edge_unknown, half_width):
    """Largest displacement of a node, or of an edge's border by its turn [m]; NaN if any is."""
    largest, total = 0.0, 0.0
    for i in range(node_unknown.shape[0]):
        d = node_unknown[i]
        square = step[d] ** 2 + step[d + 1] ** 2 + step[d + 2] ** 2
        total += square
        largest = max(largest, square)
    largest = math.sqrt(largest)
    for k in range(edge_unknown.shape[0]):
        size = abs(step[edge_unknown[k]]) * half_width[k]
        total += size
        largest = max(largest, size)
    return total if math.isnan(total) else largest


class NewtonStatus(Enum):
    """How an attempt at a step ended; the value is the message."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "Newton did not converge within the allowed iterations"
    LINE_SEARCH = "no step along the Newton direction lowers the potential"
    INDEFINITE = "the Newton matrix cannot be made positive definite"
    NOT_FINITE = "the potential or its gradient is not finite"
    BEYOND = "the end of the step, beyond its last stage, lies behind a surface"
    BLOCKED = "prescribed motion would push a surface through another one"


@dataclass(frozen=True)
class NewtonReport:
    """Result of one attempt at a step.

    Attributes
    ----------
    status : NewtonStatus
    iterations : int
        Exact Hessians factorised, and further corrections taken with a kept one.
    factorisations : int
        The former alone.
    residual : float
        Speed of the correction that was left [m/s].
    backtracks : int
        Halvings of the line search, all iterations together.
    detail : str
        What a message may add: the blocking node.
    """

    status: NewtonStatus
    iterations: int
    factorisations: int
    residual: float
    backtracks: int = 0
    detail: str = ""

    @property
    def converged(self) -> bool:
        """Whether the step may be accepted."""
        return self.status is NewtonStatus.CONVERGED


class NewtonSolver:
    """Minimises the incremental potential of a model."""

    def __init__(self, model: Model, potential: IncrementalPotential, tolerance: float, max_iterations: int):
        self._model = model
        self._potential = potential
        self.tolerance = tolerance
        self._max_iterations = max_iterations
        bodies = model.bodies
        self._node_unknown = model.layout.node[:, None] + np.arange(3)
        self._reach = bodies.reach[bodies.body_of_free]
        self._prescribed = np.flatnonzero(bodies.free_index[:-1] < 0)
        self._turns = [f >= 0 or len(r) > 0 for f, r in zip(bodies.free_index, bodies.rotations, strict=False)]
        self._motion = np.zeros((len(bodies.names) + 1, 6))  # of all bodies and of the world

    def speed(self, step: Array, body_step: Array) -> float:
        """Largest displacement of a material point in a step, over the length of the time step [m/s]; NaN if any is."""
        model = self._model
        if not np.isfinite(body_step).all():
            return math.nan
        largest = largest_move(step, model.layout.node, model.layout.edge, model.half_width)
        for b in range(model.free_count):
            turn = self._reach[b] * math.sqrt(body_step[b, 3:] @ body_step[b, 3:])
            largest = max(largest, math.sqrt(body_step[b, :3] @ body_step[b, :3]) + turn)
        return float(largest / self._potential.context.length)

    def bound(self, at: Configuration, node_step: Array, body_motion: Array) -> tuple[float, int]:
        """Largest fraction of a step that keeps all gaps open, and the near pair that sets it (−1: none, or rods).

        Parameters
        ----------
        at : Configuration
        node_step : Array
            Displacement of nodes [m], shape (n_node, 3); those that bodies hold follow their bodies.
        body_motion : Array
            Displacement [m] and rotation vector [rad] of bodies and of the world, shape (n_body + 1, 6).
        """
        near, rods = self._potential.near, self._potential.matrix.rods
        alpha, blocking = near.bound(at, node_step, body_motion) if near else (1.0, -1)
        if rods is not None:
            between, _ = rods.step_bound(at.position, self._with_held(at, node_step, body_motion))
            if between < alpha:
                return between, -1
        return alpha, blocking

    def _with_held(self, at: Configuration, node_step: Array, body_motion: Array) -> Array:
        """`node_step` with the displacements of nodes that bodies hold."""
        model, held = self._model, body_motion[self._model.attached_body]
        node_step = node_step.copy()
        node_step[model.attached_node] = held[:, :3]
        if held[:, 3:].any():
            node_step[model.attached_node] += np.cross(held[:, 3:], at.arm)
        return node_step

    def bound_between(self, start: Configuration, end: Configuration) -> float:
        """`bound` from one configuration to another."""
        self._find_motion(start, end, range(len(self._motion) - 1))
        return self.bound(start, end.position - start.position, self._motion)[0]

    def _find_motion(self, start: Configuration, end: Configuration, bodies) -> None:
        """Motion of some bodies from one configuration to another."""
        for b in bodies:
            self._motion[b, :3] = end.place[b] - start.place[b]
            if self._turns[b]:
                self._motion[b, 3:] = rotation_vector(end.rotation[b] @ start.rotation[b].T)

    def who_blocks(self, pair: int) -> str:
        """What a message says of the near pair that blocks prescribed motion."""
        if pair < 0:
            return "a rod would reach another"
        model, near = self._model, self._potential.near
        surface = model.surfaces.names[near.surface[pair]]
        return f"{carrier_names(model)[near.carrier[pair]]} would reach the surface of {surface}"

    def first_guess(self, context: StepContext, target: Configuration, guess: Configuration) -> NewtonReport | None:
        """Set `guess` to the start of the step moved by its velocity, prescribed bodies to their place.

        Parameters
        ----------
        context : StepContext
        target : Configuration
            Whose prescribed bodies are where they are to be at the end of the step.
        guess : Configuration

        Returns
        -------
        NewtonReport or None
            A report if prescribed motion is blocked.
        """
        model, start, motion = self._model, context.start, self._motion
        free = model.bodies.body_of_free
        self._find_motion(start, target, self._prescribed)
        turn = np.zeros((model.free_count, 3))
        for b in range(model.free_count):
            turn[b] = rotation_vector(context.predicted_body_rotation[b] @ start.body_rotation[b].T)
        inertial = context.predicted_position - start.position
        body_inertial = context.predicted_body_position - start.body_position
        fraction = 1.0
        for retry in (0.5, 0.0, None):
            motion[free, :3], motion[free, 3:] = fraction * body_inertial, fraction * turn
            alpha, blocking = self.bound(start, fraction * inertial, motion)
            if alpha >= 1.0:
                break
            if retry is None:
                return NewtonReport(NewtonStatus.BLOCKED, 0, 0, math.inf, detail=self.who_blocks(blocking))
            fraction *= retry * alpha
        guess.position[:] = start.position + fraction * inertial
        guess.turn[:] = fraction * context.predicted_turn
        guess.place[self._prescribed] = target.place[self._prescribed]
        guess.rotation[self._prescribed] = target.rotation[self._prescribed]
        guess.body_position[:] = start.body_position + fraction * body_inertial
        for b in range(model.free_count):
            guess.body_rotation[b] = rotation_matrix(fraction * turn[b]) @ start.body_rotation[b]
        guess.place_held()
        guess.carry_frames(start, guess.turn)
        guess.joint_strain[:, 2] = start.joint_strain[:, 2]
        return None

    def minimise(self, at: Configuration, trial: Configuration) -> tuple[NewtonReport, Configuration]:
        """Move `at` to the minimum of the potential; `trial` is scratch. Returns the report and the final
        configuration.
        """
        potential = self._potential
        potential.follow(at)
        stale, fresh, previous = True, False, math.inf
        residual, energy = math.inf, math.inf
        iterations = factorisations = backtracks = 0
        status = NewtonStatus.MAX_ITERATIONS
        while True:
            if stale:
                energy = potential.evaluate(at, True)
                if factorisations == 0 and not math.isfinite(energy):
                    status = NewtonStatus.NOT_FINITE
                    break
                factorisations += 1
                if not potential.factorise(at):
                    status = NewtonStatus.INDEFINITE
                    break
                iterations += 1
                stale, fresh = False, True
            step, body_step = potential.newton_step()
            residual = self.speed(step, body_step)
            if not math.isfinite(residual):
                status = NewtonStatus.NOT_FINITE
                break
            if residual <= self.tolerance:
                status = NewtonStatus.CONVERGED
                at = self._take_last(at, trial, step, body_step)
                break
            if iterations >= self._max_iterations:
                break
            if not fresh and residual > KEEP_FACTOR_BELOW * previous:
                stale = True
                continue
            moved = self._search(at, trial, step, body_step, energy, fresh)
            if moved is None:
                if fresh:
                    status = NewtonStatus.LINE_SEARCH
                    break
                stale = True  # a direction of an old matrix: try that of a new one
                continue
            energy, halvings, stale = moved
            backtracks += halvings
            iterations += not fresh
            fresh, previous = False, residual
            at, trial = trial, at
            if potential.follow(at) and not stale:
                energy = potential.evaluate(at, False)
        return NewtonReport(status, iterations, factorisations, residual, backtracks), at

    def _take_last(self, at: Configuration, trial: Configuration, step: Array, body_step: Array) -> Configuration:
        """`at` moved by a correction, as far as gaps stay open."""
        self._motion[self._prescribed] = 0.0
        self._motion[self._model.bodies.body_of_free] = body_step
        alpha, _ = self.bound(at, step[self._node_unknown], self._motion)
        trial.set_moved(at, step, body_step, alpha)
        trial.joint_strain[:] = at.joint_strain
        return trial

    def _search(
        self, at, trial, step: Array, body_step: Array, energy: float, fresh: bool
    ) -> tuple[float, int, bool] | None:
        """Backtrack from the bound that keeps gaps open, and from where friction holds up a step of a `fresh` matrix,
        until the potential falls; None if it never does.

        Returns
        -------
        energy : float
            [J]
        backtracks : int
            Of the line search and of the bound on gaps.
        short : bool
            Whether the step was cut short.
        """
        potential, model = self._potential, self._model
        slope = float(potential.gradient @ step) + float(np.sum(potential.body_gradient * body_step))
        noise = ROUNDING * sum(abs(value) for value in potential.terms.values())
        self._motion[self._prescribed] = 0.0
        self._motion[model.bodies.body_of_free] = body_step
        node_step = step[self._node_unknown]
        alpha, _ = self.bound(at, node_step, self._motion)
        bounded = alpha < 1.0
        if fresh:
            node_step = self._with_held(at, node_step, self._motion)
            alpha = potential.held_up(at, node_step, self._motion, slope, alpha)
        short = alpha < 1.0
        for halvings in range(MAX_BACKTRACKS):
            trial.set_moved(at, step, body_step, alpha)
            value = potential.evaluate(trial, False)
            if value <= energy + ARMIJO * alpha * slope + noise:
                return value, halvings + bounded, short or halvings > 0
            alpha *= BACKTRACKING
        return None
