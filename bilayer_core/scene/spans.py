"""Schedules as spans: between two corners or jumps each is one formula, which the engine evaluates, too."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import NamedTuple

from bilayer_core.scene.part import Part

ROUNDING = 1e-9
"""Part of a period by which a wave switches early, so that rounding of the time never delays it by a step."""
NEARLY = 1e-3
"""Part of a step by which one looks back from its end for the span that it lies in; more than any early switch."""
SAME = 1e-6
"""Part of a step by which two times are the same."""


def value_of_span(t, level, begin, rate, amplitude, frequency, phase):
    """Return the value of a `Span` at time t [s]; the engine compiles it."""
    s = max(t - begin, 0.0)
    value = level + rate * s
    if amplitude != 0.0:
        value += amplitude * math.sin(frequency * s + phase)
    return value


class Span(NamedTuple):
    """``level + rate s + amplitude sin(frequency s + phase)``, s = t − begin ≥ 0, until a corner or a jump."""

    until: float  # Time of the next corner or jump [s], infinity if there is none
    level: float  # In the unit of the schedule, as `amplitude`
    begin: float = 0.0  # Time from which s counts [s]
    rate: float = 0.0  # In that unit per s
    amplitude: float = 0.0
    frequency: float = 0.0
    phase: float = 0.0
    """`frequency`, `phase`: [rad/s], [rad]"""

    def value(self, t: float) -> float:
        """Return the value at time `t` [s]; at the end, where the schedule may jump, that from before."""
        return value_of_span(t, *self[1:])

    def later(self, delay: float, until: float) -> Span:
        """Return the same span `delay` [s] later, cut off at `until` [s]."""
        return self._replace(begin=self.begin + delay, until=min(self.until + delay, until))

    def jump_to(self, following: Span) -> bool:
        """Return whether the value jumps, beyond rounding, where this span ends and another follows."""
        before, after = self.value(self.until), following.value(self.until)
        largest = max(abs(self.level), abs(before), abs(self.amplitude), abs(after))
        return abs(after - before) > ROUNDING * largest


class Spans(Part):
    """Something that goes from one span to the next."""

    @abstractmethod
    def span(self, t: float) -> Span:
        """Return the span that contains time `t` [s]; where two meet, the one that begins there."""

    def value(self, t: float) -> float:
        """Return the value at time `t` [s], in the unit of the channel."""
        return self.span(t).value(t)

    def value_before(self, t: float, h: float) -> float:
        """Return the value at the end `t` [s] of a step of length `h` [s]: the limit from within the step where it
        jumps at `t`.

        A step that ends at a jump has its own value to its end; the next one begins with the new value.
        """
        span = self.span(t - NEARLY * h)
        return span.value(t) if abs(span.until - t) <= SAME * h else self.value(t)

    def jumps_at(self, t: float, h: float) -> bool:
        """Return whether the value jumps at time `t` [s], where a step of length `h` [s] ends."""
        span = self.span(t - NEARLY * h)
        return abs(span.until - t) <= SAME * h and span.jump_to(self.span(span.until))

    def values_at(self, times: list[float], h: float) -> list[float]:
        """Return `value` at increasing times about `h` [s] apart."""
        found, span = [], self.span(times[0])
        for t in times:
            if t >= span.until - NEARLY * h:
                span = self.span(t)
            found.append(span.value(t))
        return found
