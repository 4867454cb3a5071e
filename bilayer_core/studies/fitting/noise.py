"""Numerical noise of runs, and the steps over which differences are taken.

Adaptive steps, iterations that stop at a tolerance and above all contact make a run a rough function of its
parameters: smooth pieces, and jumps where another step is accepted. A difference over too short a step sees the slope
of one piece, or a jump divided by next to nothing. How rough it is follows from differences of high order over a
table of values at equal spacings [1]: each difference wipes out one more order of what is smooth, and of noise of
standard deviation ε the k-th has the variance (2k)!/(k!)² ε².

Roughness depends on the spacing: the wider it is, the more jumps it sees. So tables are made from the widest spacing
down, as long as the error ε/δ of a slope over the spacing δ gets smaller; where noise rules, it grows. The central
difference over h then has the error ε/h + |f‴| h²/6, smallest at h = (3 ε/|f‴|)^(1/3), as in [2]. Where noise hides
third differences in a table, they are taken over wider spacings; what noise leaves of them is a bound of |f‴|.

[1] R. W. Hamming, Introduction to Applied Numerical Analysis (1971), ch. 6; J. J. Moré and S. M. Wild, Estimating
computational noise, SIAM J. Sci. Comput. 33 (2011), 1292.
[2] J. J. Moré and S. M. Wild, Estimating derivatives of noisy simulations, ACM Trans. Math. Softw. 38 (2012), 19.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb, sqrt

import numpy as np

from bilayer_core.errors import BilayerError
from bilayer_core.studies.fitting.runs import Runs

Array = np.ndarray
SPACINGS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Of tables, in parts of the way between the bounds, from the widest down."""
TABLE = (-3, -2, -1, 0, 1, 2, 3)
"""Places of a table: sixth differences, the order that [1] recommends as the least."""
WIDER = (3.0, 10.0)
"""Times the spacing of a table, at which third differences are taken where noise hides them in the table."""
AROUND = 10.0
"""A step is at most this factor below the spacing at which the noise was measured."""
LARGEST_STEP = 0.1
"""Part of the way between the bounds."""
ENOUGH, LEVEL = 1e-4, 4.0
"""Noise over the changes in a table, and how many times as large fourth and fifth differences tell it at most [1], for
which no finer table is made."""
SEEN = 4.0
"""How much larger third differences must be than noise makes them, to tell a third derivative."""
DIGITS = 4.0 * float(np.finfo(float).eps)
"""Relative noise of numbers that are right to the last digits."""


@dataclass(frozen=True)
class Step:
    """How a derivative by one parameter is taken.

    Attributes
    ----------
    step : float
        h, in parts of the way between the bounds.
    noise : float
        ε of a weighted residual, root mean square over all.
    error : float
        Of a derivative of a weighted residual, likewise, by noise and by the length of the step.
    """

    step: float
    noise: float
    error: float


@dataclass(frozen=True)
class _Roughness:
    """Roughness of a table: its spacing, the noise, and the size of the third derivative or a bound of it."""

    spacing: float
    noise: float
    third: float
    resolved: bool
    is_enough: bool

    def step(self) -> Step:
        """Return the step with the smallest error."""
        step = LARGEST_STEP
        if self.third > 0.0:
            step = min(max((3.0 * self.noise / self.third) ** (1.0 / 3.0), self.spacing / AROUND), LARGEST_STEP)
        return Step(step, self.noise, self.noise / step + self.third * step**2 / 6.0)


def choose_steps(runs: Runs, start: Array, weights: Array) -> list[Step]:
    """Choose the step of each parameter.

    Parameters
    ----------
    runs : Runs
    start : ndarray
        Where, shape (parameters,).
    weights : ndarray
        Of residuals, 0 where data are missing, shape (times, columns).

    Raises
    ------
    BilayerError
        If a run near the start cannot be made.
    """
    best: dict[int, _Roughness] = {}
    sought = list(range(start.size))
    for spacing in SPACINGS:
        rows = {k: _row(start, k, spacing, TABLE) for k in sought}
        values = iter(runs.demand([point for row in rows.values() for point in row]))
        for k, row in rows.items():
            found = _of_table(np.array([next(values) for _ in row]), spacing, weights)
            is_rougher = k in best and found.noise / spacing >= best[k].noise / best[k].spacing
            if not is_rougher:
                best[k] = found
            if is_rougher or found.is_enough:
                sought.remove(k)
    return [_with_third(runs, start, k, best[k], weights).step() for k in range(start.size)]


def _row(start: Array, k: int, spacing: float, places: Sequence[int]) -> list[Array]:
    """Return the points in a row along a parameter, about the start as far as bounds allow."""
    middle = float(np.clip(start[k], max(places) * spacing, 1.0 - max(places) * spacing))
    points = []
    for place in places:
        point = start.copy()
        point[k] = middle + place * spacing
        points.append(point)
    return points


def _of_table(values: Array, spacing: float, weights: Array) -> _Roughness:
    """Return the roughness of a table of shape (points, times, columns)."""
    table = _weighted(values, weights)
    orders = range(len(TABLE) - 1, len(TABLE) - 4, -1)
    levels = [_root_mean_square(np.diff(table, n=n, axis=0)) / sqrt(comb(2 * n, n)) for n in orders]
    noise = max(levels[0], DIGITS * _root_mean_square(table))
    is_enough = max(levels) <= LEVEL * noise <= LEVEL * ENOUGH * _root_mean_square(np.diff(table, axis=0))
    third = _root_mean_square(np.diff(table, n=3, axis=0))
    return _Roughness(spacing, noise, third / spacing**3, third > SEEN * sqrt(comb(6, 3)) * noise, is_enough)


def _with_third(runs: Runs, start: Array, k: int, found: _Roughness, weights: Array) -> _Roughness:
    """Return the roughness with a third derivative from wider spacings, as long as noise rules it: by noise it falls as
    the cube of them.
    """
    for wider in WIDER:
        spacing = wider * found.spacing
        if found.resolved or spacing > LARGEST_STEP:
            break
        outcomes = runs.evaluate_many(_row(start, k, spacing, (-2, -1, 1, 2)))
        values = [outcome for outcome in outcomes if not isinstance(outcome, BilayerError)]
        if len(values) < len(outcomes):
            break
        outer_left, left, right, outer_right = _weighted(np.array(values), weights)
        twice = _root_mean_square(outer_right - 2.0 * right + 2.0 * left - outer_left)
        third = twice / (2.0 * spacing**3)
        if third >= found.third:
            break
        found = replace(found, third=third, resolved=twice > SEEN * sqrt(10.0) * found.noise)
    return found


def _weighted(values: Array, weights: Array) -> Array:
    """Return the values that are compared with data, weighted, shape (points, residuals)."""
    present = weights > 0.0
    found: Array = values[:, present] * weights[present]
    return found


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def shares(steps: Sequence[Step], count: int) -> Array:
    """Return the size of the error of each column of a Jacobian with `count` rows, shape (parameters,)."""
    return np.array([step.error for step in steps]) * sqrt(count)
