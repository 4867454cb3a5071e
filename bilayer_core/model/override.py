"""Values set from outside for a channel or a load in place of its schedule, at once or by a ramp.

A row of `State.override` has the value that is reached, and of a ramp from which value, from when and until when [s],
and 1 if it is smooth; the last three are 0 for a jump. Where a schedule acts, all are NaN. A smooth ramp is half a wave
of a cosine: it begins and ends at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bilayer_core.scene.spans import Span

Array = np.ndarray
VALUE, START, BEGIN, END, SMOOTHNESS = range(5)
PARTS = 5
"""Of a row."""


def no_overrides(count: int) -> Array:
    """Return the rows of so many channels and loads of which none is set, shape (count, 5)."""
    return np.full((count, PARTS), math.nan)


def jump_to(value: float | None) -> tuple[float, ...]:
    """Return a row that acts at once; without a value, a row that leaves the schedule in force."""
    return (math.nan,) * PARTS if value is None else (value, value, 0.0, 0.0, 0.0)


def ramp_to(value: float, start: float, begin: float, over: float, smooth: bool) -> tuple[float, ...]:
    """Return a row that leads from one value to another, in a time from `begin` on [s]."""
    return value, start, begin, begin + over, smooth


def acts(row: Sequence[float]) -> bool:
    """Return whether a row sets anything."""
    return not math.isnan(row[VALUE])


def spans_of(row: Sequence[float]) -> list[Span]:
    """Return an override as spans of a schedule: a ramp, if there is one, and the value that it reaches."""
    value, start, begin, end, smooth = row
    reached = Span(math.inf, value)
    if not end > begin:
        return [reached]
    if smooth:
        half, middle = 0.5 * (value - start), 0.5 * (value + start)
        return [Span(end, middle, begin, 0.0, half, math.pi / (end - begin), -0.5 * math.pi), reached]
    return [Span(end, start, begin, (value - start) / (end - begin)), reached]


def value_at(row: Sequence[float], time: float) -> float:
    """Return the value that is set at a time [s]; NaN if none is."""
    if not acts(row) or time >= row[END]:
        return row[VALUE]
    return spans_of(row)[0].value(time)
