"""Stimulus over time, as a scene prescribes it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, Field, ValidationInfo

from bilayer_core.scene.faults import Fault
from bilayer_core.scene.part import Part
from bilayer_core.scene.spans import ROUNDING, Span, Spans
from bilayer_core.scene.table_file import TableFile, read_table_file
from bilayer_core.scene.units import NonNegativeTime, PlainNumber, PositiveTime, Time
from bilayer_core.scene.waveform import PulseTrain, Sine, Square


class Hold(Spans):
    """One value at all times."""

    type: Literal["hold"]
    held_value: PlainNumber = Field(alias="value")
    """In the unit of the channel."""

    def span(self, t: float) -> Span:
        """Return the only span."""
        return Span(math.inf, self.held_value)

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Return the values between which all others lie, by their keys."""
        return {("value",): self.held_value}


class Ramp(Spans):
    """From one value to another at a constant rate."""

    type: Literal["ramp"]
    start: Time
    """Until then `from`."""
    end: Time
    """From then on `to`."""
    from_value: PlainNumber = Field(alias="from")
    """In the unit of the channel."""
    to_value: PlainNumber = Field(alias="to")
    """In the unit of the channel."""

    def _faults(self) -> Iterator[Fault]:
        if self.end <= self.start:
            yield ("end",), self.end, f"must be later than `start` ({self.start:g} s)"

    def span(self, t: float) -> Span:
        """Return the span before, on, or after the ramp."""
        if t < self.start:
            return Span(self.start, self.from_value)
        if t < self.end:
            rate = (self.to_value - self.from_value) / (self.end - self.start)
            return Span(self.end, self.from_value, self.start, rate)
        return Span(math.inf, self.to_value)

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Return the values between which all others lie, by their keys."""
        return {("from",): self.from_value, ("to",): self.to_value}


class Table(Spans):
    """Values at given times, linear between them and constant outside."""

    type: Literal["table"]
    times: list[NonNegativeTime] = Field(min_length=1)
    """Increasing."""
    values: list[PlainNumber] = Field(min_length=1)
    """In the unit of the channel, as many as there are times."""

    def _faults(self) -> list[Fault]:
        return faults_of_times(self.times, ("values",), self.values)

    def span(self, t: float) -> Span:
        """Return the span between two of the times, before the first, or after the last."""
        right = bisect_right(self.times, t)
        if right == 0:
            return Span(self.times[0], self.values[0])
        before = self.values[right - 1]
        if right == len(self.times):
            return Span(math.inf, before)
        begin, until = self.times[right - 1 : right + 1]
        return Span(until, before, begin, (self.values[right] - before) / (until - begin))

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Return the values between which all others lie, by their keys."""
        return {("values", index): value for index, value in enumerate(self.values)}


class SequencePart(Part):
    """A part of a sequence."""

    duration: PositiveTime
    """After which the next part follows."""
    schedule: Schedule
    """Its time begins with the part."""


class Sequence(Spans):
    """Schedules one after the other; after the last, its value at its end, or from the beginning again."""

    type: Literal["sequence"]
    parts: list[SequencePart] = Field(min_length=1)
    """In their order."""
    repeat: bool = False
    """Whether it begins again after the last part."""

    def span(self, t: float) -> Span:
        """Return the span of the present part; the next part begins with a corner."""
        if t < 0.0:
            return Span(0.0, self.parts[0].schedule.value(0.0))
        total = sum(part.duration for part in self.parts)
        early = ROUNDING * total
        begin = math.floor(t / total + ROUNDING) * total if self.repeat else 0.0
        for part in self.parts:
            end = begin + part.duration
            if t < end - early:
                inside = part.schedule.span(max(t - begin, 0.0) + early).later(begin, end)
                return inside if inside.until < end - early else inside._replace(until=end)
            begin = end
        return Span(math.inf, part.schedule.value(part.duration))

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Return the values between which all others lie, by their keys."""
        return {
            ("parts", index, "schedule", *key): value
            for index, part in enumerate(self.parts)
            for key, value in part.schedule.points().items()
        }


def _as_table(schedule: BaseModel, info: ValidationInfo) -> BaseModel:
    """Return the table that a csv file holds, and any other schedule unchanged.

    A validated scene therefore needs no further file.
    """
    if not isinstance(schedule, TableFile):
        return schedule
    times, values = read_table_file(schedule, (info.context or {}).get("directory", ""))
    return Table(type="table", times=times, values=values)


Schedule = Annotated[
    Hold | Ramp | Table | Sine | Square | PulseTrain | Sequence | TableFile,
    Field(discriminator="type"),
    AfterValidator(_as_table),
]
SequencePart.model_rebuild()
Sequence.model_rebuild()


def faults_of_times(times: list[float], key: tuple[str], values: list) -> list[Fault]:
    """Return the faults of a list of times [s] that has to increase and to be as long as the list under `key`."""
    faults: list[Fault] = [
        (("times", index), after, f"must be later than the time before it ({before:g} s)")
        for index, (before, after) in enumerate(zip(times, times[1:], strict=False), start=1)
        if after <= before
    ]
    if len(times) != len(values):
        faults.append((key, f"{len(values)} entries", f"must be as many as `times`, {len(times)}"))
    return faults
