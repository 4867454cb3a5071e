"""The loop of a run: steps to its end, with those who look, ask and act in between."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from bilayer_core.errors import InputError
from bilayer_core.observed.inputs import Acted, Input
from bilayer_core.simulation.observers import Schedule
from bilayer_core.simulation.run_result import Termination

STEPS_AT_ONCE = 64
"""That the engine makes before anyone is asked whether to go on."""


class Advanced(Acted, Protocol):
    """Object that the loop advances: a `Simulator`."""

    @property
    def time(self) -> float: ...


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

    Raises
    ------
    InputError
        If both are given, or there is no such time.
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
