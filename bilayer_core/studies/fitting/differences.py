"""Derivatives of runs by their parameters, as differences.

Central ones, (f(u + h) − f(u − h))/2h, where both runs can be made within the bounds; else of second order to one
side, (−3 f(u) + 4 f(u ± h) − f(u ± 2h))/(±2h).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bilayer_core.errors import BilayerError
from bilayer_core.studies.fitting.noise import Step
from bilayer_core.studies.fitting.runs import Runs

Array = np.ndarray


def jacobian(runs: Runs, point: Array, steps: Sequence[Step]) -> Array:
    """Return the derivatives of all values.

    Parameters
    ----------
    runs : Runs
    point : ndarray
        Where, in parts of the way between bounds, shape (parameters,).
    steps : sequence of Step

    Returns
    -------
    ndarray
        In SI units for the whole way between the bounds, shape (times, columns, parameters).

    Raises
    ------
    BilayerError
        If runs cannot be made to either side.
    """
    pairs = {k: [_moved(point, k, side * step.step) for side in (1, -1)] for k, step in enumerate(steps)}
    central = {k: pair for k, pair in pairs.items() if all(_inside(at) for at in pair)}
    outcomes = iter(runs.evaluate_many([at for pair in central.values() for at in pair]))
    columns: dict[int, Array] = {}
    for k in central:
        ahead, behind = next(outcomes), next(outcomes)
        if not isinstance(ahead, BilayerError) and not isinstance(behind, BilayerError):
            columns[k] = (ahead - behind) / (2.0 * steps[k].step)
    for k in pairs.keys() - columns.keys():
        columns[k] = _one_sided(runs, point, k, steps[k].step)
    return np.stack([columns[k] for k in range(point.size)], axis=-1)


def _one_sided(runs: Runs, point: Array, k: int, step: float) -> Array:
    """Return the derivative from the side with more room, otherwise from the other side."""
    here, failures = runs.evaluate(point), []
    for side in sorted((1.0, -1.0), key=lambda side: side * (point[k] - 0.5)):
        near, far = (_moved(point, k, side * times * step) for times in (1.0, 2.0))
        if not _inside(far):
            continue
        ahead, beyond = runs.evaluate_many([near, far])
        if isinstance(ahead, BilayerError):
            failures.append(runs.explained(near, ahead))
        elif isinstance(beyond, BilayerError):
            failures.append(runs.explained(far, beyond))
        else:
            return (-3.0 * here + 4.0 * ahead - beyond) / (2.0 * side * step)
    raise failures[0]  # steps are short: at least one side is within the bounds


def _moved(point: Array, k: int, by: float) -> Array:
    moved = point.copy()
    moved[k] += by
    return moved


def _inside(point: Array) -> bool:
    return bool(np.all((point >= 0.0) & (point <= 1.0)))
