"""How a run is doing, said about once a second."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from bilayer_core.simulation.stepper import StepReport
from bilayer_sim_ros.recording import LogStatus, Recording

# Real time between two reports [s].
STATUS_PERIOD = 1.0


@dataclass
class Status:
    """How the run is doing: since the status before, except for `time`, `paused`, `waited` and `log`.

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
        Largest of the last velocity corrections of steps [m/s].
    waited : float
        Real time for which there has been no step because no controller answers [s].
    log : LogStatus
    dropped : int
        Frames left out of the log.
    """

    time: float
    paused: bool
    real_time_factor: float = 0.0
    steps: int = 0
    substeps: int = 0
    iterations: int = 0
    residual: float = 0.0
    waited: float = 0.0
    log: LogStatus = LogStatus()
    dropped: int = 0


class StatusReporter:
    """Sums up steps and reports them.

    Parameters
    ----------
    report : callable
        Called with a `Status`.
    """

    def __init__(self, report: Callable[[Status], None]):
        self._report = report

    def start(self, simulated: float, waited: float = 0.0, log: LogStatus | None = None) -> None:
        """Count from simulated time `simulated` [s] and now on."""
        self._status = Status(simulated, False, waited=waited, log=log or LogStatus())
        self._since = time.monotonic()

    def add(self, step: StepReport) -> None:
        """Count a step."""
        status = self._status
        status.steps += 1
        status.substeps += step.substeps
        status.iterations += step.iterations
        status.residual = max(status.residual, step.residual)

    @property
    def due_at(self) -> float:
        """When the next report is due, on the monotonic clock [s]."""
        return self._since + STATUS_PERIOD

    def report_when_due(self, simulated: float, paused: bool, waiting: bool, recording: Recording) -> None:
        """Report at simulated time `simulated` [s], if it is time to."""
        real = time.monotonic() - self._since
        if real < STATUS_PERIOD:
            return
        status = self._status
        status.real_time_factor = (simulated - status.time) / real
        status.time, status.paused = simulated, paused
        status.waited = status.waited + real if waiting and status.steps == 0 else 0.0
        log, before = recording.log_status, status.log.dropped
        status.log, status.dropped = log, log.dropped - before
        self._report(status)
        self.start(simulated, status.waited, log)
