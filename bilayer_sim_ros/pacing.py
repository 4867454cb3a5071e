"""Keeping simulated time in step with a steady clock."""

from __future__ import annotations

import time
from collections.abc import Callable

# A simulation that is later than this does not race to catch up: it goes on from where it is [s].
LARGEST_LAG = 0.1


class Pacer:
    """Says how long to wait so that simulated time does not run ahead of `factor` times real time.

    Parameters
    ----------
    factor : float
        Simulated seconds per second; 0 means without waiting.
    clock : callable
        Steady clock [s].
    """

    def __init__(self, factor: float, clock: Callable[[], float] = time.monotonic):
        self.factor = factor
        self._clock = clock
        self.restart(0.0)

    def restart(self, simulated: float) -> None:
        """Let simulated time `simulated` [s] be now."""
        self._simulated = simulated
        self._real = self._clock()

    def delay(self, simulated: float) -> float:
        """Time to wait until `simulated` [s] is due [s]; 0 when it is due or late."""
        if self.factor == 0.0:
            return 0.0
        delay = self._real + (simulated - self._simulated) / self.factor - self._clock()
        if delay < -LARGEST_LAG:
            self.restart(simulated)
        return max(delay, 0.0)
