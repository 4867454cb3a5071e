"""When those who look at a run are due."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from bilayer_core.observed.frame import Frame
from bilayer_core.observed.observer import Observed, Observer

TIME_ROUNDING = 1e-9
"""Part of a period by which a time may be off and still ends it."""
NUMBER_ROUNDING = 4.0 * sys.float_info.epsilon
"""By which part of itself a product of time and rate may be off; more than the above after ten million periods."""
STAMP_DIGITS = 9
"""Messages have times in nanoseconds: so have frames, as a run that is made again from its log shows the same ones."""
SHORTEST_STAMPED = 1e-6
"""Shortest distance of frames whose times are whole nanoseconds [s]."""


def completed(time: float, rate: float) -> int:
    """Return the periods of `rate` [1/s] from time 0 to `time` [s]; one that ends now is complete."""
    periods = time * rate
    return math.floor(periods + TIME_ROUNDING + NUMBER_ROUNDING * abs(periods))


def next_end(time: float, rate: float) -> float:
    """Return the end [s] of the period that has not ended at `time` [s]."""
    return (completed(time, rate) + 1) / rate


def next_due(observer: Observer, until: float) -> float:
    """Return when an observer is due that has seen all up to a time [s]."""
    return observer.due if hasattr(observer, "due") else next_end(until, observer.rate)


def has_come(observer: Observer, until: float, time: float) -> bool:
    """Return whether an observer that has seen all up to a time is due at another [s], or is but for rounding."""
    if hasattr(observer, "due"):
        return observer.due <= max(time, round(time, STAMP_DIGITS))  # itself has no whole nanoseconds, maybe
    return completed(time, observer.rate) > completed(until, observer.rate)


class Schedule:
    """Which observer is due when; a frame is made once for all that are due."""

    def __init__(self, observers: Sequence[Observer], simulator: Observed):
        self._observers = list(observers)
        self._simulator = simulator
        self._until = simulator.time  # up to where all that was due was shown [s]
        self._last_seen: list[float | None] = [None] * len(self._observers)

    def start(self) -> None:
        if self._observers:
            description = self._simulator.description
            for observer in self._observers:
                observer.start(description)
            self._show(self._simulator.frame(), range(len(self._observers)))

    def start_over(self) -> None:
        """Show what is now after a jump in time, and count from there."""
        self._until = self._simulator.time
        self._show(self._simulator.frame(), range(len(self._observers)))

    def next_due(self) -> float:
        """Return the next time at which an observer is due [s], after the present one; infinity without observers."""
        if not self._observers:
            return math.inf
        self._until = self._simulator.time
        return min((next_due(of, self._until) for of in self._observers), default=math.inf)

    def is_due(self) -> bool:
        """Return whether the present time has reached the next one, or is the same but for rounding."""
        return bool(self._due_at(self._simulator.time))

    def _due_at(self, time: float) -> list[int]:
        """Return which observers are due at a time."""
        return [i for i, of in enumerate(self._observers) if has_come(of, self._until, time)]

    def observe_due(self, frame_at: Callable[[float], Frame]) -> None:
        """Show all frames that are due up to now, each of its own time.

        Parameters
        ----------
        frame_at : callable
            Makes the frame of a time in the last step [s].
        """
        while self.is_due():
            due = min(min(next_due(of, self._until) for of in self._observers), self._simulator.time)
            which, before, self._until = self._due_at(due), self._until, due
            self._show(frame_at(round(due, STAMP_DIGITS) if due - before > SHORTEST_STAMPED else due), which)

    def observe_last(self) -> None:
        """Show the present frame to those who have not seen it."""
        missing = [i for i, seen in enumerate(self._last_seen) if seen not in (None, self._simulator.time)]
        if missing:
            self._show(self._simulator.frame(), missing)

    def _show(self, frame: Frame, which: Iterable[int]) -> None:
        for i in which:
            self._observers[i].observe(frame)
            self._last_seen[i] = frame.time

    def finish(self, complete: bool, termination: str, failure: BaseException | None = None) -> None:
        """Show the last frame to whom it is missing, and close all, whatever goes wrong with one of them.

        Parameters
        ----------
        complete, termination
            As in `Observer.close`.
        failure : BaseException, optional
            What ended the run; see `first_failure`.
        """
        work: list[Callable[[], None]] = [self.observe_last]
        work += [partial(observer.close, complete, termination) for observer in self._observers]
        first_failure(work, failure)


def first_failure(work: Iterable[Callable[[], None]], failure: BaseException | None = None) -> None:
    """Do all, each whatever goes wrong with another; raise what went wrong first, with notes of what did after that.

    Parameters
    ----------
    work : iterable of callable
    failure : BaseException, optional
        Went wrong before; it gets the notes, and is not raised.
    """
    before = failure
    for do in work:
        try:
            do()
        except Exception as error:
            if failure is None:
                failure = error
            elif str(error) != str(failure):
                failure.add_note(str(error))
    if failure is not None and failure is not before:
        raise failure
