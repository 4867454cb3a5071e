"""Numerical noise of runs, and the steps over which differences are taken.

Adaptive steps, iterations that stop at a tolerance and above all contact make a run a rough function of its
parameters: smooth pieces, and jumps where another step is accepted. A difference over too short a step sees the slope
of one piece, or a jump divided by next to nothing. How rough it is follows from differences of high order over a
table of values at equal spacings [1]: each difference wipes out one more order of what is smooth, and of noise of
standard deviation ε the k-th has the variance (2k)!/(k!)² ε².

Roughness depends on the spacing: the wider it is, the more jumps it sees. So tables are made from the widest spacing
down, as long as the error ε/δ of a slope over the spacing δ gets smaller; where noise rules, it grows. The central
difference over h then has the error ε/h + |f‴| h²/6, smallest at h = (3 ε/|f‴|)^(1/3), as in [2].

[1] R. W. Hamming, Introduction to Applied Numerical Analysis (1971), ch. 6; J. J. Moré and S. M. Wild, Estimating
computational noise, SIAM J. Sci. Comput. 33 (2011), 1292.
[2] J. J. Moré and S. M. Wild, Estimating derivatives of noisy simulations, ACM Trans. Math. Softw. 38 (2012), 19.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, sqrt

import numpy as np

from bilayer_core.fitting.runs import Runs

Array = np.ndarray
SPACINGS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Of tables, in parts of the way between the bounds, from the widest down."""
HALF = 3
"""Values of a table on each side of its middle: sixth differences, the order that [1] recommends as the least."""
AROUND = 10.0
"""A step is at most this factor away from the spacing at which the noise was measured."""
LARGEST_STEP = 0.1
"""Part of the way between the bounds."""
SEEN = 2.0
"""How much larger third differences must be than noise makes them, to tell of a third derivative."""
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


def choose_steps(runs: Runs, start: Array, weights: Array) -> list[Step]:
    """The step of each parameter.

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
    best: list[Step | None] = [None] * start.size
    errors = np.full(start.size, np.inf)
    sought = list(range(start.size))
    for spacing in SPACINGS:
        tables = {k: _table(start, k, spacing) for k in sought}
        values = iter(runs.demand([point for k in sought for point in tables[k]]))
        for k in list(sought):
            found = _of_table(np.array([next(values) for _ in tables[k]]), spacing, weights)
            if found.noise / spacing >= errors[k]:
                sought.remove(k)
                continue
            best[k], errors[k] = found, found.noise / spacing
    return [step for step in best if step is not None]


def _table(start: Array, k: int, spacing: float) -> list[Array]:
    """Points in a row along a parameter, about the start as far as bounds allow."""
    middle = float(np.clip(start[k], HALF * spacing, 1.0 - HALF * spacing))
    points = []
    for j in range(-HALF, HALF + 1):
        point = start.copy()
        point[k] = middle + j * spacing
        points.append(point)
    return points


def _of_table(values: Array, spacing: float, weights: Array) -> Step:
    """Noise and step from a table, shape (points, times, columns)."""
    present = weights > 0.0
    table = values[:, present] * weights[present]
    digits = DIGITS * _root_mean_square(table)
    noise = max(_noise(table, 2 * HALF), digits)
    third = _third_derivative(table, spacing, noise)
    longest = min(AROUND * spacing, LARGEST_STEP)
    step = min(max((3.0 * noise / third) ** (1.0 / 3.0), spacing / AROUND), longest) if third > 0.0 else longest
    return Step(step, noise, noise / step + third * step**2 / 6.0)


def _third_derivative(table: Array, spacing: float, noise: float) -> float:
    """Size of the third derivative; 0 where third differences are no larger than noise makes them."""
    found = _root_mean_square(np.diff(table, n=3, axis=0))
    of_noise = noise * sqrt(comb(6, 3))
    return sqrt(found**2 - of_noise**2) / spacing**3 if found > SEEN * of_noise else 0.0


def _noise(table: Array, order: int) -> float:
    """Standard deviation of noise by differences of an order."""
    return _root_mean_square(np.diff(table, n=order, axis=0)) / sqrt(comb(2 * order, order))


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def shares(steps: Sequence[Step], count: int) -> Array:
    """Size of the error of each column of a Jacobian with `count` rows, shape (parameters,)."""
    return np.array([step.error for step in steps]) * sqrt(count)
