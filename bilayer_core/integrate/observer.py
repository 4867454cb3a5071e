"""Who looks at a run, and when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Protocol

from .frame import Description, Frame

if TYPE_CHECKING:
    from .simulator import Simulator


TIME_ROUNDING = 1e-9
"""Part of a step by which a time may be off and is still the time at which somebody is due."""


class Observer(Protocol):
    """Something that looks at a run `rate` times in each simulated second."""

    rate: float

    def start(self, description: Description) -> None:
        """Called once, before the first frame."""

    def observe(self, frame: Frame) -> None:
        """Called with every frame that is due, the first and the last included."""

    def close(self, complete: bool, termination: str = "") -> None:
        """Called once at the end; `complete` is false if the run was cut short, `termination` says why it ended."""


class Schedule:
    """Which observer is due when; a frame is made once for all that are due."""

    def __init__(self, observers: Sequence[Observer], simulator: Simulator):
        self._observers = list(observers)
        self._simulator = simulator
        self._count = [0] * len(self._observers)
        self._origin = simulator.time
        self._rounding = TIME_ROUNDING * simulator.dt
        self._last_seen: list[float | None] = [None] * len(self._observers)

    def start(self) -> None:
        if self._observers:
            description = self._simulator.description
            for observer in self._observers:
                observer.start(description)
            self._show(range(len(self._observers)))

    def next_stop(self, end: float) -> float:
        """When the next observer is due [s], but not after `end` [s]."""
        due = min(
            (self._origin + (count + 1) / of.rate for count, of in zip(self._count, self._observers, strict=True)),
            default=end,
        )
        return due if due < end - self._rounding else end

    def steps_until_due(self, most: float) -> int:
        """Fixed steps until the next observer is due, at most `most`."""
        now, dt = self._simulator.time, self._simulator.dt
        due = self.next_stop(math.inf)
        return int(most) if math.isinf(due) else int(min(most, max(1.0, math.ceil((due - now - self._rounding) / dt))))

    def observe_due(self) -> None:
        elapsed = self._simulator.time - self._origin + self._rounding
        due = [i for i, observer in enumerate(self._observers) if elapsed >= (self._count[i] + 1) / observer.rate]
        if due:
            for i in due:
                self._count[i] = int(elapsed * self._observers[i].rate)
            self._show(due)

    def _show(self, which) -> None:
        frame = self._simulator.frame()
        for i in which:
            self._observers[i].observe(frame)
            self._last_seen[i] = frame.time

    def finish(self, complete: bool, termination: str) -> None:
        """Show the last frame to whom it is missing, and close all, whatever goes wrong with one of them."""
        if not self._observers:
            return
        with ExitStack() as closing:
            for observer in reversed(self._observers):
                closing.callback(observer.close, complete, termination)
            missing = [i for i, seen in enumerate(self._last_seen) if seen not in (None, self._simulator.time)]
            if missing:
                self._show(missing)
