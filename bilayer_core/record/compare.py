"""What two runs differ by, quantity by quantity."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.record.log_reader import read_log
from bilayer_core.record.quantities import QUATERNION, Quantity
from bilayer_core.record.run_data import RunData

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
    """What two runs differ by.

    Attributes
    ----------
    differences : tuple of QuantityDifference
        Of the quantities that both have, in the order of the first run.
    only : tuple of tuple of str
        Quantities that only the first run has, and only the second one.
    span : tuple of float
        From when to when both have values [s].
    """

    differences: tuple[QuantityDifference, ...]
    only: tuple[tuple[str, ...], tuple[str, ...]]
    span: tuple[float, float]

    @property
    def equal(self) -> bool:
        """Whether all are the same, to the last bit that logs keep."""
        return not any(self.only) and all(found.largest == 0.0 for found in self.differences)

    def __getitem__(self, name: str) -> QuantityDifference:
        """The difference of a quantity."""
        return next(found for found in self.differences if found.name == name)

    def __repr__(self) -> str:
        worst = sorted(self.differences, key=lambda found: -found.part)[:5]
        told = ", ".join(f"{found.name} {found.largest:.3g} {found.unit}".rstrip() for found in worst)
        return "Comparison(equal)" if self.equal else f"Comparison({len(self.differences)} quantities; {told})"


def compare(first: RunData | str | Path, second: RunData | str | Path) -> Comparison:
    """Compare two runs, or logs, over the time that both have.

    Raises
    ------
    InputError
        If they have no time in common, or robots with other nodes.
    """
    one, other = (run if isinstance(run, RunData) else read_log(run) for run in (first, second))
    if not (one.times.size and other.times.size):
        raise InputError("compare: a run without frames has nothing to compare")
    begin, end = max(one.times[0], other.times[0]), min(one.times[-1], other.times[-1])
    if begin > end + SAME_TIME:
        raise InputError(
            f"compare: the runs have no time in common: t = {one.times[0]:g} to {one.times[-1]:g} s, and "
            f"{other.times[0]:g} to {other.times[-1]:g} s"
        )
    mine, others = one.quantities, other.quantities
    both = [name for name in mine if name in others and name not in OF_MACHINE]
    return Comparison(
        tuple(_compared(mine[name], others[name], begin, end) for name in both),
        (tuple(name for name in mine if name not in others), tuple(name for name in others if name not in mine)),
        (float(begin), float(end)),
    )


def _compared(one: Quantity, other: Quantity, begin: float, end: float) -> QuantityDifference:
    if one.values.shape[1:] != other.values.shape[1:]:
        raise InputError(
            f"compare: {one.name} has shape {one.values.shape[1:]} in one run and {other.values.shape[1:]} in the other"
        )
    mine, others = _within(one, begin, end), _within(other, begin, end)
    if one.labels == QUATERNION and len(mine[0]) == len(others[0]):  # q and −q are one rotation
        sign = np.sign(np.sum(mine[1] * others[1], axis=-1, keepdims=True))
        others = others[0], np.where(sign < 0.0, -1.0, 1.0) * others[1]
    interpolated = len(mine[0]) != len(others[0]) or not np.allclose(mine[0], others[0], rtol=0.0, atol=SAME_TIME)
    if interpolated:
        others = mine[0], _interpolated(other, mine[0])
    with np.errstate(invalid="ignore"):
        apart = np.abs(mine[1].astype(float) - others[1].astype(float)).reshape(len(mine[0]), -1)
    apart = np.where(np.isnan(apart), 0.0, apart)  # where nothing can meet, the gap is infinite in both
    if not apart.size:
        return QuantityDifference(one.name, one.unit, 0.0, float(begin), 0.0, interpolated)
    row = int(apart.max(axis=1).argmax())
    largest, values = float(apart[row].max()), one.values[np.isfinite(one.values)]
    extent = float(np.ptp(values)) if values.size else 0.0
    part = largest / extent if extent else (0.0 if largest == 0.0 else np.inf)
    return QuantityDifference(one.name, one.unit, largest, float(mine[0][row]), part, interpolated)


def _within(quantity: Quantity, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    inside = (quantity.times >= begin - SAME_TIME) & (quantity.times <= end + SAME_TIME)
    return quantity.times[inside], quantity.values[inside]


def _interpolated(quantity: Quantity, times: np.ndarray) -> np.ndarray:
    """Its values at other times."""
    flat = quantity.values.reshape(len(quantity.times), -1)
    columns = [np.interp(times, quantity.times, column) for column in flat.T]
    return np.stack(columns, axis=1).reshape(len(times), *quantity.values.shape[1:])


def rows(found: Comparison) -> Iterator[tuple[str, str, str, str]]:
    """Name, difference with unit, part of the range, and time of each quantity, the largest part first."""
    for of in sorted(found.differences, key=lambda of: -of.part):
        note = "  (interpolated)" if of.interpolated else ""
        yield of.name, f"{of.largest:.3g} {of.unit}".rstrip(), f"{of.part:.2g}", f"{of.time:g} s{note}"
