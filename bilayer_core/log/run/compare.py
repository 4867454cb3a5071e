"""Differences between two runs, quantity by quantity; of logs, some megabytes are in memory at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.run.log_reader import read_log
from bilayer_core.log.run.quantities import QUATERNION, Entry
from bilayer_core.log.run.recorded import Recorded

Array = np.ndarray
SAME_TIME = 1e-9
"""Two times that differ by less are one [s]: logs count nanoseconds."""
OF_MACHINE = ("solver/cpu_time",)
"""Quantities that say nothing of the motion."""


@dataclass(frozen=True)
class QuantityDifference:
    """The largest difference of one quantity.

    Attributes
    ----------
    name, unit : str
    largest : float
        In the unit.
    time : float
        When [s].
    part : float
        Of the range of its values in the first run; infinite if that is zero and they differ.
    interpolated : bool
        Whether the second run has other times, between which it was interpolated linearly.
    """

    name: str
    unit: str
    largest: float
    time: float
    part: float
    interpolated: bool


@dataclass(frozen=True)
class Comparison:
    """Differences between two runs.

    Attributes
    ----------
    differences : tuple of QuantityDifference
        Of the quantities that both have, in the order of the first run.
    only : tuple of tuple of str
        Quantities that only the first run has, and only the second one.
    span : tuple of float
        From when to when both have values [s].
    spans : tuple of tuple of float
        From when to when the first has, and the second one.
    """

    differences: tuple[QuantityDifference, ...]
    only: tuple[tuple[str, ...], tuple[str, ...]]
    span: tuple[float, float]
    spans: tuple[tuple[float, float], tuple[float, float]]

    @property
    def equal(self) -> bool:
        """True if both are as long and all quantities are the same, to the last bit that logs keep."""
        return self.as_long and not any(self.only) and all(found.largest == 0.0 for found in self.differences)

    @property
    def as_long(self) -> bool:
        """True if both begin and end at the same times."""
        return all(abs(mine - other) <= SAME_TIME for mine, other in zip(*self.spans, strict=True))

    def __getitem__(self, name: str) -> QuantityDifference:
        """Return the difference of a quantity.

        Parameters
        ----------
        name : str
            Such as ``com``.

        Returns
        -------
        QuantityDifference
        """
        return next(found for found in self.differences if found.name == name)

    def __repr__(self) -> str:
        worst = sorted(self.differences, key=lambda found: -found.part)[:5]
        told = ", ".join(f"{found.name} {found.largest:.3g} {found.unit}".rstrip() for found in worst)
        return "Comparison(equal)" if self.equal else f"Comparison({len(self.differences)} quantities; {told})"


def compare(first: Recorded | str | Path, second: Recorded | str | Path) -> Comparison:
    """Compare two runs, or logs, over the time that both have.

    Parameters
    ----------
    first, second : Recorded, str or Path
        A run, or the path of its log.

    Returns
    -------
    Comparison
        The largest difference of each quantity that both have.

    Raises
    ------
    InputError
        If they have no time in common, or robots with other nodes.
    """
    one, other = (run if isinstance(run, Recorded) else read_log(run) for run in (first, second))
    names = [
        f"the {place} run" if isinstance(run, Recorded) else str(run)
        for run, place in ((first, "first"), (second, "second"))
    ]
    for run, name in zip((one, other), names, strict=True):
        if not run.times.size:
            raise InputError(f"compare: {name} has no frames, so there is nothing to compare")
        if any((np.diff(times) < 0.0).any() for times in (run.times, run.shape_times)):
            raise InputError(f"compare: the times of {name} go back, so its frames cannot be found by their times")
    begin, end = max(one.times[0], other.times[0]), min(one.times[-1], other.times[-1])
    if begin > end + SAME_TIME:
        spans = (
            f"{name} t = {run.times[0]:g} to {run.times[-1]:g} s" for run, name in zip((one, other), names, strict=True)
        )
        raise InputError(f"compare: the runs have no time in common: {', '.join(spans)}")
    mine, others = one.entries(), other.entries()
    both = [name for name in mine if name in others and name not in OF_MACHINE]
    found: dict[str, QuantityDifference] = {}
    for of_shape in (False, True):
        names = [name for name in both if mine[name].of_shape is of_shape]
        found |= _compared(_Rows(one, mine, names), _Rows(other, others, names), begin, end)
    return Comparison(
        tuple(found[name] for name in both),
        (tuple(name for name in mine if name not in others), tuple(name for name in others if name not in mine)),
        (float(begin), float(end)),
        (_span(one), _span(other)),
    )


def _span(run: Recorded) -> tuple[float, float]:
    """Return from when to when a run has frames [s]."""
    return float(run.times[0]), float(run.times[-1])


class _Rows:
    """Rows of quantities of a run that come at one rate, read one after the other: a window of them is in memory."""

    def __init__(self, run: Recorded, entries: Mapping[str, Entry], names: Sequence[str]):
        self.entries = [entries[name] for name in names]
        of_shape = bool(self.entries) and self.entries[0].of_shape
        self.times = run.shape_times if of_shape else run.times
        self._blocks = run.blocks(self.entries)
        self._begin = 0
        self._held: dict[str, list[Array]] = {name: [] for name in names}
        self._end = 0

    def blocks(self) -> Iterator[tuple[slice, dict[str, Array]]]:
        """Return all rows, as they are read."""
        return self._blocks

    def window(self, begin: int, end: int) -> dict[str, Array]:
        """Return the rows from `begin` to `end`, neither of which ever decreases."""
        while self._end < end:
            rows, block = next(self._blocks)
            for name, values in block.items():
                self._held[name].append(values)
            self._end = rows.stop
        found = {}
        for name, parts in self._held.items():
            whole = parts[0] if len(parts) == 1 else np.concatenate(parts)
            found[name] = whole[begin - self._begin : end - self._begin]
            self._held[name] = [whole[begin - self._begin :]]
        self._begin = begin
        return found


class _Largest:
    """The largest difference of a quantity so far."""

    def __init__(self, entry: Entry):
        self.entry = entry
        self.value = 0.0
        self.time: float | None = None
        self.least, self.most = np.inf, -np.inf

    def see_range(self, values: Array) -> None:
        """Note the range of the first run."""
        finite = values[np.isfinite(values)]
        if finite.size:
            self.least, self.most = min(self.least, float(finite.min())), max(self.most, float(finite.max()))

    def see(self, times: Array, one: Array, other: Array) -> None:
        """Compare rows at the same times."""
        if one.shape[1:] != other.shape[1:]:
            raise InputError(
                f"compare: {self.entry.name} has shape {one.shape[1:]} in one run and {other.shape[1:]} in the other"
            )
        if self.entry.labels == QUATERNION:
            other = _turned_to(one, other)
        with np.errstate(invalid="ignore"):
            apart = np.abs(one.astype(float) - other.astype(float)).reshape(len(times), -1)
        apart = np.where(np.isnan(apart), 0.0, apart)  # where nothing can meet, the gap is infinite in both
        if apart.size and (self.time is None or apart.max() > self.value):
            row = int(apart.max(axis=1).argmax())
            self.value, self.time = float(apart[row].max()), float(times[row])

    def told(self, begin: float, interpolated: bool) -> QuantityDifference:
        """Return the largest difference, with its time and its part of the first run's range."""
        extent = max(0.0, self.most - self.least)
        part = self.value / extent if extent else (0.0 if self.value == 0.0 else np.inf)
        time = float(begin) if self.time is None else self.time
        return QuantityDifference(self.entry.name, self.entry.unit, self.value, time, part, bool(interpolated))


def _compared(one: _Rows, other: _Rows, begin: float, end: float) -> dict[str, QuantityDifference]:
    """Return the differences of quantities that come at one rate, over a span of time [s]."""
    found = {entry.name: _Largest(entry) for entry in one.entries}
    if not found:
        return {}
    first, last = np.searchsorted(one.times, (begin - SAME_TIME, end + SAME_TIME))
    other_first, other_last = np.searchsorted(other.times, (begin - SAME_TIME, end + SAME_TIME))
    interpolated = last - first != other_last - other_first or not np.allclose(
        one.times[first:last], other.times[other_first:other_last], rtol=0.0, atol=SAME_TIME
    )
    for rows, block in one.blocks():
        inside = slice(max(rows.start, first), min(rows.stop, last))
        for name, values in block.items():
            found[name].see_range(values)
        if inside.start >= inside.stop or not len(other.times):
            continue
        times = one.times[inside]
        if interpolated:
            others = _interpolated(other, times)
        else:
            shift = int(other_first - first)
            others = other.window(inside.start + shift, inside.stop + shift)
        for name, values in block.items():
            found[name].see(times, values[inside.start - rows.start : inside.stop - rows.start], others[name])
    return {name: largest.told(begin, interpolated) for name, largest in found.items()}


def _interpolated(of: _Rows, times: Array) -> dict[str, Array]:
    """Return the values at other times, linear between rows; before the first and after the last, those."""
    last = len(of.times) - 1
    left = np.clip(np.searchsorted(of.times, times, side="right") - 1, 0, max(0, last - 1))
    right = np.minimum(left + 1, last)
    span = of.times[right] - of.times[left]
    part = np.clip((times - of.times[left]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
    window = of.window(int(left[0]), int(right[-1]) + 1)
    found = {}
    for entry in of.entries:
        held = window[entry.name].astype(float)
        before, after = held[left - left[0]], held[right - left[0]]
        if entry.labels == QUATERNION:
            after = _turned_to(before, after)
        weight = part.reshape(-1, *[1] * (before.ndim - 1))
        with np.errstate(invalid="ignore"):
            found[entry.name] = np.where(weight > 0.0, before + weight * (after - before), before)
    return found


def _turned_to(one: Array, other: Array) -> Array:
    """Return the quaternions with the sign that is nearer to others: q and −q are one rotation."""
    if one.shape != other.shape:
        return other
    return np.where(np.sum(one * other, axis=-1, keepdims=True) < 0.0, -other, other)


def rows(found: Comparison) -> Iterator[tuple[str, str, str, str]]:
    """Return the name, difference with unit, part of the range, and time of each quantity, the largest part first."""
    for of in sorted(found.differences, key=lambda of: -of.part):
        note = "  (interpolated)" if of.interpolated else ""
        yield of.name, f"{of.largest:.3g} {of.unit}".rstrip(), f"{of.part:.2g}", f"{of.time:g} s{note}"
