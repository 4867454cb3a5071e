"""Blocks of numbered things that follow each other, which kernels take together."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.records.parts import TOGETHER

Array = np.ndarray


def blocks(*numbers: Array) -> Array:
    """Return for each block the place of its first, the numbers of that, and how many there are: within it, all numbers
    count up by one.
    """
    table = np.stack(numbers, axis=1)
    ends = np.flatnonzero(np.any(np.diff(table, axis=0) != 1, axis=1)) + 1
    runs = np.split(np.arange(len(table)), ends)
    firsts = [(first, min(TOGETHER, run[-1] + 1 - first)) for run in runs for first in run[::TOGETHER]]
    return np.array([[first, *table[first], count] for first, count in firsts], dtype=np.int64)
