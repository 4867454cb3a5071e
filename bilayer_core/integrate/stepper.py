"""One nominal step: as few equal parts as Newton needs, each accepted only if it converged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SimulationError
from ..model.model import Model, body_displacement
from ..model.state import State
from ..scene.transduction import follow, free_strain
from ..solve.configuration import Configuration
from ..solve.newton import NewtonReport, NewtonSolver
from ..solve.potential import IncrementalPotential
from . import implicit_euler

if TYPE_CHECKING:
    from .ledger import EnergyLedger

Array = np.ndarray


@dataclass(frozen=True)
class StepReport:
    """How a nominal step went.

    Attributes
    ----------
    time : float
        At its end [s].
    substeps, rejected : int
        Parts accepted, and attempts that failed.
    iterations, factorisations : int
        Newton corrections and factorised Hessians, failed attempts included.
    residual : float
        Largest speed of a correction left [m/s].
    """

    time: float
    substeps: int
    rejected: int
    iterations: int
    factorisations: int
    residual: float


class Stepper:
    """Advances a `State` by nominal steps dt, halving where Newton fails and doubling again where it succeeds.

    Attributes
    ----------
    end : Configuration
        The last accepted configuration.
    stimulus : Array
        Value of each channel over the last step.
    ledger : EnergyLedger or None
        What keeps the energy budget, if anything does.
    """

    def __init__(self, model: Model, dt: float, tolerance: float, max_iterations: int, max_halvings: int):
        self.model = model
        self.dt = dt
        self.max_halvings = max_halvings
        self.potential = IncrementalPotential(model)
        self.solver = NewtonSolver(model, self.potential, tolerance, max_iterations)
        self._start = Configuration(model)
        self._target = Configuration(model)
        self.end = Configuration(model)
        self._trial = Configuration(model)
        self._channels = list(model.scene.stimuli.values())
        self.stimulus = np.zeros(len(self._channels))
        self.eigenstrain = np.zeros(model.edge_count)
        self.ledger: EnergyLedger | None = None

    def body_positions(self, state: State, time: float) -> Array:
        """Positions of all bodies: prescribed ones at `time`, free ones as they are [m], shape (n_body, 3)."""
        bodies = self.model.bodies
        position = state.body_position.copy()
        for index in np.flatnonzero(bodies.free_index < 0):
            position[index] = bodies.start_position[index] + body_displacement(
                bodies.times[index], bodies.displacements[index], time
            )
        return position

    def stimulus_at(self, state: State, time: float) -> Array:
        """Value of each channel at `time`: that set from outside, or the schedule's, shape (n_channel,)."""
        scheduled = np.array([channel.schedule.value(time) for channel in self._channels])
        return np.where(np.isnan(state.override), scheduled, state.override)

    def eigenstrain_of(self, transduction: Array) -> Array:
        """Eigenstrain of each edge from the filtered stimuli, shape (n_edge,)."""
        model = self.model
        strain = free_strain(transduction, model.law_gain, model.law_reference, model.law_saturation)
        total = np.bincount(model.driven_edge, strain[model.driven_law], model.edge_count)
        return total.astype(float, copy=False)  # whole numbers if nothing is driven

    def load_factor(self, time: float) -> Array:
        """Factor of each load at `time`, shape (n_load,)."""
        return np.array([load.factor(time) for load in self.model.scene.loads], dtype=float)

    def rest(self, state: State) -> None:
        """Evaluate the potential at a state as it stands, for energies and contact forces before the first step."""
        time = float(state.step[0]) * self.dt
        self._start.take_state(state, state.body_position)
        self.end.take_state(state, state.body_position)
        self.stimulus = self.stimulus_at(state, time)
        self.eigenstrain = self.eigenstrain_of(state.transduction)
        still = State(**{**vars(state), "velocity": np.zeros_like(state.velocity), "spin": np.zeros_like(state.spin)})
        self.potential.start_step(
            implicit_euler.predict(self.model, still, self._start, self.dt, self.eigenstrain, self.load_factor(time))
        )
        self.potential.evaluate(self.end, False)

    def advance(self, state: State) -> StepReport:
        """One nominal step, in place.

        Raises
        ------
        SimulationError
            If the smallest part does not converge either. `state` is then that of the last accepted part whose end is
            a nominal step:
            nothing is changed.
        """
        parts = 2**self.max_halvings
        if self.ledger is not None:
            self.ledger.mark()
        kept = State(**{name: array.copy() for name, array in vars(state).items()})
        level = int(state.halvings[0])
        done = substeps = rejected = iterations = factorisations = 0
        residual = 0.0
        while done < parts:
            size = parts >> level
            fraction = (done + size) / parts
            time = (float(state.step[0]) + fraction) * self.dt
            report = self._attempt(state, self.dt * size / parts, time)
            iterations += report.iterations
            factorisations += report.factorisations
            if report.converged:
                done += size
                substeps += 1
                residual = max(residual, report.residual)
                if level > 0 and done % (2 * size) == 0:
                    level -= 1
                continue
            rejected += 1
            if level == self.max_halvings:
                for name, array in vars(kept).items():
                    getattr(state, name)[...] = array
                if self.ledger is not None:
                    self.ledger.roll_back()
                raise SimulationError(
                    self._explain(report, time, self.dt * size / parts), float(kept.step[0]) * self.dt
                )
            level += 1
        state.step += 1.0
        state.halvings[0] = level
        return StepReport(float(state.step[0]) * self.dt, substeps, rejected, iterations, factorisations, residual)

    def _attempt(self, state: State, h: float, time: float) -> NewtonReport:
        """Try one part of length `h` [s] that ends at `time` [s]; `state` changes only if it converged."""
        stimulus = self.stimulus_at(state, time)
        transduction = state.transduction
        if len(transduction):
            target = stimulus[self.model.law_channel]
            transduction = follow(transduction, target, self.model.law_rising, self.model.law_falling, h)
        eigenstrain = self.eigenstrain_of(transduction)
        self._start.take_state(state, state.body_position)
        context = implicit_euler.predict(self.model, state, self._start, h, eigenstrain, self.load_factor(time))
        self.potential.start_step(context)
        body_position = self.body_positions(state, time)
        self._target.place_prescribed(body_position)
        held = self.model.attached_body
        self._target.position[self.model.attached_node] = body_position[held] + self.model.attached_position
        report = self.solver.first_guess(context, self._target, self.end)
        if report is not None:
            return report
        report, end = self.solver.minimise(self.end, self._trial)
        if end is not self.end:
            self.end, self._trial = end, self.end
        if report.converged:
            implicit_euler.accept(self.model, state, context, self.end)
            state.transduction[:] = transduction
            prescribed = self.model.bodies.free_index < 0
            state.body_velocity[prescribed] = (body_position - state.body_position)[prescribed] / h
            state.body_position[prescribed] = body_position[prescribed]
            self.stimulus, self.eigenstrain = stimulus, eigenstrain
            if self.ledger is not None:
                self.ledger.record(state, eigenstrain, context.load_factor, h)
        return report

    def _explain(self, report: NewtonReport, time: float, h: float) -> str:
        text = f"{report.status.value} in the step to t = {time:.6g} s, tried down to {h:.3g} s"
        if np.isfinite(report.residual):
            tolerance = self.model.scene.solver.tolerance
            text += f" (correction left {report.residual:.3g} m/s, allowed {tolerance:.3g} m/s, "
            text += f"{report.iterations} iterations)"
        return text + (f": {report.detail}" if report.detail else "")
