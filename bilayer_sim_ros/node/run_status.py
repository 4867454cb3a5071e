"""How a run is doing, said about once a second."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from bilayer_core.simulation.simulator import Simulator
from bilayer_core.simulation.stepper import StepReport
from bilayer_core.simulation.summary import numerical_energy
from bilayer_sim_ros.control.pacing import Pacer
from bilayer_sim_ros.publishing.run_files import LogStatus, Recording

# Real time between two reports [s].
STATUS_PERIOD = 1.0


@dataclass
class Status:
    """How the run is doing: since the status before, except for `time`, `paused`, `asked_factor`, `rejected_in_all`,
    `numerical_energy`, `waited` and `log`.
    """

    time: float  # Simulated time [s]
    paused: bool
    real_time_factor: float = 0.0  # Simulated seconds per second
    asked_factor: float = 0.0  # The same as it was asked for; 0 for as fast as possible
    lost: float = 0.0  # Lag behind it that is not made up for [s]
    real: float = 0.0  # Real time [s]
    spent: dict[str, float] = field(default_factory=dict)  # What that went to, in part: cause (`pacing`) to seconds
    steps: int = 0
    substeps: int = 0
    rejected: int = 0
    iterations: int = 0
    """`steps`, `substeps`, `rejected`, `iterations`: steps, the parts in which they were taken, attempts that were
    not accepted, and Newton iterations.
    """
    residual: float = 0.0  # Largest of the last velocity corrections of steps [m/s]
    rejected_in_all: int = 0  # Such attempts since the start
    numerical_energy: float = 0.0
    energy_through: float = 0.0
    """`numerical_energy`, `energy_through`: what steps have made or, below zero, lost of energy since the start, and
    the largest energy of the run [J].
    """
    waited: float = 0.0  # Real time for which there has been no step because no controller answers [s]
    log: LogStatus = LogStatus()
    dropped: int = 0  # Frames left out of the log


class StatusReporter:
    """Sums up steps and reports them. `report`: called with a `Status`."""

    def __init__(self, report: Callable[[Status], None], pacer: Pacer):
        self._report = report
        self._pacer = pacer
        self._lost = 0.0

    def start(self, simulated: float, waited: float = 0.0, log: LogStatus | None = None) -> None:
        """Count from simulated time `simulated` [s] and now on."""
        self._status = Status(simulated, False, waited=waited, log=log or LogStatus())
        self._since = time.monotonic()

    def add(self, step: StepReport) -> None:
        """Count a step."""
        status = self._status
        status.steps += 1
        status.substeps += step.substeps
        status.rejected += step.rejected
        status.iterations += step.iterations
        status.residual = max(status.residual, step.residual)

    def spend(self, cause: str, seconds: float) -> None:
        """Count real time that something took [s]."""
        self._status.spent[cause] = self._status.spent.get(cause, 0.0) + seconds

    @contextmanager
    def spending(self, cause: str) -> Iterator[None]:
        """Count the real time that a block takes, if there is a cause."""
        begin = time.monotonic()
        try:
            yield
        finally:
            if cause:
                self.spend(cause, time.monotonic() - begin)

    @property
    def due_at(self) -> float:
        """When the next report is due, on the monotonic clock [s]."""
        return self._since + STATUS_PERIOD

    def report_when_due(self, simulator: Simulator, paused: bool, waiting: bool, recording: Recording) -> None:
        """Report how a simulator is doing, if it is time to."""
        real = time.monotonic() - self._since
        if real < STATUS_PERIOD:
            return
        status, simulated = self._status, simulator.time
        status.numerical_energy, status.energy_through = numerical_energy(simulator)
        status.rejected_in_all = simulator.statistics.rejected
        status.real_time_factor = (simulated - status.time) / real
        status.time, status.paused, status.real = simulated, paused, real
        status.asked_factor = self._pacer.factor
        status.lost, self._lost = self._pacer.lost - self._lost, self._pacer.lost
        status.waited = status.waited + real if waiting and status.steps == 0 else 0.0
        log, before = recording.log_status, status.log.dropped
        status.log, status.dropped = log, log.dropped - before
        self._report(status)
        self.start(simulated, status.waited, log)
