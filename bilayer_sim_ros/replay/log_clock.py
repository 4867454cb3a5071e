"""Where in the time of a log playing is."""

from __future__ import annotations

import time
from collections.abc import Callable

from bilayer_core.log.messages.cdr import NANOSECONDS

LONGEST = 2**62
"""More than any log takes, at any rate [ns]."""


class LogClock:
    """The time of a log, which runs at `rate` on a steady clock, or stands still.

    `rate`: seconds of the log per second, above 0. `clock`: steady clock [s].
    """

    def __init__(self, rate: float, clock: Callable[[], float] = time.monotonic):
        self._clock = clock
        self._rate = rate
        self.running = False  # At first it stands still, at 0
        self.jump(0)

    @property
    def rate(self) -> float:
        """Seconds of the log per second; when it is set, time goes on from where it is."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self.jump(self.now)
        self._rate = rate

    @property
    def now(self) -> int:
        """Time of the log [ns]."""
        if not self.running:
            return self._time
        return self._time + int(min((self._clock() - self._since) * self._rate * NANOSECONDS, LONGEST))

    def jump(self, time: int) -> None:
        """Let it be `time` [ns] of the log now."""
        self._time = time
        self._since = self._clock()

    def start(self) -> None:
        """Run from where it is."""
        self.jump(self.now)
        self.running = True

    def stop(self) -> None:
        """Stop the clock where it is."""
        self.jump(self.now)
        self.running = False

    def until(self, time: int) -> float:
        """Return the seconds until `time` [ns] of the log while the clock runs; below 0 if it is past."""
        return self._since + (time - self._time) / NANOSECONDS / self._rate - self._clock()
