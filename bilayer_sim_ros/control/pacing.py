"""Keeping simulated time in step with a steady clock, and knowing what kept it from that."""

from __future__ import annotations

import time
from collections.abc import Callable

LARGEST_LAG = 0.1
"""A simulation that is later than this does not race to catch up: it goes on from where it is [s]."""
PHYSICS, LOG, SUBSCRIBERS, CONTROLLERS = "physics", "log", "subscribers", "controllers that have not answered"
OTHERS = "other threads and programs"
"""What a run spends real time on; `OTHERS` is time in which a step could not go on as the processor was taken."""


class Pacer:
    """Says how long to wait so that simulated time does not run ahead of `factor` times real time.

    `factor`: simulated seconds per second; 0 means without waiting. `clock`: steady clock [s].
    """

    def __init__(self, factor: float, clock: Callable[[], float] = time.monotonic):
        self.factor = factor
        self.lost = 0.0  # Lag that was not made up for, in all [s]
        self._clock = clock
        self.restart(0.0)

    def restart(self, simulated: float) -> None:
        """Let simulated time `simulated` [s] be now."""
        self._simulated = simulated
        self._real = self._clock()

    def delay(self, simulated: float) -> float:
        """Return the time to wait until `simulated` [s] is due [s]; 0 when it is due or late."""
        if self.factor == 0.0:
            return 0.0
        delay = self._real + (simulated - self._simulated) / self.factor - self._clock()
        if delay < -LARGEST_LAG:
            self.lost -= delay
            self.restart(simulated)
        return max(delay, 0.0)


def cause_of_delay(spent: dict[str, float], real: float) -> str:
    """Describe in words the cause that took most of some real time [s], with the shares of the others."""
    shares = sorted(((seconds / real, cause) for cause, seconds in spent.items()), reverse=True)
    if not shares:
        return "not known"
    (share, cause), rest = shares[0], [f"{cause} {part:.0%}" for part, cause in shares[1:] if part >= 0.01]
    return f"{cause}, {share:.0%} of the time" + (f" ({', '.join(rest)})" if rest else "")
