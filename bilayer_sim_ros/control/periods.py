"""Equal periods of simulated time."""

from __future__ import annotations

import math

# Ends of periods are compared in periods; times of steps have rounding.
ROUNDING = 1e-6


class Periods:
    """Periods of a run that follow one another from its start.

    `rate`: periods per simulated second [Hz]; may be set at any time, and counts from the start then too.
    """

    def __init__(self, rate: float):
        self.rate = rate
        self._start = 0.0

    def start(self, time: float) -> None:
        """Let the first period begin at `time` [s]."""
        self._start = time

    def complete(self, time: float) -> int:
        """Return how many have ended at `time` [s], to rounding."""
        return math.floor((time - self._start) * self.rate + ROUNDING)

    def end(self, count: int) -> float:
        """Return the end [s] of so many periods."""
        return self._start + count / self.rate

    def next_end(self, time: float) -> float:
        """Return the end [s] of the period that has not ended at `time` [s]."""
        return self.end(self.complete(time) + 1)

    def time_to_nearest_end(self, time: float) -> float:
        """Return the time from `time` [s] to the end of a period that is nearest to one period later [s]."""
        return self.next_end(time + 0.5 / self.rate) - time
