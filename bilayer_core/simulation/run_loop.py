"""The loop of a run: steps to its end, with those who look, ask and act in between."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ..observed.inputs import Acted, Input
from .observers import Schedule
from .result import Termination

STEPS_AT_ONCE = 64
"""That the engine makes before anyone is asked whether to go on."""


class Advanced(Acted, Protocol):
    """What the loop advances: a `Simulator`."""

    @property
    def time(self) -> float: ...


@dataclass(frozen=True)
class Callbacks:
    """Who is called during a run; see `Simulator.run`."""

    stop: Callable[[], bool] | None = None
    interrupted: Callable[[], bool] | None = None
    progress: Callable[[float], None] | None = None
    each_step: Callable[[float], None] | None = None

    @property
    def steps_at_once(self) -> int:
        """Steps after which somebody is to be called."""
        return STEPS_AT_ONCE if self.stop is None and self.each_step is None else 1


def advance_to(
    simulator: Advanced,
    end: float,
    last: float,
    integrate: Callable[[int, float, float], object],
    schedule: Schedule,
    inputs: Sequence[Input],
    callbacks: Callbacks,
) -> Termination:
    """Make steps until the end of a run, or until someone ends it.

    Parameters
    ----------
    simulator : Advanced
    end : float
        Where the last adaptive step ends [s].
    last : float
        A step that ends here or later is the last [s].
    integrate : callable
        Makes at most so many steps, to this time at the latest, and none after one that has reached that time.
    schedule : Schedule
        Of the observers.
    inputs : sequence of Input
    callbacks : Callbacks

    Returns
    -------
    Termination
    """
    waiting = deque(sorted(inputs, key=lambda of: of.time))
    while simulator.time < last:
        while waiting and waiting[0].time <= simulator.time:
            waiting.popleft().apply(simulator)
        until = min(end, waiting[0].time) if waiting else end
        integrate(callbacks.steps_at_once, until, schedule.next_due())
        schedule.observe_due()
        if callbacks.each_step is not None:
            callbacks.each_step(simulator.time)
        if callbacks.progress is not None:
            callbacks.progress(simulator.time)
        if callbacks.stop is not None and callbacks.stop():
            return Termination.STOPPED
        if callbacks.interrupted is not None and simulator.time < last and callbacks.interrupted():
            return Termination.INTERRUPTED
    return Termination.COMPLETED
