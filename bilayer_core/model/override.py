"""Values set from outside for a channel or a load in place of its schedule, at once or by a ramp.

A row of `State.override` has the value that is reached, and of a ramp from which value, from when and until when [s];
the last two are 0 for a jump. Where a schedule acts, all are NaN.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bilayer_core.scene.spans import Span

Array = np.ndarray
VALUE, START, BEGIN, END = range(4)
PARTS = 4
"""Of a row."""


def no_overrides(count: int) -> Array:
    """Return the rows of so many channels and loads of which none is set, shape (count, 4)."""
    return np.full((count, PARTS), math.nan)


def jump_to(value: float | None) -> Array:
    """Return a row that acts at once; without a value, a row that leaves the schedule in force."""
    return np.full(PARTS, math.nan) if value is None else np.array([value, value, 0.0, 0.0])


def ramp_to(value: float, start: float, begin: float, over: float) -> Array:
    """Return a row that leads from one value to another, in a time from `begin` on [s]."""
    return np.array([value, start, begin, begin + over])


def acts(row: Sequence[float]) -> bool:
    """Return whether a row sets anything."""
    return not math.isnan(row[VALUE])


def spans_of(row: Sequence[float]) -> list[Span]:
    """Return an override as spans of a schedule: a ramp, if there is one, and the value that it reaches."""
    value, start, begin, end = row
    reached = Span(math.inf, value)
    return [Span(end, start, begin, (value - start) / (end - begin)), reached] if end > begin else [reached]


def value_at(row: Sequence[float], time: float) -> float:
    """Return the value that is set at a time [s]; NaN if none is."""
    spans = spans_of(row)
    return spans[-1 if time >= row[END] else 0].value(time)
