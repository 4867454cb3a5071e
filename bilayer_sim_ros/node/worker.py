"""The thread that steps the simulation, beside the executor that serves topics and services."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, Protocol

from bilayer_core.errors import InputError, OutputError
from bilayer_core.log.messages.events import Event, changed_setting, ended_run
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.simulation.observers import STAMP_DIGITS, TIME_ROUNDING
from bilayer_core.simulation.run_result import Termination
from bilayer_core.simulation.simulator import Simulator
from bilayer_sim_ros.control.control_ticks import Control
from bilayer_sim_ros.control.pacing import CONTROLLERS, LOG, OTHERS, PHYSICS, SUBSCRIBERS, Pacer
from bilayer_sim_ros.control.periods import Periods
from bilayer_sim_ros.node.run_status import Status, StatusReporter
from bilayer_sim_ros.publishing.output_rates import refuse_marker_rate, refuse_rate
from bilayer_sim_ros.publishing.run_files import LogStatus, Recording
from bilayer_sim_ros.services.requests import Requests

# Shorter waits cost more than they are worth: the simulation may be this far ahead of the clock [s].
SHORTEST_WAIT = 0.01
# Real time between two showings of what stands still [s].
SHOWING_PERIOD = 1.0


class Publisher(Protocol):
    """Where frames go beside files."""

    @property
    def wanted(self) -> bool:
        """True if anybody listens."""

    def publish(self, frame: Frame, everything: bool = False) -> None:
        """Send what somebody listens to: what is due, or everything."""

    def set_rates(self, rate: float, marker_rate: float) -> None:
        """Go on with other rates of frames, and of topics made to be looked at [Hz]."""

    def tell(self, event: Event) -> None:
        """Send an event that frames do not show."""


class FramesOfSteps:
    """Observer that keeps the frames that are due within a step, for the worker to hand out.

    Parameters
    ----------
    periods : Periods
        Of frames.

    Attributes
    ----------
    due : float
        Time of the next one, to the nanosecond of its messages [s].
    """

    rate = math.inf

    def __init__(self, periods: Periods):
        self._periods = periods
        self._frames: list[Frame] = []
        self.restart(0.0)

    def restart(self, time: float) -> None:
        """Begin to count at a time [s]."""
        self._count = self._periods.complete(time)
        self._next()

    def _next(self) -> None:
        self._count += 1
        self.due = round(self._periods.end(self._count), STAMP_DIGITS)

    def start(self, description: Description) -> None:
        """Do nothing: the worker hands out the first frame."""

    def observe(self, frame: Frame) -> None:
        """Keep a frame if it is due."""
        if round(frame.time, STAMP_DIGITS) >= self.due:
            self._frames.append(frame)
            self._next()

    def close(self, complete: bool, termination: str = "") -> None:
        """Do nothing."""

    def take(self) -> list[Frame]:
        """Return the frames of the last step."""
        frames, self._frames = self._frames, []
        return frames


class SimulationWorker:
    """Steps a simulator in a thread of its own, paced on a steady clock, and hands out frames.

    Parameters
    ----------
    simulator : Simulator
        Compiled, at its start.
    control : Control
        What acts from outside; asked before each step.
    publisher : Publisher
    recording : Recording
        Files of the first run.
    rate, marker_rate : float
        Frames per simulated second, and those of them that carry topics made to be looked at [Hz].
    pacer : Pacer
    duration : float
        Simulated time at which the worker ends [s]; infinity means not by itself.
    paused : bool
        Whether to wait for `resume` at the start.
    report : callable
        Called with a `Status` about once a second, in the worker's thread.
    finished : callable
        Called at the very end, in the worker's thread.

    Attributes
    ----------
    error : Exception or None
        Why the worker ended, unless it was stopped or reached the duration; or what was lost before a reset.
    """

    def __init__(
        self,
        simulator: Simulator,
        *,
        control: Control,
        publisher: Publisher,
        recording: Recording,
        rate: float,
        marker_rate: float = math.inf,
        pacer: Pacer,
        duration: float = math.inf,
        paused: bool = False,
        report: Callable[[Status], None],
        finished: Callable[[], None],
    ):
        self._simulator = simulator
        self._control = control
        self._publisher = publisher
        self._recording = recording
        self._frames = Periods(rate)
        self._due = FramesOfSteps(self._frames)
        simulator.attach(self._due)
        self._marker_rate = marker_rate
        refuse_rate(rate)
        self._pacer = pacer
        self._duration = duration
        self._stop_listening: Callable[[], None] = lambda: None
        self._paused = paused
        self._reporter = StatusReporter(report, pacer)
        self._finished = finished
        self._stopping = threading.Event()
        self._requests = Requests()
        self._frame_is_out = True
        # Single steps asked for while paused that have not ended.
        self._single_steps: deque[Future] = deque()
        self._thread = threading.Thread(target=self._work, name="simulation", daemon=True)
        self._reason = ""
        self.error: Exception | None = None

    @property
    def log_status(self) -> LogStatus:
        """How the log of the present run is doing, or has done."""
        return self._recording.log_status

    @property
    def begun(self) -> bool:
        """True if the thread was started."""
        return self._thread.ident is not None

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, reason: str = "") -> None:
        """End after the present step, finish the files, and return when that is done; also where it never began.

        The first reason that is given is told as an event, and as what ended the run.
        """
        self._reason = self._reason or reason
        self._stopping.set()
        self._requests.wake()
        if self._thread.ident is None:
            self._requests.close()
        else:
            self._thread.join()

    def tell_failure(self, reason: str) -> None:
        """Write files that say why there was no run; the thread is never started."""
        try:
            self._recording.start(self._simulator.description)
            self._recording.close(False, reason)
        except Exception as error:
            self.error = self.error or error

    def wake(self) -> None:
        """Look at once whether what was waited for has come."""
        self._requests.wake()

    def tell(self, event: Event) -> None:
        """Publish and log an event that frames do not show; called in the worker's thread."""
        self._publisher.tell(event)
        self._recording.tell(event)

    def pause(self) -> Future:
        """Ask for a pause. The future's result says what happened; InputError if it could not be done."""
        return self._requests.ask(self._do_pause)

    def resume(self) -> Future:
        """Ask to go on."""
        return self._requests.ask(self._do_resume)

    def step(self) -> Future:
        """Ask for the steps to the next frame while paused; the answer comes when it is out."""
        return self._requests.ask(self._do_step)

    def reset(self) -> Future:
        """Ask to go back to the start of the scene; paused stays paused."""
        return self._requests.ask(self._do_reset)

    def look(self, read: Callable[[Simulator, bool], Any]) -> Future:
        """Ask what `read(simulator, paused)` says between two steps."""
        return self._requests.ask(lambda answer: answer.set_result(read(self._simulator, self._paused)))

    def set_real_time_factor(self, factor: float) -> Future:
        """Ask to go on at another factor; 0 = as fast as possible."""
        return self._requests.ask(partial(self._do_set_factor, factor))

    def set_rate(self, rate: float) -> Future:
        """Ask for frames at another rate [Hz]."""
        return self._requests.ask(lambda answer: self._do_set_rates(rate, self._marker_rate, answer))

    def set_marker_rate(self, rate: float, asked: bool = True) -> Future:
        """Ask for topics made to be looked at, at another rate [Hz]; one that nobody `asked` for may exceed that of
        frames, with which they come then.
        """

        def set_rate(answer: Future) -> None:
            if asked:
                refuse_marker_rate(rate, self._frames.rate)
            self._do_set_rates(self._frames.rate, rate, answer)

        return self._requests.ask(set_rate)

    # The rest runs in the worker's thread.

    def _work(self) -> None:
        complete, termination = False, Termination.INTERRUPTED.value
        try:
            self._begin()
            while not self._stopping.is_set() and not self._is_over():
                self._serve_requests()
                if self._may_advance:
                    self._advance()
                waiting = self._wants_to_advance and self._control.waiting
                self._reporter.report_when_due(self._simulator, self._paused, waiting, self._recording)
                self._show_again_when_due()
            if not self._stopping.is_set():
                complete, termination = True, Termination.COMPLETED.value
            elif self._reason:
                termination = self._reason
                self.tell(ended_run(self._simulator.time, self._reason))
        except Exception as error:
            self.error, termination = error, str(error)
        finally:
            self._end(complete, termination)

    def _end(self, complete: bool, termination: str) -> None:
        try:
            self._finish_recording(complete, termination)
        except Exception as error:
            self.error = self.error or error
        finally:
            self._drop_single_steps(str(self.error or "the simulation has ended"))
            self._requests.close()
            self._finished()

    def _finish_recording(self, complete: bool, termination: str, last: Callable[[], None] = lambda: None) -> None:
        """Close the files with the last accepted step in them, and with what is done `last`."""
        try:
            if not self._frame_is_out:
                self._hand_out()
            last()
        finally:
            self._stop_listening()
            self._recording.close(complete, termination)

    def _begin(self) -> None:
        """Start a run at the simulator's present state, and hand out its first frame."""
        self._frames.start(self._simulator.time)
        self._due.restart(self._simulator.time)
        self._pacer.restart(self._simulator.time)
        self._reporter.start(self._simulator.time)
        self._recording.start(self._simulator.description)
        self._stop_listening = self._simulator.listen(self._recording.note)
        self._hand_out()
        self._control.start(self._simulator.time)

    def _is_over(self) -> bool:
        left = self._duration - self._simulator.time
        return left < (0.5 if self._simulator.tolerance is None else TIME_ROUNDING) * self._simulator.dt

    @property
    def _wants_to_advance(self) -> bool:
        return not self._paused or bool(self._single_steps)

    @property
    def _may_advance(self) -> bool:
        return self._wants_to_advance and not self._control.waiting

    def _serve_requests(self) -> None:
        """Do what is asked until the next step is due, or, where time stands still, the next status."""
        cause = CONTROLLERS if self._wants_to_advance and self._control.waiting else ""
        with self._reporter.spending(cause):
            while not self._stopping.is_set() and self._requests.serve(self._time_to_wait()):
                pass

    def _time_to_wait(self) -> float:
        if not self._may_advance:
            look = min(self._reporter.due_at, self._shown_at + SHOWING_PERIOD, self._control.wait_ends_at)
            return max(look - time.monotonic(), 0.0)
        if self._paused:
            return 0.0
        delay = self._pacer.delay(self._simulator.time)
        return delay if delay >= SHORTEST_WAIT else 0.0

    def _advance(self) -> None:
        """Take one step, and show what is due at its end."""
        cpu, wall = self._simulator.cpu_time, self._simulator.wall_time
        self._control.act(self._simulator)
        self._reporter.add(self._simulator.step(until=self._next_stop()))
        cpu, wall = self._simulator.cpu_time - cpu, self._simulator.wall_time - wall
        self._reporter.spend(PHYSICS, cpu)
        self._reporter.spend(OTHERS, max(wall - cpu, 0.0))
        self._frame_is_out = False
        now, frames = self._simulator.time, self._due.take()
        for frame in frames:
            self._hand_out(frame)
        if not self._frame_is_out and self._control.opens_tick(now):
            self._publish(self._paused)
        self._control.advance_to(now)
        if self._single_steps and (frames or self._is_over()):
            self._single_steps.popleft().set_result(f"paused at t = {now:.6g} s")

    def _next_stop(self) -> float:
        """Return where adaptive steps end at the latest [s]: when a controller is due, or the run ends.

        In real time, and one by one, they end at frames too, so that what comes from outside acts within a period.
        """
        now = self._simulator.time
        due = self._control.next_stop(now)
        if self._pacer.factor > 0.0 or self._single_steps:
            due = min(due, self._frames.next_end(now))
        return due if due < self._duration - TIME_ROUNDING * self._simulator.dt else self._duration

    def _hand_out(self, frame: Frame | None = None) -> None:
        """Publish and record a frame, by default the present one."""
        self._frame_is_out = frame is None or frame.time == self._simulator.time
        frame = self._publish(self._paused, frame)
        if self._recording.wanted:
            frame = frame or self._simulator.frame()
            with self._reporter.spending(LOG):
                self._recording.observe(frame)

    def _publish(self, everything: bool, frame: Frame | None = None) -> Frame | None:
        """Publish a frame, by default the present one, if anybody subscribes to it; the frame."""
        self._shown_at = time.monotonic()
        if not self._publisher.wanted:
            return frame
        frame = frame or self._simulator.frame()
        with self._reporter.spending(SUBSCRIBERS):
            self._publisher.publish(frame, everything=everything)
        return frame

    def _show_again_when_due(self) -> None:
        """Repeat the frame, and the tick, of a time that stands still, for subscribers that come late."""
        if not self._may_advance and time.monotonic() - self._shown_at >= SHOWING_PERIOD:
            self._publish(everything=True)
            self._control.repeat(self._simulator.time)

    def _do_pause(self, answer: Future) -> None:
        self._drop_single_steps("the simulation was paused before the next frame")
        self._paused = True
        answer.set_result(f"paused at t = {self._simulator.time:.6g} s")

    def _do_resume(self, answer: Future) -> None:
        self._drop_single_steps("the simulation was resumed before the next frame")
        if self._paused:
            self._paused = False
            self._control.wait_anew()
            self._pacer.restart(self._simulator.time)
        answer.set_result(f"running from t = {self._simulator.time:.6g} s")

    def _do_step(self, answer: Future) -> None:
        if not self._paused:
            raise InputError("the simulation is running: call pause first")
        if not self._single_steps:
            self._control.wait_anew()
        self._single_steps.append(answer)

    def _do_set_factor(self, factor: float, answer: Future) -> None:
        self._pacer.factor = factor
        self._pacer.restart(self._simulator.time)
        self.tell(changed_setting(self._simulator.time, f"real_time_factor is {factor:g}"))
        answer.set_result("")

    def _do_set_rates(self, rate: float, marker_rate: float, answer: Future) -> None:
        refuse_rate(rate)
        self._frames.rate, self._marker_rate = rate, marker_rate
        self._due.restart(self._simulator.time)
        self._publisher.set_rates(rate, marker_rate)
        self._recording.set_rates(rate, marker_rate)
        text = f"rate is {rate:g} Hz, marker_rate is {min(rate, marker_rate):g} Hz"
        self.tell(changed_setting(self._simulator.time, text))
        answer.set_result("")

    def _do_reset(self, answer: Future) -> None:
        following = self._recording.of_next_run()
        self._drop_single_steps("the simulation was reset before the next frame")
        try:
            self._finish_recording(False, "reset", self._simulator.reset)
        except OutputError as error:
            self.error = self.error or error  # told when the node ends
        self._recording = following
        self._control.reset()
        self._begin()
        answer.set_result("reset to t = 0 s")

    def _drop_single_steps(self, reason: str) -> None:
        while self._single_steps:
            self._single_steps.popleft().set_exception(InputError(reason))
