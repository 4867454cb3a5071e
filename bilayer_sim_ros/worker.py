"""The thread that steps the simulation, beside the executor that serves topics and services."""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol

from bilayer_core.errors import InputError
from bilayer_core.integrate.frame import Frame
from bilayer_core.integrate.observer import TIME_ROUNDING
from bilayer_core.integrate.result import Termination
from bilayer_core.integrate.simulator import Simulator
from bilayer_sim_ros.pacing import Pacer
from bilayer_sim_ros.recording import Recording
from bilayer_sim_ros.stimulus import StimulusInputs

# Shorter waits cost more than they are worth: the simulation may be this far ahead of the clock [s].
SHORTEST_WAIT = 0.01
# In a log, this stimulus says that the scene's schedule acts again.
SCHEDULE = math.nan
# Real time between two status reports, and between two showings of a paused frame [s].
STATUS_PERIOD = 1.0
# Output times are compared in output periods; times of steps have rounding.
PERIOD_ROUNDING = 1e-6


class Publisher(Protocol):
    """Where frames go beside files."""

    @property
    def wanted(self) -> bool:
        """Whether anybody listens."""

    def publish(self, frame: Frame, everything: bool = False) -> None:
        """Send what somebody listens to: what is due, or everything."""


@dataclass
class Status:
    """How the run is doing: since the status before, except for `time` and `paused`.

    Attributes
    ----------
    time : float
        Simulated time [s].
    paused : bool
    real_time_factor : float
        Simulated seconds per second.
    steps, substeps, iterations : int
        Steps, the parts in which they were taken, and Newton iterations.
    residual : float
        Largest velocity correction left at the end of a step [m/s].
    """

    time: float
    paused: bool
    real_time_factor: float = 0.0
    steps: int = 0
    substeps: int = 0
    iterations: int = 0
    residual: float = 0.0


class SimulationWorker:
    """Steps a simulator in a thread of its own, paced on a steady clock, and hands out frames.

    Parameters
    ----------
    simulator : Simulator
        Compiled, at its start.
    inputs : StimulusInputs
        Asked before each step.
    publisher : Publisher
    recording : Recording
        Files of the first run.
    rate : float
        Frames per simulated second [Hz].
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
        Why the worker ended, unless it was stopped or reached the duration.
    """

    def __init__(
        self,
        simulator: Simulator,
        *,
        inputs: StimulusInputs,
        publisher: Publisher,
        recording: Recording,
        rate: float,
        pacer: Pacer,
        duration: float = math.inf,
        paused: bool = False,
        report: Callable[[Status], None],
        finished: Callable[[], None],
    ):
        self._simulator = simulator
        self._inputs = inputs
        self._publisher = publisher
        self._recording = recording
        self._rate = rate
        self._pacer = pacer
        self._duration = duration
        self._paused = paused
        self._report = report
        self._finished = finished
        self._stopping = threading.Event()
        self._ended = threading.Event()
        self._requests: queue.SimpleQueue[tuple[Future, Callable[[], str]] | None] = queue.SimpleQueue()
        self._frame_is_out = True
        self._thread = threading.Thread(target=self._work, name="simulation")
        self.error: Exception | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End after the present step, finish the files, and return when that is done."""
        self._stopping.set()
        self._requests.put(None)
        self._thread.join()

    def pause(self) -> Future:
        """Ask for a pause. The future's result says what happened; InputError if it could not be done."""
        return self._ask(self._do_pause)

    def resume(self) -> Future:
        """Ask to go on."""
        return self._ask(self._do_resume)

    def step(self) -> Future:
        """Ask for one output period while paused."""
        return self._ask(self._do_step)

    def reset(self) -> Future:
        """Ask to go back to the start of the scene; paused stays paused."""
        return self._ask(self._do_reset)

    def _ask(self, action: Callable[[], str]) -> Future:
        future: Future = Future()
        self._requests.put((future, action))
        if self._ended.is_set():
            self._refuse_requests()
        return future

    def _refuse_requests(self) -> None:
        """Answer what nobody will do any more."""
        while True:
            try:
                request = self._requests.get_nowait()
            except queue.Empty:
                return
            if request is not None:
                request[0].set_exception(InputError("the simulation has ended"))

    # The rest runs in the worker's thread.

    def _work(self) -> None:
        complete, termination = False, Termination.INTERRUPTED.value
        try:
            self._begin()
            while not self._stopping.is_set() and not self._is_over():
                self._serve_requests()
                if not self._paused:
                    self._advance()
                self._report_when_due()
                self._show_again_when_due()
            if not self._stopping.is_set():
                complete, termination = True, Termination.COMPLETED.value
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
            self._ended.set()
            self._refuse_requests()
            self._finished()

    def _finish_recording(self, complete: bool, termination: str) -> None:
        """Close the files with the last accepted step in them."""
        try:
            if not self._frame_is_out:
                self._hand_out()
        finally:
            self._recording.close(complete, termination)

    def _begin(self) -> None:
        """Start a run at the simulator's present state, and hand out its first frame."""
        self._begun = self._simulator.time
        self._pacer.restart(self._simulator.time)
        self._status = Status(self._simulator.time, self._paused)
        self._status_since = time.monotonic()
        self._recording.start(self._simulator.description)
        self._hand_out()

    def _is_over(self) -> bool:
        left = self._duration - self._simulator.time
        return left < (0.5 if self._simulator.tolerance is None else TIME_ROUNDING) * self._simulator.dt

    def _serve_requests(self) -> None:
        """Wait until the next step is due (or, when paused, the next status), and do what is asked meanwhile."""
        while not self._stopping.is_set():
            wait = self._time_to_wait()
            try:
                request = self._requests.get(timeout=wait) if wait > 0.0 else self._requests.get_nowait()
            except queue.Empty:
                return
            if request is not None:
                future, action = request
                try:
                    future.set_result(action())
                except Exception as error:
                    future.set_exception(error)
                    if not isinstance(error, InputError):
                        raise

    def _time_to_wait(self) -> float:
        if self._paused:
            return max(min(self._status_since, self._shown_at) + STATUS_PERIOD - time.monotonic(), 0.0)
        delay = self._pacer.delay(self._simulator.time)
        return delay if delay >= SHORTEST_WAIT else 0.0

    def _advance(self) -> bool:
        """Take one step; whether a frame was due at its end."""
        start = self._simulator.time
        for channel, value in self._inputs.changes(start).items():
            self._simulator.set_stimulus(channel, value)
            self._recording.log_stimulus(channel, SCHEDULE if value is None else value, start)
        report = self._simulator.step(until=self._next_stop())
        self._frame_is_out = False
        status = self._status
        status.steps += 1
        status.substeps += report.substeps
        status.iterations += report.iterations
        status.residual = max(status.residual, report.residual)
        frame_is_due = self._periods(self._simulator.time) > self._periods(start)
        if frame_is_due:
            self._hand_out()
        return frame_is_due

    def _next_stop(self) -> float:
        """When a frame is due, or the run ends [s]: where adaptive steps end at the latest."""
        due = self._begun + (self._periods(self._simulator.time) + 1) / self._rate
        return due if due < self._duration - TIME_ROUNDING * self._simulator.dt else self._duration

    def _periods(self, time: float) -> int:
        """Output periods of this run that are complete at a time [s]."""
        return math.floor((time - self._begun) * self._rate + PERIOD_ROUNDING)

    def _hand_out(self) -> None:
        """Show the present frame to all who look."""
        self._frame_is_out = True
        self._shown_at = time.monotonic()
        publish = self._publisher.wanted
        if publish or self._recording.wanted:
            frame = self._simulator.frame()
            if publish:
                self._publisher.publish(frame, everything=self._paused)
            self._recording.observe(frame)

    def _report_when_due(self) -> None:
        now = time.monotonic()
        real = now - self._status_since
        if real >= STATUS_PERIOD:
            status = self._status
            status.real_time_factor = (self._simulator.time - status.time) / real
            status.time, status.paused = self._simulator.time, self._paused
            self._report(status)
            self._status = Status(self._simulator.time, self._paused)
            self._status_since = now

    def _show_again_when_due(self) -> None:
        """Send the present frame of a paused simulation to those who came late."""
        if self._paused and time.monotonic() - self._shown_at >= STATUS_PERIOD:
            self._shown_at = time.monotonic()
            if self._publisher.wanted:
                self._publisher.publish(self._simulator.frame(), everything=True)

    def _do_pause(self) -> str:
        self._paused = True
        return f"paused at t = {self._simulator.time:.6g} s"

    def _do_resume(self) -> str:
        if self._paused:
            self._paused = False
            self._pacer.restart(self._simulator.time)
        return f"running from t = {self._simulator.time:.6g} s"

    def _do_step(self) -> str:
        if not self._paused:
            raise InputError("the simulation is running: call pause first")
        while not self._advance() and not self._is_over():
            pass
        return f"paused at t = {self._simulator.time:.6g} s"

    def _do_reset(self) -> str:
        following = self._recording.of_next_run()
        self._finish_recording(False, "reset")
        self._recording = following
        self._simulator.reset()
        self._inputs.reset()
        self._begin()
        return "reset to t = 0 s"
