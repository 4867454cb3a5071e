"""Newton's method on the incremental potential, with line search and a step bound.

The Hessian is exact. Once factorised it serves several corrections as long as each is less than `KEEP_FACTOR_BELOW`
times the one before;
a new correction of the gradient at hand costs a fraction of a new factorisation. The last of them, not taken, is the
measure of convergence:
what Newton would still change, as the speed of the fastest material point [m/s].
What the potential takes at the configuration (`IncrementalPotential.follow`) moves along with every correction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..contact.step_bound import step_bound
from ..jit import kernel
from ..model.bodies import carrier_names
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
def _largest_move(step, node_unknown, edge_unknown, half_width):
    """Largest displacement of a node, or of an edge's border by its turn [m]; NaN if any is."""
    largest = 0.0
    for i in range(node_unknown.shape[0]):
        d = node_unknown[i]
        size = math.sqrt(step[d] ** 2 + step[d + 1] ** 2 + step[d + 2] ** 2)
        if math.isnan(size):
            return size
        largest = max(largest, size)
    for k in range(edge_unknown.shape[0]):
        size = abs(step[edge_unknown[k]]) * half_width[k]
        if math.isnan(size):
            return size
        largest = max(largest, size)
    return largest


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
        self._tolerance = tolerance
        self._max_iterations = max_iterations
        self._carrier_step = np.zeros((len(model.carriers.weight), 3))
        self._node_step = model.layout.node[:, None] + np.arange(3)
        self._reach = model.bodies.reach
        self._moving = _Moving(model)

    def speed(self, step: Array, body_step: Array) -> float:
        """Largest displacement of a material point in a step, over the length of the time step [m/s]; NaN if any is."""
        model = self._model
        if not np.isfinite(body_step).all():
            return math.nan
        largest = _largest_move(step, model.layout.node, model.layout.edge, model.half_width)
        for b in range(model.free_count):
            turn = self._reach[b] * math.sqrt(body_step[b, 3:] @ body_step[b, 3:])
            largest = max(largest, math.sqrt(body_step[b, :3] @ body_step[b, :3]) + turn)
        return float(largest / self._potential.context.length)

    def bound(self, at: Configuration, carrier_step: Array) -> tuple[float, int]:
        """`contact.step_bound` of carriers at a configuration."""
        if not self._potential.has_contact:
            return 1.0, -1
        carriers = self._model.carriers
        pairs = slice(None) if self._potential.has_balls else slice(0)
        planes = slice(None) if self._potential.has_planes else slice(0)
        alpha, blocking = step_bound(
            at.carrier,
            carrier_step,
            carriers.radius,
            carriers.plane_point[planes],
            carriers.plane_normal[planes],
            carriers.pair_first[pairs],
            carriers.pair_second[pairs],
        )
        rods, nodes = self._potential.matrix.rods, self._model.node_count
        if rods is None:
            return alpha, blocking
        between, node = rods.step_bound(at.position, carrier_step[:nodes])
        return (alpha, blocking) if alpha <= between else (between, node)

    def first_guess(self, context: StepContext, target: Configuration, guess: Configuration) -> NewtonReport | None:
        """Set `guess` to the start of the step moved by its velocity, prescribed nodes and points to their place.

        Parameters
        ----------
        context : StepContext
        target : Configuration
            Whose carriers hold the prescribed positions at the end of the step; is overwritten.
        guess : Configuration

        Returns
        -------
        NewtonReport or None
            A report if prescribed motion is blocked.
        """
        model, start = self._model, context.start
        free = self._moving.free
        move = target.carrier - start.carrier
        inertial = np.zeros_like(move)
        inertial[: model.node_count] = context.predicted_position - start.position
        self._moving.add_bodies(context.predicted_body_position - start.body_position, inertial)
        fraction = 1.0
        for retry in (0.5, 0.0, None):
            move[free] = fraction * inertial[free]
            alpha, blocking = self.bound(start, move)
            if alpha >= 1.0:
                break
            if retry is None:
                name = carrier_names(model)[blocking] if blocking >= 0 else "a rod"
                return NewtonReport(NewtonStatus.BLOCKED, 0, 0, math.inf, detail=f"{name} would reach a surface")
            fraction *= retry * alpha
        guess.carrier[:] = start.carrier + move
        guess.turn[:] = fraction * context.predicted_turn
        guess.body_position[:] = start.body_position + fraction * (
            context.predicted_body_position - start.body_position
        )
        guess.body_rotation[:] = start.body_rotation
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
        energy = potential.evaluate(at, True)
        backtracks = 0
        fresh, previous = True, math.inf
        status = NewtonStatus.MAX_ITERATIONS
        residual = math.inf
        if not math.isfinite(energy):
            return NewtonReport(NewtonStatus.NOT_FINITE, 0, 0, math.inf), at
        if not potential.factorise(at):
            return NewtonReport(NewtonStatus.INDEFINITE, 0, 1, math.inf), at
        factorisations = iterations = 1
        while True:
            step, body_step = potential.newton_step()
            residual = self.speed(step, body_step)
            if not math.isfinite(residual):
                status = NewtonStatus.NOT_FINITE
                break
            if residual <= self._tolerance:
                status = NewtonStatus.CONVERGED
                break
            if iterations >= self._max_iterations:
                break
            if not fresh and residual > KEEP_FACTOR_BELOW * previous:
                energy = potential.evaluate(at, True)
                factorisations += 1
                iterations += 1
                fresh, previous = True, math.inf
                if not potential.factorise(at):
                    status = NewtonStatus.INDEFINITE
                    break
                continue
            moved = self._search(at, trial, step, body_step, energy)
            if moved is None:
                if fresh:
                    status = NewtonStatus.LINE_SEARCH
                    break
                previous = 0.0  # a direction of an old matrix: try that of a new one
                potential.evaluate(at, False)
                continue
            energy, halvings = moved
            backtracks += halvings
            iterations += not fresh
            fresh, previous = False, (residual if halvings == 0 else 0.0)
            at, trial = trial, at
            if potential.follow(at):
                energy = potential.evaluate(at, False)
        return NewtonReport(status, iterations, factorisations, residual, backtracks), at

    def _search(self, at, trial, step: Array, body_step: Array, energy: float) -> tuple[float, int] | None:
        """Backtrack from the bound that keeps gaps open until the potential falls; None if it never does."""
        potential, model = self._potential, self._model
        slope = float(potential.gradient @ step) + float(np.sum(potential.body_gradient * body_step))
        noise = ROUNDING * sum(abs(value) for value in potential.terms.values())
        self._carrier_step[: model.node_count] = step[self._node_step]
        self._moving.add_bodies(body_step[:, :3], self._carrier_step)
        self._moving.add_turns(body_step[:, 3:], at, self._carrier_step)
        alpha, _ = self.bound(at, self._carrier_step)
        bounded = alpha < 1.0
        for halvings in range(MAX_BACKTRACKS):
            trial.set_moved(at, step, body_step, alpha)
            value = potential.evaluate(trial, False)
            if value <= energy + ARMIJO * alpha * slope + noise:
                return value, halvings + bounded
            alpha *= BACKTRACKING
        return None


class _Moving:
    """Which carriers move freely, and which of them a free body carries.

    What a turning body carries moves on an arc, which the bound follows along its tangent at the start of the iterate.
    Where the arc ends behind a surface the potential is infinite, and the line search turns less.
    """

    def __init__(self, model: Model):
        carriers = model.carriers
        body = np.full(len(carriers.weight), -1, dtype=np.int64)
        body[model.attached_node] = model.attached_free
        body[model.node_count : model.node_count + model.point_count] = model.bodies.free_index[carriers.point_body]
        balls = carriers.free_body >= 0
        body[balls] = carriers.free_body[balls]
        self._carried = np.flatnonzero(body >= 0)
        self._body = body[self._carried]
        self._turned = np.flatnonzero((body >= 0) & ~balls)
        self._body_of_turned = body[self._turned]
        self.free = np.zeros(len(carriers.weight), dtype=bool)
        self.free[: model.node_count] = True
        self.free[model.attached_node] = False
        self.free[self._carried] = True

    def add_bodies(self, displacement: Array, carrier_step: Array) -> None:
        """Write the displacement of free bodies [m], shape (n_free, 3), into the steps of what they carry."""
        carrier_step[self._carried] = displacement[self._body]

    def add_turns(self, turn: Array, at: Configuration, carrier_step: Array) -> None:
        """Add what rotation vectors of free bodies [rad], shape (n_free, 3), do to nodes and points off centre."""
        if len(self._turned):
            arms = at.carrier[self._turned] - at.body_position[self._body_of_turned]
            carrier_step[self._turned] += np.cross(turn[self._body_of_turned], arms)
