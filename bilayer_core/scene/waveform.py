"""Stimuli that repeat: sine, square wave, pulse train. The phase is found anew at each time, so it does not drift."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict, model_validator

from bilayer_core.scene.faults import Fault, refuse_all
from bilayer_core.scene.units import Angle, DutyCycle, NonNegativeTime, PlainNumber, PositiveTime, Time, whole

ROUNDING = 1e-9
"""Part of a period by which a wave switches early, so that rounding of the time never delays it by a step."""


class Sine(BaseModel):
    """``mean + amplitude sin(2π (t − start)/period + phase)``; before `start` its value there."""

    model_config = ConfigDict(frozen=True, extra="forbid")

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

    def value(self, t: float) -> float:
        """Value at time `t` [s], in the unit of the channel."""
        turns = max(t - self.start, 0.0) / self.period
        return self.mean + self.amplitude * math.sin(2.0 * math.pi * math.fmod(turns, 1.0) + self.phase)

    def breakpoint_after(self, t: float) -> float:
        """The start, then every quarter of a period after `t` [s]: a longer step would not see the wave."""
        quarter = self.period / 4.0
        return self.start + quarter * max(math.floor((t - self.start) / quarter + ROUNDING) + 1.0, 0.0)

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Values between which all others lie, by their keys."""
        return {
            ("mean + amplitude",): self.mean + self.amplitude,
            ("mean - amplitude",): self.mean - self.amplitude,
        }


class _Pulses(BaseModel):
    """From `low` to `high` at the beginning of each period, and back; at once, or linearly over `rise_time`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

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

    def _value(self, t: float, width: float, last: float) -> float:
        """Value at time `t` of pulses that begin to fall after `width` [s]; they end after `last` periods."""
        cycles = (t - self.start) / self.period + ROUNDING
        if not 0.0 <= cycles < last:
            return self.low
        elapsed = math.fmod(cycles, 1.0) * self.period
        up = self._part(elapsed)
        part = up - self._part(elapsed - width) if elapsed >= width else up
        return (1.0 - part) * self.low + part * self.high

    def _breakpoint_after(self, t: float, width: float, last: float) -> float:
        """First corner or jump after `t` [s] of pulses that begin to fall after `width` [s], infinity if none."""
        cycle = max(math.floor((t - self.start) / self.period + ROUNDING), 0.0)
        while cycle < last:
            begin = self.start + cycle * self.period
            for flank in (0.0, width):
                for corner in (begin + flank, begin + flank + self.rise_time):
                    if corner > t + ROUNDING * self.period:
                        return corner
            cycle += 1.0
        return math.inf

    def _part(self, elapsed: float) -> float:
        """How far a change has got that began `elapsed` before."""
        if elapsed >= self.rise_time:
            return 1.0
        return max(elapsed - ROUNDING * self.period, 0.0) / self.rise_time

    def _faults(self, width: float, where: str) -> list[Fault]:
        """Whether both flanks fit into the period."""
        room = min(width, self.period - width)
        if self.rise_time <= room * (1.0 + ROUNDING):
            return []
        demand = f"must be at most {room:g} s: both flanks have to fit with `period` and `{where}`"
        return [(("rise_time",), self.rise_time, demand)]

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Values between which all others lie, by their keys."""
        return {("low",): self.low, ("high",): self.high}


class Square(_Pulses):
    """`high` for the first part (`duty`) of each period, else `low`; before `start` it is `low`."""

    type: Literal["square"]
    duty: DutyCycle = 0.5
    """Part of the period from the beginning of the rise to the beginning of the fall."""

    @model_validator(mode="after")
    def _check(self) -> Square:
        refuse_all("Square", self._faults(self.duty * self.period, "duty"))
        return self

    def value(self, t: float) -> float:
        """Value at time `t` [s], in the unit of the channel."""
        return self._value(t, self.duty * self.period, math.inf)

    def breakpoint_after(self, t: float) -> float:
        """First corner or jump after `t` [s]."""
        return self._breakpoint_after(t, self.duty * self.period, math.inf)


class PulseTrain(_Pulses):
    """`count` pulses of `width`, one each period; `low` before, between and after them."""

    type: Literal["pulse_train"]
    width: PositiveTime
    """From the beginning of the rise to the beginning of the fall."""
    count: whole(1)
    """Of pulses."""

    @model_validator(mode="after")
    def _check(self) -> PulseTrain:
        if self.width >= self.period:
            refuse_all("PulseTrain", [(("width",), self.width, f"must be below `period` ({self.period:g} s)")])
        refuse_all("PulseTrain", self._faults(self.width, "width"))
        return self

    def value(self, t: float) -> float:
        """Value at time `t` [s], in the unit of the channel."""
        return self._value(t, self.width, self.count)

    def breakpoint_after(self, t: float) -> float:
        """First corner or jump after `t` [s], infinity if there is none."""
        return self._breakpoint_after(t, self.width, self.count)
