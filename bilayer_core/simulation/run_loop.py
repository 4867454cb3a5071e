"""The loop of a run: steps to its end, with those who look, ask and act in between."""

from __future__ import annotations

import math
import time as clock
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from bilayer_core.engine.needed_pieces import needed_pieces
from bilayer_core.engine.step_outcome import IntegrationReport
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.jit.compile_all import ensure_compiled
from bilayer_core.jit.piece import loading
from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.observed.inputs import Input
from bilayer_core.observed.observer import Observed, Observer
from bilayer_core.simulation.capture import Capture, make_frame
from bilayer_core.simulation.controls import Controls
from bilayer_core.simulation.observers import Schedule, first_failure
from bilayer_core.simulation.plane_watch import PlaneWatch
from bilayer_core.simulation.run_result import RunResult, Termination
from bilayer_core.simulation.statistics import RunStatistics, center_of_mass
from bilayer_core.simulation.step_choice import Steps
from bilayer_core.simulation.step_span import StepSpan
from bilayer_core.simulation.stepper import Stepper, StepReport
from bilayer_core.simulation.strip_sections import FOLDS, folds

STEPS_AT_ONCE = 64
"""That the engine makes before anyone is asked whether to go on."""
STEPS_TO_LOOK, PART_TO_LOOK = 128, 1.0 / 8.0
"""Between two looks at strips, each of which costs 1 ms, as much as ten steps: so many steps at most, and so much of
the duration of the scene, as steps in which a strip jumps from a long rest are few."""
NO_FOLD = "a slower stimulus, less of it, or a strip that is less wide does not fold; `section: beam` never does"


@dataclass(frozen=True)
class Callbacks:
    """Functions that are called during a run; see `Simulator.run`."""

    stop: Callable[[], bool] | None = None
    interrupted: Callable[[], bool] | None = None
    progress: Callable[[float], None] | None = None
    each_step: Callable[[float], None] | None = None

    @property
    def steps_at_once(self) -> int:
        """Steps after which somebody is to be called."""
        return STEPS_AT_ONCE if self.stop is None and self.each_step is None else 1


def time_left(now: float, end_of_scene: float, duration: float | None, until: float | None) -> float:
    """Return the simulated time of a run with the arguments of `Simulator.run` [s].

    Raises InputError if both are given, or there is no such time.
    """
    if duration is not None and until is not None:
        raise InputError("run: give a duration or a time `until`, not both")
    if until is not None:
        if not (math.isfinite(until) and until >= now):
            allowed = f"it must be a number of seconds from the present time, {now:g}, up"
            raise InputError(f"until: {until} is not allowed; {allowed}")
        return until - now
    left = end_of_scene - now if duration is None else duration
    if duration is None and left < 0.0:
        at = f"the scene ends at {end_of_scene:g} s, the present time is {now:g} s"
        raise InputError(f"duration: is missing; {at}; say how long to go on")
    if not (math.isfinite(left) and left >= 0.0):
        raise InputError(f"duration: {left} is not allowed; it must be a number of seconds from 0 up")
    return left


def wall_time() -> float:
    """Return elapsed seconds without those for the loading of kernels; differences count."""
    return clock.perf_counter() - loading.wall


class Timed:
    """Context that a run loop takes the time of; made for each few steps, so it is no generator, which takes longer."""

    __slots__ = ("_cpu", "_loaded", "_loop", "_wall")

    def __init__(self, loop: RunLoop) -> None:
        self._loop = loop

    def __enter__(self) -> None:
        self._cpu, self._wall, self._loaded = clock.thread_time(), wall_time(), loading.cpu

    def __exit__(self, *failure: object) -> None:
        cpu, wall = clock.thread_time() - self._cpu, wall_time() - self._wall
        self._loop.take_times(cpu, wall, loading.cpu - self._loaded)


class RunLoop:
    """Makes the steps of a run, counts them, and shows them to those who look.

    Parameters
    ----------
    stepper : Stepper
    state : State
        Advanced in place.
    controls : Controls
        Inputs that act during a run, and who is told of them.
    plane_watch : PlaneWatch, optional
        Looks out of the plane of a model of dimension 2 now and then.
    prepare : callable
        Makes the state what the scene starts with, once there are kernels.

    Attributes
    ----------
    termination : str
        How the last run ended (`Termination`).
    cpu_time, wall_time : float
        Of the steps [s].
    attached : list of Schedule
        Of observers that look whoever makes steps, and of those of a run while it lasts.
    """

    def __init__(
        self,
        stepper: Stepper,
        state: State,
        controls: Controls,
        plane_watch: PlaneWatch | None,
        prepare: Callable[[], None],
    ) -> None:
        self._stepper, self._state, self._controls, self._plane_watch = stepper, state, controls, plane_watch
        self._prepare = prepare
        self._compile_time: float | None = None
        self.attached: list[Schedule] = []
        self.start_over()

    @property
    def statistics(self) -> RunStatistics:
        """Figures of the run up to now."""
        self._statistics.take_extrema(self._stepper)
        return self._statistics

    @property
    def _time(self) -> float:
        return float(self._state.time[0])

    def start_over(self) -> None:
        """Count from the present state on."""
        height = float(center_of_mass(self._stepper.model, self._state)[2])
        self._statistics = RunStatistics()
        self._stepper.engine.start_over(height)
        self.termination = Termination.COMPLETED.value
        self.cpu_time = self.wall_time = 0.0
        self._since_look, self._looked = 0, self._time
        if self._plane_watch is not None:
            self._plane_watch.restart(self._time)

    def take_state(self) -> None:
        """Evaluate a state to which no step has led, and begin extrema and budget with it."""
        self._stepper.evaluate(self._state)
        self._statistics.take_shape(self._stepper, self._state)
        self._stepper.begin_budget(self._state)

    def go_on(self, model: Model, steps: Steps, begin: State) -> None:
        """Go on with another model from a state that is the present one there.

        Raises
        ------
        InputError
            If something reaches into another then; nothing is changed.
        """
        stepper, state, before = self._stepper, self._state, self._state.copy()
        old = stepper.model, stepper.steps
        stepper.take_model(model, steps)
        stepper.evaluate(begin)
        if not stepper.engine.gap > 0.0:
            why = stepper.engine.who_blocks(stepper.engine.deepest_pair)
            stepper.take_model(*old)
            stepper.evaluate(state)
            raise InputError(f"set_values: {why} with these values; all gaps must be positive; nothing is changed")
        state.become(begin)
        stepper.restart(state)
        self._statistics.go_on(stepper, state)
        if stepper.ledger is not None:
            stepper.ledger.take_model(model, before, state, stepper.surroundings.load_factor(state))
        if self._plane_watch is not None:
            self._plane_watch.take_model(model.scene.duration)

    def compile(self) -> float:
        """Prepare kernels and the forces of the first state; see `Simulator.compile`."""
        if self._compile_time is None:
            ensure_compiled(needed=partial(needed_pieces, self._stepper.model))
            begin = clock.thread_time()
            self._prepare()
            self._compile_time = 0.0
            self.take_state()
            self._compile_time = clock.thread_time() - begin
        return self._compile_time

    def timed(self) -> Timed:
        """Count what is done while this lasts as time of the simulation, and the loading of kernels as that of
        compilation.
        """
        return Timed(self)

    def take_times(self, cpu: float, wall: float, loaded: float) -> None:
        """Add CPU and elapsed seconds of the simulation, and CPU seconds for the loading of kernels among them."""
        self._compile_time = (self._compile_time or 0.0) + loaded
        self.cpu_time += cpu - loaded
        self.wall_time += wall

    def step(self, until: float, whole: bool) -> StepReport:
        """Advance by one step, or by one part of it unless it is to be a `whole` one; see `Simulator.step`."""
        self.compile()
        begin, before = self._time, self._state.step[0]
        until = until if self._stepper.steps.adaptive else math.inf
        found = self.integrate(1, until)
        while whole and self._state.step[0] == before:
            found = found.followed_by(self.integrate(1, until))
        counts = found.done, found.rejected, found.iterations, found.factorisations
        return StepReport(self._time, self._time - begin, *counts, found.largest_residual, found.inaccurate)

    def integrate(self, most: int, until: float, interrupted: Callable[[], bool] | None = None) -> IntegrationReport:
        """Advance by at most so many steps or parts of them, to `until` [s] at the latest, as long as nobody has
        `interrupted` them, and show observers what they are due to see.
        """
        state, before, stepper = self._state, float(self._state.step[0]), self._stepper
        if self._stepper.steps.adaptive:
            self._controls.note_end(until)
        if self._plane_watch is not None:
            most = min(most, self._plane_watch.steps_left)
        due = min([attached.next_due() for attached in self.attached], default=math.inf)
        look = min(self._strips_due, self._plane_watch.due if self._plane_watch is not None else math.inf)
        with self.timed():
            begin = Capture(stepper, state) if due < math.inf and stepper.reach(state) >= due else None
            try:
                found = stepper.integrate(state, most, until, min(due, look), interrupted)
            except SimulationError:
                self.termination = Termination.FAILED.value
                raise
            self._statistics.update(found, int(state.step[0] - before))
        self._show_due(begin)
        self._look_out(found.done)
        self._look_at_strips(found.done)
        return found

    def _show_due(self, begin: Capture | None) -> None:
        """Show what is due up to now, after a step that has one due in it and the start of which was captured."""
        due = [attached for attached in self.attached if attached.is_due()]
        if not due:
            return
        end = Capture(self._stepper, self._state)
        span = StepSpan(begin or end, end, self._stepper.surroundings)
        for attached in due:
            attached.observe_due(lambda time: make_frame(span.at(time), self.statistics, self.cpu_time))

    def _look_out(self, steps: int, last: bool = False) -> None:
        """Look out of the plane now and then, after so many more steps; the first look needs more of the program."""
        if self._plane_watch is None or not self._plane_watch.is_due(steps, self._time, last):
            return
        with self.timed():
            self._plane_watch.look(self._state, self._stepper.surroundings.load_factor(self._state))

    @property
    def _strips_due(self) -> float:
        """Time of the next look at strips, unless so many steps come before [s]."""
        model = self._stepper.model
        return self._looked + PART_TO_LOOK * model.scene.duration if len(model.flattening.joint) else math.inf

    def _look_at_strips(self, steps: int, last: bool = False) -> None:
        """Look for strips that have folded, after so many more steps."""
        self._since_look += steps
        if not len(self._stepper.model.flattening.joint):
            return
        many = self._since_look >= STEPS_TO_LOOK or self._stepper.reach(self._state) >= self._strips_due
        if not (self._since_look if last else many):
            return
        self._since_look, self._looked = 0, self._time
        with self.timed():
            found = folds(self._stepper.model, self._state)
        for name, shape in found.items():
            if shape == "creased":
                self._statistics.creased.setdefault(name, self._time)
            if shape == "folded":
                self.termination = Termination.FAILED.value
                raise SimulationError(f"rods.{name} {FOLDS}; {NO_FOLD}", self._time)

    def run(
        self,
        observed: Observed,
        duration: float | None,
        until: float | None,
        observers: Sequence[Observer],
        inputs: Sequence[Input],
        callbacks: Callbacks,
    ) -> RunResult:
        """Advance by a duration or to a time, and show what is `observed` to observers; see `Simulator.run`."""
        steps = self._stepper.steps
        left = time_left(self._time, self._stepper.model.scene.duration, duration, until)
        count, fixed = int(round(left / steps.dt)), not steps.adaptive
        if fixed and left > 0.0 and count == 0:
            raise InputError(f"duration: {left:g} s is less than half a step of {steps.dt:g} s; nothing would happen")
        self.compile()
        begin, cpu, wall, before = self._time, self.cpu_time, wall_time(), self._state.step[0]
        end = begin + count * steps.dt if fixed else begin + left if until is None else until
        last = end - 0.5 * steps.dt if fixed else end
        schedule = Schedule(observers, observed)
        ends_of_listening = [self._controls.listen(of.note) for of in observers if hasattr(of, "note")]
        try:
            schedule.start()
            self.attached.append(schedule)
            try:
                termination = self._advance(end, last, inputs, callbacks)
            finally:
                self.attached.remove(schedule)
            if termination is Termination.COMPLETED:
                self._look_out(0, last=True)
                self._look_at_strips(0, last=True)
            for attached in self.attached:
                attached.observe_last()
        except BaseException as failure:
            of_program = isinstance(failure, Exception)
            self.termination = (Termination.FAILED if of_program else Termination.INTERRUPTED).value
            first_failure([attached.observe_last for attached in self.attached], failure)
            schedule.finish(False, self.termination, failure)
            raise
        finally:
            for stop_listening in ends_of_listening:
                stop_listening()
        self.termination = termination.value
        schedule.finish(termination is not Termination.INTERRUPTED, termination.value)
        done = int(self._state.step[0] - before)
        return RunResult(termination, self._time, self._time - begin, done, self.cpu_time - cpu, wall_time() - wall)

    def _advance(self, end: float, last: float, inputs: Sequence[Input], callbacks: Callbacks) -> Termination:
        """Make steps until the end of a run, or until someone ends it.

        `end`: where the last adaptive step ends [s]. `last`: a step that ends here or later is the last [s].
        """
        waiting = deque(sorted(inputs, key=lambda of: of.time))
        while self._time < last:
            while waiting and waiting[0].time <= self._time:
                waiting.popleft().apply(self._controls)
            until = min(end, waiting[0].time) if waiting else end
            found = self.integrate(callbacks.steps_at_once, until, callbacks.interrupted)
            if not found.done:
                return Termination.INTERRUPTED
            if callbacks.each_step is not None:
                callbacks.each_step(self._time)
            if callbacks.progress is not None:
                callbacks.progress(self._time)
            if callbacks.stop is not None and callbacks.stop():
                return Termination.STOPPED
            if callbacks.interrupted is not None and self._time < last and callbacks.interrupted():
                return Termination.INTERRUPTED
        return Termination.COMPLETED

    def attach(self, observer: Observer, observed: Observed) -> Callable[[], None]:
        """Show what is `observed` to an observer from now on; see `Simulator.attach`."""
        schedule = Schedule([observer], observed)
        schedule.start()
        self.attached.append(schedule)
        stop_listening = self._controls.listen(observer.note) if hasattr(observer, "note") else None

        def detach() -> None:
            if schedule in self.attached:
                self.attached.remove(schedule)
                if stop_listening is not None:
                    stop_listening()
                schedule.finish(True, self.termination)

        return detach
