"""The numbers that are kept of a run: values of its summary, of quantities over time, and of functions."""

from __future__ import annotations

import difflib
import math
import numbers
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.run.recorded import Recorded
from bilayer_core.log.run.tables import component_unit
from bilayer_core.printable import shortened
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.simulation.summary import UNITS
from bilayer_core.studies.sweeps.job import Job
from bilayer_core.studies.sweeps.spec import Metric, OfFunction, OfQuantity, OfSummary
from bilayer_core.studies.sweeps.sweep_functions import load


class MetricError(Exception):
    """A function of the sweep raised, or returned what no column takes."""


@dataclass(frozen=True)
class FinishedRun:
    """Finished run, as functions of a sweep see it.

    Attributes
    ----------
    simulator : Simulator
        At the end of the run.
    summary : dict
        As of ``bilayer run --summary``.
    parameters : dict
        Values of what is varied, by name; in SI units.
    recording : Recorded or None
        Quantities over time; None if the sweep records none.
    """

    simulator: Simulator
    summary: dict[str, Any]
    parameters: dict[str, Any]
    recording: Recorded | None


def quantities_of(metrics: dict[str, Metric]) -> tuple[str, ...]:
    """Return the names of the quantities that metrics look at, without components."""
    return tuple(dict.fromkeys(metric.quantity for metric in metrics.values() if isinstance(metric, OfQuantity)))


def name_and_component(quantity: str, known: Any) -> tuple[str, str]:
    """Return ``com.z`` as ``com`` and ``z``."""
    if quantity in known:
        return quantity, ""
    name, dot, component = quantity.rpartition(".")
    return (name, component) if dot else (quantity, "")


def measure(job: Job, run: FinishedRun) -> dict[str, Any]:
    """Return all metrics of a run that is done.

    Raises
    ------
    MetricError
        If a function fails.
    """
    return {name: _value(name, metric, job, run) for name, metric in job.metrics.items()}


def _value(name: str, metric: Metric, job: Job, run: FinishedRun) -> Any:
    if isinstance(metric, OfSummary):
        return of_summary(metric.summary, run.summary)
    if isinstance(metric, OfQuantity):
        return _of_quantity(metric, run.recording)
    try:
        return _plain(load(job.codes[metric.function])(run))
    except Exception as error:  # of the user's function
        raise MetricError(f"metric {name} ({metric.function}): {type(error).__name__}: {error}") from error


def _plain(value: Any) -> Any:
    """Return a value in a type that a column takes; raise TypeError if it has none."""
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    raise TypeError(f"returned {type(value).__name__} {shortened(repr(value))}; must return a number, a text or None")


def of_summary(path: str, summary: dict[str, Any]) -> Any:
    """Return the value at a key path of a summary, such as ``com_end.0``; None where a list or a mapping is None.

    Raises
    ------
    InputError
        If there is nothing of this name; the message names the nearest ones.
    """
    here: Any = summary
    for key in path.split("."):
        if here is None:
            return None
        if isinstance(here, dict) and key in here:
            here = here[key]
        elif isinstance(here, list) and key.lstrip("-").isdigit() and -len(here) <= int(key) < len(here):
            here = here[int(key)]
        else:
            near = difflib.get_close_matches(path, list(key_paths(summary)), n=3, cutoff=0.5)
            raise InputError(
                f"there is no {path} in the summary of a run; near it: {', '.join(near) or 'none is like it'} "
                "(`bilayer run SCENE --summary -` shows one)"
            )
    if isinstance(here, dict | list):
        inside = [f"{path}.{key}" for key in (here if isinstance(here, dict) else range(len(here)))]
        raise InputError(f"{path} is no single value of a summary; take one of {', '.join(inside[:8]) or 'others'}")
    return here


def key_paths(content: Any, before: str = "") -> Iterator[str]:
    """Yield the paths of all single values."""
    if isinstance(content, dict | list):
        for key, value in content.items() if isinstance(content, dict) else enumerate(content):
            yield from key_paths(value, f"{before}{key}.")
    else:
        yield before[:-1]


def _of_quantity(metric: OfQuantity, recording: Recorded | None) -> float | None:
    assert recording is not None, "the client has seen to it"
    values = series(metric, recording)
    chosen = values[recording.times >= metric.after - 1e-12]
    if not chosen.size:
        return None
    if metric.take == "largest_magnitude":
        return float(np.abs(chosen).max())
    if metric.take == "range":
        return float(np.ptp(chosen))
    if metric.take == "change":
        return float(chosen[-1] - chosen[0])
    if metric.take in ("first", "last"):
        return float(chosen[0 if metric.take == "first" else -1])
    found = float(getattr(chosen, metric.take)())  # min, max or mean
    return found if math.isfinite(found) else None


def series(metric: OfQuantity, recording: Recorded) -> np.ndarray:
    """Return the values over time that a metric uses, shape (frames,).

    Raises
    ------
    InputError
        If there is no such quantity or component, or no single number at a time.
    """
    name, component = name_and_component(metric.quantity, recording.entries())
    quantity = recording[name]
    values = quantity.values
    if "node" in quantity.axes:
        nodes = values.shape[1]
        if metric.node is None or not -nodes <= metric.node < nodes:
            found = "nothing" if metric.node is None else metric.node
            raise InputError(f"quantity {name!r}: is of nodes; `node` must say which, 0 to {nodes - 1}; found {found}")
        values = values[:, metric.node]
    elif metric.node is not None:
        raise InputError(f"quantity {name!r}: is not of nodes; leave `node` out")
    if quantity.labels:
        if component not in quantity.labels:
            told = ", ".join(f"{name}.{label}" for label in quantity.labels)
            raise InputError(f"quantity {metric.quantity!r}: is no single number at a time; take one of {told}")
        return values[:, quantity.labels.index(component)]
    if component:
        raise InputError(f"quantity {metric.quantity!r}: {name} has no components")
    return values


def check_metrics(job: Job, run: FinishedRun) -> dict[str, str]:
    """Check that a run has everything that the metrics ask for, without calling functions; return their units.

    Raises
    ------
    InputError
        Names the metric.
    """
    units = {}
    for name, metric in job.metrics.items():
        try:
            if isinstance(metric, OfFunction):
                units[name] = metric.unit
            elif isinstance(metric, OfSummary):
                of_summary(metric.summary, run.summary)
                units[name] = next((UNITS[key] for key in metric.summary.split(".") if key in UNITS), "")
            else:
                assert run.recording is not None
                series(metric, run.recording)
                quantity, component = name_and_component(metric.quantity, run.recording.entries())
                units[name] = component_unit(run.recording[quantity].unit, component)
        except InputError as error:
            raise InputError(f"metrics.{name}: {error}") from None
    return {name: unit for name, unit in units.items() if unit}
