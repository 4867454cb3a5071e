"""From what is varied to the runs: a list of values by parameter for each of them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from math import log2, prod
from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.studies.sweeps.spec import MOST_RUNS, Parameter, SweepSpec

SEED = "seed"
"""Column of `repeats`."""
ENDS = 2
"""Values of a range that is searched and has no count: those that its scenes are checked at."""
Values = dict[str, Any]
"""By parameter: plain numbers in the parameter's unit, or what a list of values has."""


def count_of(spec: SweepSpec) -> int:
    """Return how many runs a sweep has.

    Raises
    ------
    InputError
        If they are too many.
    """
    repeats = spec.repeats.count if spec.repeats else 1
    if spec.samples is not None:
        runs = spec.samples * repeats
    else:
        lengths = [len(of.values) if of.values is not None else of.count or ENDS for of in spec.parameters.values()]
        runs = (prod(lengths) if spec.design == "grid" else lengths[0]) * repeats
    if runs > MOST_RUNS:
        raise InputError(f"sweep: has {runs} runs; at most {MOST_RUNS} are allowed")
    return runs


def runs_of(spec: SweepSpec) -> Iterator[Values]:
    """Yield the values of each run, in order. With `repeats`, the repeats of one design point follow each other."""
    seeds = [{SEED: k} for k in range(spec.repeats.count)] if spec.repeats else [{}]
    for values in _points(spec):
        yield from (values | seed for seed in seeds)


def _points(spec: SweepSpec) -> Iterator[Values]:
    names = list(spec.parameters)
    if spec.design in ("sobol", "latin_hypercube"):
        for row in _sample(spec, len(names)):
            yield {name: at(spec.parameters[name], float(u)) for name, u in zip(names, row, strict=True)}
        return
    columns = [_levels(spec.parameters[name]) for name in names]
    rows = product(*columns) if spec.design == "grid" else zip(*columns, strict=True)
    yield from (dict(zip(names, row, strict=True)) for row in rows)


def _levels(parameter: Parameter) -> list[Any]:
    if parameter.levels is not None:
        return list(parameter.levels)
    return [at(parameter, float(u)) for u in np.linspace(0.0, 1.0, parameter.count or ENDS)]


def at(parameter: Parameter, u: float) -> Any:
    """Return the value at a part `u` of the way through a parameter, from 0 to 1.

    For a list this is the item there; for a range both ends are exact.
    """
    if parameter.levels is not None:
        return parameter.levels[min(int(u * len(parameter.levels)), len(parameter.levels) - 1)]
    begin, end = parameter.ends
    if parameter.spacing == "log":
        value = begin * (end / begin) ** u
    else:
        value = begin + u * (end - begin)
    value = float(min(max(value, begin), end)) if 0.0 < u < 1.0 else (begin if u <= 0.0 else end)
    return round(value) if parameter.whole else value


def _sample(spec: SweepSpec, dimension: int) -> np.ndarray:
    """Return the points of the unit cube, shape (samples, dimension)."""
    from scipy.stats import qmc

    if spec.design == "latin_hypercube":
        return qmc.LatinHypercube(dimension, seed=spec.seed).random(spec.samples)
    sampler = qmc.Sobol(dimension, seed=spec.seed)
    return sampler.random_base2(int(np.ceil(log2(spec.samples))))[: spec.samples]
