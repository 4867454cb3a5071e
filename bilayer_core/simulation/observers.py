"""When those who look at a run are due."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from bilayer_core.engine import step_size
from bilayer_core.observed.observer import Observed, Observer

TIME_ROUNDING = step_size.PERIOD_ROUNDING
completed = step_size.completed.py_func
"""Periods of a rate [1/s] that are over at a time [s]: the same function decides where steps end."""


class Schedule:
    """Which observer is due when; a frame is made once for all that are due."""

    def __init__(self, observers: Sequence[Observer], simulator: Observed):
        self._observers = list(observers)
        self._simulator = simulator
        self._count = [completed(simulator.time, of.rate) for of in self._observers]
        self._last_seen: list[float | None] = [None] * len(self._observers)

    def start(self) -> None:
        if self._observers:
            description = self._simulator.description
            for observer in self._observers:
                observer.start(description)
            self._show(range(len(self._observers)))

    def start_over(self) -> None:
        """Show what is now after a jump in time, and count from there."""
        self._count = [completed(self._simulator.time, of.rate) for of in self._observers]
        self._show(range(len(self._observers)))

    def next_due(self) -> float:
        """Return the earliest time of a step's end at which an observer is due [s]; infinity without observers."""
        due = zip(self._count, self._observers, strict=True)
        return min(((count + 1 - TIME_ROUNDING) / of.rate for count, of in due), default=math.inf)

    def observe_due(self) -> None:
        done = [completed(self._simulator.time, of.rate) for of in self._observers]
        due = [i for i, (count, before) in enumerate(zip(done, self._count, strict=True)) if count > before]
        if due:
            self._count = done
            self._show(due)

    def observe_last(self) -> None:
        """Show the present frame to those who have not seen it."""
        missing = [i for i, seen in enumerate(self._last_seen) if seen not in (None, self._simulator.time)]
        if missing:
            self._show(missing)

    def _show(self, which: Iterable[int]) -> None:
        frame = self._simulator.frame()
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
