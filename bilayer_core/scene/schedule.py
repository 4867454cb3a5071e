"""Stimulus over time, as a scene prescribes it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from bilayer_core.scene.faults import Fault, refuse_all
from bilayer_core.scene.table_file import TableFile, read_table_file
from bilayer_core.scene.units import NonNegativeTime, PlainNumber, PositiveTime, Time
from bilayer_core.scene.waveform import ROUNDING, PulseTrain, Sine, Square


class Hold(BaseModel):
    """One value at all times."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    type: Literal["hold"]
    held_value: PlainNumber = Field(alias="value")
    """In the unit of the channel."""

    def value(self, t: float) -> float:
        """Value at time `t` [s], in the unit of the channel."""
        return self.held_value

    def breakpoint_after(self, t: float) -> float:
        """First corner or jump after `t` [s]: there is none, which is infinity."""
        return math.inf

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Values between which all others lie, by their keys."""
        return {("value",): self.held_value}


class Ramp(BaseModel):
    """From one value to another at a constant rate."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    type: Literal["ramp"]
    start: Time
    """Until then `from`."""
    end: Time
    """From then on `to`."""
    from_value: PlainNumber = Field(alias="from")
    """In the unit of the channel."""
    to_value: PlainNumber = Field(alias="to")
    """In the unit of the channel."""

    @model_validator(mode="after")
    def _check(self) -> Ramp:
        if self.end <= self.start:
            refuse_all("Ramp", [(("end",), self.end, f"must be later than `start` ({self.start:g} s)")])
        return self

    def value(self, t: float) -> float:
        """Value at time `t` [s], in the unit of the channel."""
        part = min(max((t - self.start) / (self.end - self.start), 0.0), 1.0)
        return (1.0 - part) * self.from_value + part * self.to_value

    def breakpoint_after(self, t: float) -> float:
        """First corner after `t` [s], infinity if there is none."""
        return first_after(t, (self.start, self.end))

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Values between which all others lie, by their keys."""
        return {("from",): self.from_value, ("to",): self.to_value}


class Table(BaseModel):
    """Values at given times, linear between them and constant outside."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    type: Literal["table"]
    times: list[NonNegativeTime] = Field(min_length=1)
    """Increasing."""
    values: list[PlainNumber] = Field(min_length=1)
    """In the unit of the channel, as many as there are times."""

    @model_validator(mode="after")
    def _check(self) -> Table:
        refuse_all("Table", faults_of_times(self.times, ("values",), self.values))
        return self

    def value(self, t: float) -> float:
        """Value at time `t` [s], in the unit of the channel."""
        right = bisect_right(self.times, t)
        if right == 0:
            return self.values[0]
        if right == len(self.times):
            return self.values[-1]
        before, after = self.times[right - 1], self.times[right]
        part = (t - before) / (after - before)
        return (1.0 - part) * self.values[right - 1] + part * self.values[right]

    def breakpoint_after(self, t: float) -> float:
        """First corner after `t` [s], infinity if there is none."""
        return first_after(t, self.times)

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Values between which all others lie, by their keys."""
        return {("values", index): value for index, value in enumerate(self.values)}


class SequencePart(BaseModel):
    """A part of a sequence."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    duration: PositiveTime
    """After which the next part follows."""
    schedule: Schedule
    """Its time begins with the part."""


class Sequence(BaseModel):
    """Schedules one after the other; after the last, its value at its end, or from the beginning again."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    type: Literal["sequence"]
    parts: list[SequencePart] = Field(min_length=1)
    """In their order."""
    repeat: bool = False
    """Whether it begins again after the last part."""

    def value(self, t: float) -> float:
        """Value at time `t` [s], in the unit of the channel."""
        total = sum(part.duration for part in self.parts)
        elapsed = max(t, 0.0) + ROUNDING * total
        if self.repeat:
            elapsed %= total
        for part in self.parts[:-1]:
            if elapsed < part.duration:
                break
            elapsed -= part.duration
        else:
            part = self.parts[-1]
        return part.schedule.value(min(max(elapsed - ROUNDING * total, 0.0), part.duration))

    def breakpoint_after(self, t: float) -> float:
        """First corner or jump after `t` [s], infinity if there is none: those of the parts, and where a part ends."""
        if t < 0.0:
            return 0.0
        total = sum(part.duration for part in self.parts)
        cycle = math.floor(t / total + ROUNDING) if self.repeat else 0
        begin, early = cycle * total, ROUNDING * total
        for part in self.parts:
            end = begin + part.duration
            if t < end - early:
                inside = begin + part.schedule.breakpoint_after(t - begin + early)
                return inside if inside < end - early else end
            begin = end
        return math.inf

    def points(self) -> dict[tuple[str | int, ...], float]:
        """Values between which all others lie, by their keys."""
        return {
            ("parts", index, "schedule", *key): value
            for index, part in enumerate(self.parts)
            for key, value in part.schedule.points().items()
        }


def _as_table(schedule: BaseModel, info: ValidationInfo) -> BaseModel:
    """The table that a csv file holds, any other schedule as it is: a validated scene needs no further file."""
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
    """Faults of a list of times [s] that has to increase and to be as long as the list under `key`."""
    faults: list[Fault] = [
        (("times", index), after, f"must be later than the time before it ({before:g} s)")
        for index, (before, after) in enumerate(zip(times, times[1:], strict=False), start=1)
        if after <= before
    ]
    if len(times) != len(values):
        faults.append((key, f"{len(values)} entries", f"must be as many as `times`, {len(times)}"))
    return faults


def first_after(t: float, times: list[float] | tuple[float, ...]) -> float:
    """The first of increasing times after `t` [s], infinity if there is none."""
    place = bisect_right(times, t)
    return times[place] if place < len(times) else math.inf


NEARLY = 1e-3
"""Part of a step by which a value is taken before its end to see a jump there; more than the early switch of waves."""
JUMP = 1e3
"""Ratio of two successive changes from which the second is a jump."""


def value_before(value: Callable[[float], float], t: float, h: float) -> float:
    """Value at the end `t` [s] of a step of length `h` [s]: the limit from within the step where it jumps at `t`.

    A step that ends at a jump has its own value to its end; the next one begins with the new value.
    """
    here, before, earlier = value(t), value(t - NEARLY * h), value(t - 2.0 * NEARLY * h)
    if abs(here - before) > JUMP * abs(before - earlier):
        return 2.0 * before - earlier
    return here
