"""The simulator: a scene, its state, and the loop that advances it."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.engine.energy_account import OPEN, QUESTIONED
from bilayer_core.engine.step_outcome import IntegrationReport
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.forces.force_register import memory_size
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_core.jit.piece import loading
from bilayer_core.model.build_model import build_model
from bilayer_core.model.fingerprint import conditions_of, fingerprint_of
from bilayer_core.model.model import Model
from bilayer_core.model.plan import make_plan
from bilayer_core.model.state import State, initial_state, refuse_out_of_plane
from bilayer_core.observed.inputs import RESET, UNTIL, Input
from bilayer_core.observed.observer import Observer
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.controls import Controls
from bilayer_core.simulation.energy_budget import EnergyLedger
from bilayer_core.simulation.equilibrium import StaticReport, solve_static
from bilayer_core.simulation.observers import Schedule, first_failure
from bilayer_core.simulation.plane_watch import PlaneWatch
from bilayer_core.simulation.run_loop import Callbacks, advance_to, time_left
from bilayer_core.simulation.run_result import RunResult, Termination
from bilayer_core.simulation.same_model import differing
from bilayer_core.simulation.statistics import RunStatistics
from bilayer_core.simulation.step_choice import choose_steps
from bilayer_core.simulation.stepper import Stepper, StepReport
from bilayer_core.simulation.summary import summarise

Array = np.ndarray


def wall_time() -> float:
    """Return elapsed seconds without those for the loading of kernels; differences count."""
    return clock.perf_counter() - loading.wall


class Simulator(Controls):
    """A scene in motion.

    Parameters
    ----------
    scene : SceneConfig, str, Path or mapping
        From `bilayer_core.load_scene`, or what that takes: a file, the name of a bundled scene, or content.
    model, dimension, integrator : str or int
        Override the scene's; ``"auto"`` keeps them.
    dt : float, optional
        Alone: fixed steps of this length [s], whatever the scene says; with `tolerance` the first adaptive one.
    tolerance : float, optional
        Overrides the scene's: the largest error per step, relative to the longest rod. With one, steps are adaptive.
        It is no bound on the error of a whole run, which is larger; `bilayer_core.estimate_error` tells that.
    budget : bool
        Keep the energy budget of the run (`budget`), in two to three times the time.

    Raises
    ------
    SceneError
        If the scene cannot be simulated as asked.
    PenetrationError
        If it starts with surfaces inside each other.
    """

    def __init__(
        self,
        scene: SceneConfig | str | Path | Mapping[str, Any],
        *,
        model: str = "auto",
        dimension: str | int = "auto",
        integrator: str = "auto",
        dt: float | None = None,
        tolerance: float | None = None,
        budget: bool = False,
    ) -> None:
        scene = scene if isinstance(scene, SceneConfig) else load_scene(scene)
        self.plan = make_plan(scene, model=model, dimension=dimension, integrator=integrator)
        method = INTEGRATORS[self.plan.integrator]
        self._asked_steps = dt, tolerance
        self.steps = choose_steps(scene, method, *self._asked_steps)
        self.dt, self.tolerance = self.steps.dt, self.steps.tolerance
        self.scene = scene
        self.model = build_model(scene, self.plan.model, self.plan.dimension)
        self._keeps_history = method.history is not None
        self._fingerprint = fingerprint_of(scene, self.plan.model, self.plan.integrator if self._keeps_history else "")
        self._conditions = float(conditions_of(scene))
        self._method = method
        self._stepper = self._stepper_of(self.model)
        self.keeps_budget = budget
        self._ledger = EnergyLedger(self.model) if budget else None
        self._listeners: list[Callable[[Input], None]] = []
        self._attached: list[Schedule] = []
        self._until = math.nan
        self._state = self._initial_state()
        self._compile_time: float | None = None
        self.plane_watch = PlaneWatch(self._in_dimension, scene.duration) if self.plan.dimension == 2 else None
        self._start_over()

    def __repr__(self) -> str:
        dof = self.model.node_count
        return (
            f"Simulator({self.scene.name} at t = {self.time:g} s: {self.plan.model} in {self.plan.dimension}-D, "
            f"{self.plan.integrator}, {len(self.model.strands)} strands, {dof} nodes, {len(self.bodies)} bodies)"
        )

    def _stepper_of(self, model: Model) -> Stepper:
        return Stepper(model, self._method, self.steps, self.scene.solver.max_newton_iterations)

    def _in_dimension(self, dimension: int) -> Stepper:
        """Return a stepper of the same scene in a dimension."""
        same = dimension == self.plan.dimension
        return self._stepper_of(self.model if same else build_model(self.scene, self.plan.model, dimension))

    def _initial_state(self) -> State:
        marks = self._fingerprint, memory_size(self.model), self._conditions
        return initial_state(self.model, self._keeps_history, *marks)

    def _start_over(self) -> None:
        self.statistics = RunStatistics(com_max_height=float(self.com[2]))
        self._stepper.engine.start_over(self.statistics.com_max_height)
        self.start_time, self.start_com, self.start_bodies = self.time, self.com, self._state.body_position.copy()
        self.termination = Termination.COMPLETED.value
        self.cpu_time = self.wall_time = 0.0
        if self.plane_watch is not None:
            self.plane_watch.restart(self.time)

    def _begin_budget(self) -> None:
        if self._ledger is not None:
            surroundings = self._stepper.surroundings
            rest = surroundings.rest_strains_of(self._state.transduction)
            self._ledger.begin(self._state, rest, surroundings.load_factor(self._state))
            self._stepper.ledger = self._ledger

    def compile(self) -> float:
        """Compile all kernels that are not in the cache, and prepare the start.

        Others are read from the cache when the simulation first needs them, and their time is counted here as well, not
        in `cpu_time`. Whatever needs kernels calls it.

        Returns
        -------
        float
            CPU time of this for the scene [s].
        """
        if self._compile_time is None:
            ensure_compiled()
            begin = clock.thread_time()
            self._compile_time = 0.0
            self._stepper.evaluate(self._state)
            self.statistics.take_shape(self._stepper, self._state)
            self._begin_budget()
            self._compile_time = clock.thread_time() - begin
        return self._compile_time

    def step(self, until: float = math.inf) -> StepReport:
        """Advance by one step.

        Parameters
        ----------
        until : float
            Simulated time [s] at which an adaptive step ends at the latest, if the scene's next output time is not
            earlier; a fixed one is as long as ever.

        Returns
        -------
        StepReport

        Raises
        ------
        SimulationError
            If it cannot be made; the state is that of the last step, or of the last part of it.
        """
        self.compile()
        begin, before = self.time, self._state.step[0]
        found = self._integrate_once(until)
        while self._state.step[0] == before:
            found = found.followed_by(self._integrate_once(until))
        return StepReport.of(found, self.time, self.time - begin)

    def advance(self, until: float = math.inf) -> StepReport:
        """Advance by one step, or by one part of a fixed one; otherwise like `step`.

        Parameters
        ----------
        until : float
            As in `step` [s].

        Returns
        -------
        StepReport
        """
        self.compile()
        begin = self.time
        return StepReport.of(self._integrate_once(until), self.time, self.time - begin)

    def _integrate_once(self, until: float) -> IntegrationReport:
        return self._integrate(1, until if self.steps.adaptive else math.inf, math.inf)

    def _integrate(self, most: int, until: float, due: float) -> IntegrationReport:
        """Advance by at most so many steps or parts of them, to `until` [s] at the latest, and by none after one that
        has reached `due` [s].
        """
        state, before = self._state, float(self._state.step[0])
        if self._listeners and self.steps.adaptive and until != self._until:
            self._until = until
            self._note(UNTIL, "", until)
        if self.plane_watch is not None:
            most = min(most, self.plane_watch.steps_left)
        due = min([due, *(attached.next_due() for attached in self._attached)])
        with self._timed():
            try:
                found = self._stepper.integrate(state, most, until, due)
            except SimulationError:
                self.termination = Termination.FAILED.value
                raise
            self.statistics.update(found, int(state.step[0] - before), self._stepper)
        self._look_out(found.done)
        for attached in self._attached:
            attached.observe_due()
        return found

    def _look_out(self, steps: int, last: bool = False) -> None:
        """Look out of the plane now and then, after so many more steps; the first look needs more of the program."""
        if self.plane_watch is None or not self.plane_watch.is_due(steps, last):
            return
        with self._timed():
            surroundings = self._stepper.surroundings
            rest = surroundings.rest_strains_of(self._state.transduction)
            self.plane_watch.look(self._state, rest, surroundings.load_factor(self._state))

    @contextmanager
    def _timed(self) -> Iterator[None]:
        """Count what is done meanwhile as time of the simulation, and the loading of kernels as that of compilation."""
        cpu, wall, loaded = clock.thread_time(), wall_time(), loading.cpu
        try:
            yield
        finally:
            loaded = loading.cpu - loaded
            self._compile_time = (self._compile_time or 0.0) + loaded
            self.cpu_time += clock.thread_time() - cpu - loaded
            self.wall_time += wall_time() - wall

    def run(
        self,
        duration: float | None = None,
        *,
        until: float | None = None,
        stop: Callable[[], bool] | None = None,
        log: str | Path | None = None,
        observers: Sequence[Observer] = (),
        inputs: Sequence[Input] = (),
        progress: Callable[[float], None] | None = None,
        each_step: Callable[[float], None] | None = None,
        interrupted: Callable[[], bool] | None = None,
    ) -> RunResult:
        """Advance by a duration or to a time (default: to the end of the scene), showing frames to observers.

        Fixed steps end within half a step of it. Adaptive ones end exactly there, or at the output time that differs
        from it by rounding alone, and at all of the scene's output times (`output.rate`, counted from time 0), whether
        or not anybody observes: the run is the same bit for bit whatever watches it. So is a run in parts that meet at
        output times; at another time the end of a part is one more end of a step.

        Parameters
        ----------
        duration : float, optional
            Simulated time to advance by [s].
        until : float, optional
            Simulated time to advance to [s], instead.
        stop : callable, optional
            Asked after each step; true ends the run, as ``stopped``. Steps are then made one by one, which takes a
            little longer and changes none.
        log : str or Path, optional
            MCAP file to write, at the rates of the scene's `output`; for others, or to replace a file, put a
            `bilayer_core.log.file.mcap_log.McapRecorder` among the observers.
        observers : sequence of Observer
            Each sees the first frame, the last, and at its rate between that of the first step which ends at or after
            each due time; all are closed whatever happens. For those that look at more than one run see `attach`.
        inputs : sequence of Input
            What acts from outside (`observed.inputs`), each from its time on: adaptive steps end there, of fixed ones
            it acts from the first that begins then or later.
        progress : callable, optional
            Called every few steps with the simulated time [s].
        each_step : callable, optional
            Called with the simulated time [s] after each step, made one by one.
        interrupted : callable, optional
            Asked every few steps; true ends the run, as ``interrupted``.

        Returns
        -------
        RunResult

        Raises
        ------
        InputError
            If the duration or the time is none to which the run can advance, or the log cannot be begun: nothing is
            changed then.
        SimulationError
            If a step cannot be made.
        OutputError
            If a log cannot be written. Observers have then seen the last accepted frame and are closed; what goes wrong
            with that is a note to the error.
        """
        left = time_left(self.time, self.scene.duration, duration, until)
        steps, fixed = int(round(left / self.dt)), not self.steps.adaptive
        if fixed and left > 0.0 and steps == 0:
            raise InputError(f"duration: {left:g} s is less than half a step of {self.dt:g} s; nothing would happen")
        if log is not None:
            from bilayer_core.log.file.mcap_log import McapRecorder

            output = self.scene.output
            observers = [McapRecorder(log, output.rate, output.marker_rate), *observers]
        self.compile()
        begin, cpu, wall, before = self.time, self.cpu_time, wall_time(), self._state.step[0]
        end = begin + steps * self.dt if fixed else self._stepper.end_near(begin + left if until is None else until)
        last = end - 0.5 * self.dt if fixed else end
        callbacks = Callbacks(stop, interrupted, progress, each_step)
        schedule = Schedule(observers, self)
        ends_of_listening = [self.listen(of.note) for of in observers if hasattr(of, "note")]
        try:
            schedule.start()
            termination = advance_to(self, end, last, self._integrate, schedule, inputs, callbacks)
            if termination is Termination.COMPLETED:
                self._look_out(0, last=True)
            for attached in self._attached:
                attached.observe_last()
        except BaseException as failure:
            of_program = isinstance(failure, Exception)
            self.termination = (Termination.FAILED if of_program else Termination.INTERRUPTED).value
            first_failure([attached.observe_last for attached in self._attached], failure)
            schedule.finish(False, self.termination, failure)
            raise
        finally:
            for stop_listening in ends_of_listening:
                stop_listening()
        self.termination = termination.value
        schedule.finish(termination is not Termination.INTERRUPTED, termination.value)
        done = int(self._state.step[0] - before)
        return RunResult(termination, self.time, self.time - begin, done, self.cpu_time - cpu, wall_time() - wall)

    def attach(self, observer: Observer) -> Callable[[], None]:
        """Show frames to an observer from now on, at its rate, whoever makes steps.

        It also sees the last frame of each `run`, and the first after `load_state` and `reset`. It is closed when it is
        detached.

        Parameters
        ----------
        observer : Observer

        Returns
        -------
        callable
            Detaches the observer.
        """
        schedule = Schedule([observer], self)
        schedule.start()
        self._attached.append(schedule)
        stop_listening = self.listen(observer.note) if hasattr(observer, "note") else None

        def detach() -> None:
            if schedule in self._attached:
                self._attached.remove(schedule)
                if stop_listening is not None:
                    stop_listening()
                schedule.finish(True, self.termination)

        return detach

    def solve_static(self, tolerance: float | None = None) -> StaticReport:
        """Go to an equilibrium under the present stimuli and loads, not in time; see `simulation.equilibrium`.

        Parameters
        ----------
        tolerance : float, optional
            Displacement that counts as rest [m]; default: 1e-10 of the longest rod.

        Returns
        -------
        StaticReport
            How it went, and whether the equilibrium is stable, in all of space whatever the dimension.

        Raises
        ------
        SimulationError
            If none is found; nothing is changed then.
        """
        self.compile()
        with self._timed():
            try:
                in_space = (lambda: self._in_dimension(3)) if self.plan.dimension == 2 else None
                return solve_static(self._stepper, self._state, tolerance, in_space)
            finally:
                self._stepper.evaluate(self._state)
                self.statistics.take_shape(self._stepper, self._state)
                self._begin_budget()

    def save_state(self) -> Array:
        """Return a flat copy of the state; `load_state` continues from it bit for bit.

        Its last values are a fingerprint of the scene (`model.fingerprint`), so that no other scene takes it.

        Returns
        -------
        ndarray
            Shape (size,).
        """
        self.compile()
        return self._state.flat()

    def load_state(self, snapshot: Array) -> None:
        """Go to a saved state of the same scene, or of a similar one.

        The scenes may differ in schedules of stimuli, loads, gravity, contact, friction, damping, drag, steps,
        tolerances and output.

        Parameters
        ----------
        snapshot : ndarray
            From `save_state`, shape (size,).

        Raises
        ------
        InputError
            If it is of another scene or model, or does not fit; nothing is changed then.
        """
        loaded = self._initial_state()
        loaded.set_flat(snapshot)
        refuse_out_of_plane(self.model, loaded)
        if not self._state.set_flat(snapshot) and self._state.account[OPEN] == 1.0:
            self._state.account[OPEN] = QUESTIONED
        self.compile()
        self._stepper.evaluate(self._state)
        self._start_over()
        self.statistics.take_shape(self._stepper, self._state)
        self._begin_budget()
        for attached in self._attached:
            attached.start_over()

    def reset(self, scene: SceneConfig | str | Path | Mapping[str, Any] | None = None) -> None:
        """Go back to the start of the scene; what was set from outside is forgotten.

        Parameters
        ----------
        scene : SceneConfig, str, Path or mapping, optional
            Another scene with the same model (`same_model`), which is taken from now on: the run is that of a new
            simulator, bit for bit, without the time to build one. What the simulator was made with (`dt`, `tolerance`,
            `budget`) stays.

        Raises
        ------
        InputError
            If its model is another, or somebody observes the run: a log is of one scene. Nothing is changed then.
        """
        if scene is not None:
            self._take_scene(scene if isinstance(scene, SceneConfig) else load_scene(scene))
        self._note(RESET, "")
        self.load_state(self._initial_state().flat())

    def same_model(self, scene: SceneConfig) -> bool:
        """Return whether `reset` takes a scene.

        Such a scene differs at most in texts, duration, output, schedules of stimuli and loads, steps and tolerances,
        and coefficients of friction that are and stay above 0.

        Parameters
        ----------
        scene : SceneConfig

        Returns
        -------
        bool
        """
        return not differing(self.scene, scene)

    def _take_scene(self, scene: SceneConfig) -> None:
        if others := differing(self.scene, scene):
            told = ", ".join(sorted(others))
            raise InputError(
                f"reset: the scene {scene.name!r} has another model than {self.scene.name!r}, by its {told}; allowed "
                "to differ are texts, duration, output, schedules of stimuli and loads, steps and tolerances, and "
                "coefficients of friction above 0; make a new Simulator"
            )
        if self._listeners or self._attached:
            raise InputError("reset: takes no other scene while a log or an observer is attached; detach it first")
        steps, iterations = choose_steps(scene, self._method, *self._asked_steps), scene.solver.max_newton_iterations
        self._stepper.take_scene(scene, steps, iterations)
        self.scene, self.model, self.steps = scene, self._stepper.model, steps
        self.dt, self.tolerance = steps.dt, steps.tolerance
        self._conditions = float(conditions_of(scene))
        self._ledger = EnergyLedger(self.model) if self.keeps_budget else None
        self._state = self._initial_state()
        if self.plane_watch is not None:
            self.plane_watch.take_scene(scene.duration, lambda stepper: stepper.take_scene(scene, steps, iterations))

    def summary(self) -> dict[str, Any]:
        """Return figures of the run since the start, the last `reset` or `load_state`.

        Returns
        -------
        dict
            Keys as documented for ``--summary``.
        """
        return summarise(self)
