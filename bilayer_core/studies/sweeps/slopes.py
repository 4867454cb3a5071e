"""Derivatives of the metric of a run by what a sweep varies."""

from __future__ import annotations

import warnings

import numpy as np

from bilayer_core.simulation.run_result import RunResult
from bilayer_core.studies.sweeps.job import Job
from bilayer_core.studies.sweeps.spec import OfQuantity

AXES = ("com.x", "com.y", "com.z")
"""Quantities whose last values have derivatives."""


def slopes_of(job: Job, ended: RunResult) -> tuple[dict[str, float], str]:
    """Return the derivatives of the metric that is searched for by the parameters, in their units, and why there are
    none.
    """
    asks = job.metrics[job.slope_of]
    assert isinstance(asks, OfQuantity), "the client has seen to it"
    along = np.eye(3)[AXES.index(asks.quantity)]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        by_path = ended.pull_back({"com": along}, [path for paths in job.paths.values() for path in paths])
    grown = [str(of.message) for of in told if "forgets its start" in str(of.message)]
    if grown:
        return {}, grown[0]
    found = {}
    for name, paths in job.paths.items():
        unit = job.in_si({name: 1.0})[name] - job.in_si({name: 0.0})[name]
        found[name] = unit * sum(float(by_path[path]) for path in paths)
    return found, ""
