"""When steps take what controllers send: as it comes, or in lockstep with them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from bilayer_core.errors import InputError
from bilayer_core.simulation.observers import TIME_ROUNDING
from bilayer_sim_ros.periods import Periods
from bilayer_sim_ros.stimulus import StimulusInputs

SHORTEST_PERIOD = 1e-6
"""Shortest control period where steps are adaptive [s]; /clock counts nanoseconds."""


class Control(Protocol):
    """What a run asks about its controllers, in the thread that simulates."""

    @property
    def waiting(self) -> bool:
        """Whether simulated time must not go on."""

    def start(self, time: float) -> None:
        """A run starts at `time` [s]."""

    def reset(self) -> None:
        """The run is given up; forget what was heard."""

    def changes(self, time: float) -> dict[str, float | None]:
        """What to set for the step that begins at `time` [s], see `StimulusInputs.changes`."""

    def next_stop(self, time: float) -> float:
        """Where adaptive steps from `time` [s] on end at the latest [s]."""

    def advance_to(self, time: float) -> None:
        """A step has ended at `time` [s]."""

    def repeat(self, time: float) -> None:
        """Time stands still at `time` [s]: tell those who came late."""


class Asynchronous:
    """Nobody waits for a controller: each step takes what has come.

    Parameters
    ----------
    inputs : StimulusInputs
    """

    waiting = False

    def __init__(self, inputs: StimulusInputs):
        self._inputs = inputs

    def start(self, time: float) -> None:
        """Nothing to prepare."""

    def reset(self) -> None:
        """Forget all messages."""
        self._inputs.reset()

    def changes(self, time: float) -> dict[str, float | None]:
        """What has come since the step before, and the fallback."""
        return self._inputs.changes(time)

    def next_stop(self, time: float) -> float:
        """Never."""
        return math.inf

    def advance_to(self, time: float) -> None:
        """Every time is like any other."""

    def repeat(self, time: float) -> None:
        """Time is published with frames."""


class Lockstep:
    """Time goes on only when a controller has answered.

    At every tick, a multiple of the control period since the start of the run, the time is published, and the step
    from there waits for a message that came after that. Between ticks no messages are taken. A controller that
    answers each distinct time once thus acts at the same simulated times however long it takes.

    Parameters
    ----------
    inputs : StimulusInputs
    rate : float
        Ticks per simulated second [Hz].
    publish : callable
        Publishes a time [s].
    """

    def __init__(self, inputs: StimulusInputs, rate: float, publish: Callable[[float], None]):
        self._inputs = inputs
        self._ticks = Periods(rate)
        self._publish = publish
        self._count = 0
        self._open = False

    @property
    def waiting(self) -> bool:
        """Whether a tick has no answer yet."""
        return self._open and not self._inputs.answered

    def start(self, time: float) -> None:
        """The first tick is the start itself."""
        self._ticks.start(time)
        self._count = 0
        self._open_tick(time)

    def reset(self) -> None:
        """Forget all messages, but not an answer to the start that no step has taken: it is not given twice."""
        if not (self._open and self._count == 0):
            self._inputs.reset()
            self._open = False

    def changes(self, time: float) -> dict[str, float | None]:
        """At a tick what has come, and the fallback; otherwise nothing."""
        if not self._open:
            return {}
        self._open = False
        return self._inputs.changes(time)

    def next_stop(self, time: float) -> float:
        """The next tick."""
        return self._ticks.next_end(time)

    def advance_to(self, time: float) -> None:
        """Open a tick if the step has reached one."""
        count = self._ticks.complete(time)
        if count > self._count:
            self._count = count
            self._open_tick(time)

    def _open_tick(self, time: float) -> None:
        if not self._open:
            self._open = True
            self._inputs.ask()
        self._publish(time)

    def repeat(self, time: float) -> None:
        """Publish the time again, at a tick."""
        if self._open:
            self._publish(time)


def tick_rate(control_period: float, rate: float, clock: bool, shortest: float) -> float:
    """Ticks per simulated second [Hz].

    Parameters
    ----------
    control_period : float
        Wished distance of ticks [s]; 0 = that of frames.
    rate : float
        Of frames [Hz].
    clock : bool
        Whether time is published.
    shortest : float
        Least distance of ticks [s].

    Raises
    ------
    InputError
        If time is not published, or ticks are closer together than steps.
    """
    if not clock:
        raise InputError(
            "parameter 'publish_clock' is False; with 'lockstep' allowed is True: controllers answer the time on /clock"
        )
    if control_period == 0.0:
        return rate
    if control_period < shortest * (1.0 - TIME_ROUNDING):
        raise InputError(
            f"parameter 'control_period' is {control_period:g}; allowed is a finite number >= {shortest:g}, the "
            "shortest time between two steps [s], or 0, the period of frames"
        )
    return 1.0 / control_period
