"""Steps in time: fixed ones, or as long as their error allows (`engine.integrate`), and what acts during them."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bilayer_core.engine.energy_account import LARGEST
from bilayer_core.engine.engine import Engine
from bilayer_core.engine.integrate import TIME_ROUNDING, StepControl
from bilayer_core.engine.newton import LAST_DIGITS
from bilayer_core.engine.observables import Observables, observables_of
from bilayer_core.engine.request_modes import EVALUATE_STATE
from bilayer_core.engine.step import LEAST_LENGTH
from bilayer_core.engine.step_outcome import FAILURES, IntegrationReport
from bilayer_core.engine.step_size import reach
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.integrators.method import Method
from bilayer_core.model.model import Model
from bilayer_core.model.records.status import (
    COLLAPSED,
    CONVERGED,
    CROSSED,
    GAINS_ENERGY,
    INPUTS_END,
    PAUSED,
    TOO_INACCURATE,
)
from bilayer_core.model.state import NOT_KNOWN, State
from bilayer_core.scene.config import SceneConfig
from bilayer_core.simulation.collapse import collapsed
from bilayer_core.simulation.contact_pairs import ContactOwners
from bilayer_core.simulation.crossing_remedy import crossing, edge_of_strand
from bilayer_core.simulation.energy_budget import EnergyLedger
from bilayer_core.simulation.parts import Parts, Places
from bilayer_core.simulation.remedies import remedy
from bilayer_core.simulation.step_choice import Steps
from bilayer_core.simulation.surroundings import Surroundings

FIXED_ROUNDING = 1e-6
"""Part of a fixed step by which two times are the same."""
PERIOD = 0.5
"""After which steps pause, for somebody to be asked whether they are to go on [s]."""
FIRST_PASSES = 5
"""Of Newton's method, before the first pause: they last 0.4 s with 1,400 stations of two layers in contact."""
PATIENCE = 2
"""How many times as many more end an attempt at a step, which is lost then; the next one may take twice as many."""


@dataclass(frozen=True)
class StepReport:
    """How a step went.

    Attributes
    ----------
    time : float
        At its end [s].
    length : float
        [s].
    substeps, rejected : int
        Parts accepted, and attempts that were not.
    iterations, factorisations : int
        Newton corrections and factorised Hessians, failed attempts included.
    residual : float
        Largest speed of a last correction [m/s].
    inaccurate : int
        Attempts that were not accepted because of their error.
    """

    time: float
    length: float
    substeps: int
    rejected: int
    iterations: int
    factorisations: int
    residual: float
    inaccurate: int = 0


class Stepper:
    """Advances a `State` in time.

    Parameters
    ----------
    model : Model
    method : Method
    steps : Steps
        How long steps are.
    max_iterations : int
        Of Newton's method in a stage.

    Attributes
    ----------
    surroundings : Surroundings
    ahead : float
        By which these reach beyond the present, at least [s].
    same_time : float
        Two times that differ by no more are one [s].
    ledger : EnergyLedger or None
        Keeps the energy budget, if anything does; `begin_budget` comes before the first step.

    Raises
    ------
    InputError
        If steps are adaptive and the method has no estimate of its error.
    """

    def __init__(self, model: Model, method: Method, steps: Steps, max_iterations: int):
        self._method = method
        self.ledger: EnergyLedger | None = None
        self._passes = FIRST_PASSES
        self._build(model, steps, max_iterations)

    def _build(self, model: Model, steps: Steps, max_iterations: int) -> None:
        control = self._control_of(model, steps)
        self.engine = Engine(model, self._method, control, steps.newton_tolerance, max_iterations)
        self.engine.actuation = self.surroundings.actuation
        for name in ("_observables", "contact_owners"):
            vars(self).pop(name, None)

    def _control_of(self, model: Model, steps: Steps) -> StepControl:
        """Take steps of a model, with what acts on it."""
        method = self._method
        if steps.adaptive and method.estimate is None:
            raise InputError(
                f"tolerance: {steps.tolerance:g} is not allowed with the integrator {method.name}, which has no "
                "estimate of its error; leave it out, or take another integrator"
            )
        self.model, self.steps = model, steps
        first = min(steps.dt, steps.longest) if steps.adaptive else steps.dt
        rounding = TIME_ROUNDING if steps.adaptive else FIXED_ROUNDING
        self.same_time = max(first * rounding, LAST_DIGITS * model.scene.duration)
        self._first, self._longest = first, steps.longest if steps.adaptive else steps.dt
        self.ahead = 2.0 * first
        self.surroundings = Surroundings(model, self.ahead)
        return StepControl(
            dt=0.0 if steps.adaptive else steps.dt,
            order=method.order,
            tolerance=steps.tolerance or math.inf,
            first=first,
            shortest=steps.shortest,
            least_travel=steps.least_travel,
            longest=self._longest,
            same=self.same_time,
        )

    def take_scene(self, scene: SceneConfig, steps: Steps, max_iterations: int) -> None:
        """Take another scene of the same model (`simulation.same_model`), with its steps; nothing is built."""
        model = replace(self.model, scene=scene)
        control = self._control_of(model, steps)
        self.engine.take_scene(model, control, steps.newton_tolerance, max_iterations)
        self.engine.actuation = self.surroundings.actuation
        if self.ledger is not None:
            self.ledger = EnergyLedger(model)

    def take_model(self, model: Model, steps: Steps) -> None:
        """Take another model in which a state goes on, with its steps; extrema of the run are kept."""
        extrema = self.engine.extrema
        self._build(model, steps, model.scene.solver.max_newton_iterations)
        self.engine.take_extrema(extrema)

    def begin_budget(self, state: State) -> None:
        """Start the energy budget from zero at a state, if it is kept."""
        if self.ledger is not None:
            self.ledger.begin(state, self.surroundings.load_factor(state))

    @cached_property
    def _observables(self) -> tuple[Observables, Places]:
        owners = self.contact_owners
        return observables_of(self.model, owners.of_point, owners.of_surface, owners.count, owners.seen_pair)

    def observe(self, state: State) -> tuple[Parts, np.ndarray]:
        """Return the observables of a state that was reached or evaluated last, by their names in `engine.observables`,
        and the numbers of the pairs that touch: copies.
        """
        found, places = self._observables
        self.engine.observe(state, found)
        return Parts(found.values.copy(), places), found.touching[: found.touching_count[0]].copy()

    @cached_property
    def contact_owners(self) -> ContactOwners:
        """Whose what touches is."""
        return ContactOwners(self.model)

    @property
    def stimulus(self) -> np.ndarray:
        """Value of each channel over the last step, shape (n_channel,)."""
        return self.engine.stimulus

    def evaluate(self, state: State) -> None:
        """Evaluate the potential at a state as it stands, for energies and contact forces before the next step; where
        it does not know what touches, it takes that from there.
        """
        time = float(state.time[0])
        self.engine.set_drive(state, self.surroundings.load_factor(state))
        self.engine.do_once(state, EVALUATE_STATE)
        unknown = state.touched == NOT_KNOWN
        state.touched[unknown] = self.engine.touching[: len(unknown)][unknown]
        self.engine.stimulus[:] = self.surroundings.stimulus_at(state, time)

    def restart(self, state: State) -> None:
        """Begin again with the first step's length: something has jumped."""
        state.next_step[0] = min(float(state.next_step[0]), self._first)
        state.last_error[0] = 0.0

    def reach(self, state: State) -> float:
        """Return a time that the next step from a state does not pass [s]."""
        planned = float(state.next_step[0])
        return float(state.time[0]) + reach.py_func(min(planned, self._longest) if planned > 0.0 else self._first)

    def integrate(
        self,
        state: State,
        most: int,
        until: float,
        due: float = math.inf,
        interrupted: Callable[[], bool] | None = None,
    ) -> IntegrationReport:
        """Make at most so many steps, of which parts of a fixed one count, in place.

        Parameters
        ----------
        state : State
        most : int
        until : float
            Where the last adaptive step ends [s]; a fixed one ends within half a step of it.
        due : float
            The last step is the first that ends there or later, or one after which the next might (`reach`) [s].
        interrupted : callable, optional
            Asked now and then, within long steps too; if true, steps end as `PAUSED`.

        Raises
        ------
        InputError
            If `until` is not later than now.
        SimulationError
            If none can be made; nothing is changed then.
        """
        begin = float(state.time[0])
        if until <= begin + self.same_time:
            raise InputError(f"until: {until} is not allowed; it must be later than the present time, {begin} s")
        if self.ledger is not None:
            self.ledger.begin_step(state, self.surroundings.load_factor(state))
        found: IntegrationReport | None = None
        gap = math.inf
        try:
            found = self._integrate(state, until, due, 1 if self.ledger is not None else most, interrupted)
        finally:
            if found is None or found.failed or found.status == PAUSED:
                gap = self.engine.gap
                self.evaluate(state)  # what the last attempt left is not what the state is
        if found.failed and not found.done:
            raise self._failure(found, begin, state, gap)
        if self.ledger is not None and found.done:
            self.ledger.record(state, self.surroundings.load_factor(state, found.length), found.length)
        return found

    def make_again(self, state: State, end: float, stood_in: bool) -> None:
        """Make a step to an end [s] by the method, or by what stands in for it, as it was made or would have been.

        Raises SimulationError if it cannot be made.
        """
        begin = float(state.time[0])
        self.surroundings.cover(begin, state.override, state.pose_goal)
        self.engine.actuation = self.surroundings.actuation
        if self.engine.make_again(state, stood_in, end - begin, self.same_time) != CONVERGED:
            raise SimulationError("a step cannot be made again", begin)
        state.time[0] = end

    def _integrate(
        self, state: State, until: float, due: float, most: int, interrupted: Callable[[], bool] | None
    ) -> IntegrationReport:
        """Make as many steps as succeed, with the capacity and the inputs that they need, and return their report."""
        found: IntegrationReport | None = None
        passes = self._passes
        patience = PATIENCE * passes
        while True:
            self.surroundings.cover(float(state.time[0]), state.override, state.pose_goal)
            self.engine.actuation = self.surroundings.actuation
            begin = clock.perf_counter()
            left = most - (found.done if found else 0)
            more = self.engine.integrate(state, until, due, left, passes, patience, found is not None)
            found = more if found is None else found.followed_by(more)
            if found.status == PAUSED:
                took = clock.perf_counter() - begin
                self._passes = passes = max(round(self.engine.passes * PERIOD / took), 1)
                patience = max(PATIENCE * passes, 0 if more.done or more.rejected else 2 * patience)
                if interrupted is not None and interrupted():
                    return found
                continue
            try:
                if found.status != INPUTS_END and not self.engine.reserve(found.status, state):
                    return found
            except SimulationError:
                if not found.done:
                    raise
                self.evaluate(state)  # as the next attempt finds the same, steps made before it count
                return found

    def _why(self, found: IntegrationReport, begin: float) -> str:
        """Return why a step from a time [s] on could not be made, and how close it came."""
        end = f"the step to t = {begin + found.length:.6g} s, tried down to {found.length:.3g} s"
        if found.status == TOO_INACCURATE:
            tolerance = self.steps.tolerance
            text = f"the error of {end}, stays above the tolerance "
            return text + f"({found.error * tolerance:.3g} of the longest rod, allowed {tolerance:.3g})"
        if found.status == COLLAPSED:
            edge = f"edge {edge_of_strand(self.model, found.pair)}"
            return f"{edge} has less than {100 * LEAST_LENGTH:g} % of its length left in {end}"
        if found.status == CROSSED:
            return f"{crossing(self.model, found.pair)} in {end}"
        text = f"{FAILURES[found.status]} in {end}"
        if found.status == GAINS_ENERGY:
            return f"{text} ({found.error:.3g} times what the account of energy allows)"
        if math.isfinite(found.residual):
            text += f" (correction left {found.residual:.3g} m/s, allowed {self.steps.newton_tolerance:.3g} m/s, "
            text += f"{found.iterations} iterations)"
        return f"{text}: {self.engine.who_blocks(found.pair)}" if found.pair >= 0 else text

    def _failure(self, found: IntegrationReport, begin: float, state: State, gap: float) -> SimulationError:
        """Return the error for steps that cannot go on from a state: the reason, the time and a remedy."""
        why, part = self._why(found, begin), collapsed(self.model, state.position)
        folded = found.status == COLLAPSED or bool(part)
        if found.status != COLLAPSED and part:
            why = f"{why}: {part}"
        why = f"{why}, which a linear material cannot hold" if folded else why
        moving = np.concatenate([state.velocity, state.body_velocity])
        mass = self.model.rods.node_mass.sum() + self.model.free_bodies.mass.sum()
        of_energy = math.sqrt(2.0 * state.account[LARGEST] / mass)
        speed = max(float(np.linalg.norm(moving, axis=1).max()), of_energy)
        change = remedy(found, self.steps, self._method, self.model, gap, speed, folded)
        return SimulationError(why, begin, change)
