"""Stimuli that repeat: sine, square wave, pulse train. The phase is found anew at each time, so it does not drift."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from bilayer_core.scene.faults import Fault
from bilayer_core.scene.spans import ROUNDING, Span, Spans
from bilayer_core.scene.units import Angle, DutyCycle, NonNegativeTime, PlainNumber, PositiveTime, Time, whole


class Sine(Spans):
    """``mean + amplitude sin(2π (t − start)/period + phase)``; before `start` its value there."""

    type: Literal["sine"]
    mean: PlainNumber
    """In the unit of the channel."""
    amplitude: PlainNumber
    """In the unit of the channel."""
    period: PositiveTime
    """Of one cycle."""
    phase: Angle = 0.0
    """At the start; −90 deg begins at the lowest value."""
    start: Time = 0.0
    """Until then the value at the start."""

    def span(self, t: float) -> Span:
        """Return the span that contains time `t` [s].

        The start is a corner, and so is every quarter of a period: a longer step would miss the wave.
        """
        quarter = self.period / 4.0
        number = math.floor((t - self.start) / quarter + ROUNDING)
        if number < 0:
            return Span(self.start, self.mean + self.amplitude * math.sin(self.phase))
        begin, until = (self.start + quarter * k for k in (number, number + 1))
        phase = self.phase + 0.5 * math.pi * (number % 4)
        return Span(until, self.mean, begin, 0.0, self.amplitude, 0.5 * math.pi / quarter, phase)

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Return the values between which all others lie, by their keys."""
        return {
            ("mean + amplitude",): self.mean + self.amplitude,
            ("mean - amplitude",): self.mean - self.amplitude,
        }


class _Pulses(Spans):
    """From `low` to `high` at the beginning of each period, and back; at once, or linearly over `rise_time`."""

    low: PlainNumber
    """In the unit of the channel."""
    high: PlainNumber
    """In the unit of the channel."""
    period: PositiveTime
    """From the beginning of one rise to that of the next."""
    start: Time = 0.0
    """Of the first rise."""
    rise_time: NonNegativeTime = 0.0
    """Of each flank, up and down; 0 switches at once."""

    def _span(self, t: float, width: float, last: float) -> Span:
        """Return the span at time `t` of pulses that begin to fall after `width` [s]; they end after `last` periods."""
        cycle, early = math.floor((t - self.start) / self.period + ROUNDING), ROUNDING * self.period
        if cycle < 0:
            return Span(self.start, self.low)
        if cycle >= last:
            return Span(math.inf, self.low)
        begin = self.start + cycle * self.period
        top, fall, bottom = begin + self.rise_time, begin + width, begin + width + self.rise_time
        if t < top - early:
            return Span(top, self.low, begin, (self.high - self.low) / self.rise_time)
        if t < fall - early:
            return Span(fall, self.high)
        if t < bottom - early:
            return Span(bottom, self.high, fall, (self.low - self.high) / self.rise_time)
        return Span(self.start + (cycle + 1) * self.period if cycle + 1 < last else math.inf, self.low)

    def _faults_of_rise(self, width: float, where: str) -> list[Fault]:
        """Return a fault unless both flanks fit into the period."""
        shortest = min(width, self.period - width)
        if self.rise_time <= shortest * (1.0 + ROUNDING):
            return []
        demand = f"must be at most {shortest:g} s: both flanks have to fit with `period` and `{where}`"
        return [(("rise_time",), self.rise_time, demand)]

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Return the values between which all others lie, by their keys."""
        return {("low",): self.low, ("high",): self.high}


class Square(_Pulses):
    """`high` for the first part (`duty`) of each period, else `low`; before `start` it is `low`."""

    type: Literal["square"]
    duty: DutyCycle = 0.5
    """Part of the period from the beginning of the rise to the beginning of the fall."""

    def _faults(self) -> list[Fault]:
        return self._faults_of_rise(self.duty * self.period, "duty")

    def span(self, t: float) -> Span:
        """Return the span that contains time `t` [s]."""
        return self._span(t, self.duty * self.period, math.inf)


class PulseTrain(_Pulses):
    """`count` pulses of `width`, one each period; `low` before, between and after them."""

    type: Literal["pulse_train"]
    width: PositiveTime
    """From the beginning of the rise to the beginning of the fall."""
    count: Annotated[int, *whole(1)]
    """Of pulses."""

    def _faults(self) -> list[Fault]:
        if self.width >= self.period:
            return [(("width",), self.width, f"must be below `period` ({self.period:g} s)")]
        return self._faults_of_rise(self.width, "width")

    def span(self, t: float) -> Span:
        """Return the span that contains time `t` [s]."""
        return self._span(t, self.width, self.count)
