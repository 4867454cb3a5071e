"""Search by derivatives: climbs from several starts, of which the highest one goes on."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.simulation.gradients.parameters import GAIN
from bilayer_core.simulation.settling import SETTLE
from bilayer_core.studies.sweeps.design import Values, at
from bilayer_core.studies.sweeps.job import Outcome, Point, Row
from bilayer_core.studies.sweeps.run_sweep import Sweep
from bilayer_core.studies.sweeps.slopes import AXES
from bilayer_core.studies.sweeps.spec import OfQuantity, Parameter

STARTS = 5
"""Of climbs, before the first one goes on; others follow where all have stopped."""
FIRST, LONGER, SHORTER, LEAST = 0.3, 1.5, 0.1, 1e-3
"""Steps of a climb, as parts of ranges: the first, by what they grow and shrink at most, and where it stops."""
MARGIN = 0.002
"""Part of its range that a value keeps from its ends, beyond which nothing can be differentiated."""


def refuse_unclimbable(sweep: Sweep, metric: str) -> None:
    """Refuse a search by derivatives for which there are none, by the name of what has none."""
    asks, spec, source = sweep.job.metrics[metric], sweep.spec, f"{sweep.source}: the method gradients:"
    quantity = isinstance(asks, OfQuantity) and asks.quantity in AXES and asks.after == 0.0
    if not quantity or asks.take not in ("last", "change"):
        raise InputError(f"{source} metric {metric!r} must be the last value or the change of {', '.join(AXES)}")
    if spec.change:
        raise InputError(f"{source} found change; what a function changes has no derivatives")
    if asks.take == "change" and json.loads(sweep.job.scene)["start"] == SETTLE:
        raise InputError(f"{source} metric {metric!r} must be the last value where the start settles")
    for name, parameter in spec.parameters.items():
        if parameter.levels is not None or parameter.whole:
            raise InputError(f"{source} parameter {name!r} must have a range of numbers that need not be whole")
        others = [path for path in parameter.paths if not (path.startswith("stimuli.") or GAIN.fullmatch(path))]
        if asks.take == "change" and others:
            raise InputError(
                f"{source} parameter {name!r} is neither a gain nor of a stimulus, so the start may depend on it; "
                f"metric {metric!r} must be the last value"
            )


@dataclass
class Climb:
    """Where a climb is, in parts of ranges, what it has reached, and how long its next step is."""

    place: np.ndarray
    step: float = FIRST
    value: float = -math.inf
    slopes: np.ndarray | None = None
    busy: bool = True

    def ahead(self) -> np.ndarray:
        """Return where it goes next: along slopes of which none is larger than their root mean square."""
        inwards = np.where(self.slopes > 0.0, self.place < 1.0 - MARGIN, self.place > MARGIN)
        slopes = np.where(inwards, self.slopes, 0.0)
        size = math.sqrt(float(slopes @ slopes) / max(np.count_nonzero(slopes), 1)) or 1.0
        return within(self.place + self.step * np.clip(slopes / size, -1.0, 1.0))

    def arrive(self, place: np.ndarray, value: float, slopes: np.ndarray) -> None:
        """Go to a place if it is higher; the next step is as long as slopes at both ends of this one tell."""
        if self.slopes is None:
            self.place, self.value, self.slopes = place, value, slopes
            return
        before, after = float(self.slopes @ (place - self.place)), float(slopes @ (place - self.place))
        top = before / (before - after) if after < 0.0 < before else math.inf  # of this step, where the line is highest
        if value > self.value:
            self.step *= LONGER if top == math.inf else max(1.0 - top, SHORTER)
            self.place, self.value, self.slopes = place, value, slopes
        else:
            self.step *= min(max(top, SHORTER), 0.5)

    @property
    def goes_on(self) -> bool:
        """True if its next step is known."""
        return (
            not self.busy and self.slopes is not None and self.step > LEAST and bool(np.any(self.ahead() != self.place))
        )


def within(place: np.ndarray) -> np.ndarray:
    """Return a place a margin within all ranges."""
    return np.clip(place, MARGIN, 1.0 - MARGIN)


class Ascent:
    """Climbs over the parameters of a sweep; they ask for runs and are told what came, as `optimise.Search`.

    Parameters
    ----------
    sweep : Sweep
    metric : str
    largest : bool
    seed : int
        Of starts after the one that the sweep has.
    start : dict or None
        Values of that; after the first run those of it, a margin within ranges.
    """

    def __init__(self, sweep: Sweep, metric: str, largest: bool, seed: int, start: Values | None):
        self.sweep, self.metric, self.largest, self.start = sweep, metric, largest, start
        self._random = np.random.default_rng(seed)
        self._sign = 1.0 if largest else -1.0
        self._climbs: list[Climb] = []
        self._asked: dict[int, tuple[Climb, np.ndarray]] = {}
        self.asked, self.found_none = 0, ""

    def ask(self) -> Point:
        """Return the next run."""
        going = [climb for climb in self._climbs if climb.goes_on]
        if len(self._climbs) < STARTS or not going:
            climb = Climb(self._new_place())
            self._climbs.append(climb)
            place = climb.place
        else:
            climb = max(going, key=lambda one: one.value)
            place = climb.ahead()
        climb.busy = True
        self._asked[self.asked] = climb, place
        self.asked += 1
        named = zip(self.sweep.spec.parameters.items(), place.tolist(), strict=True)
        values: Values = {name: at(of, part) for (name, of), part in named}
        if self.asked == 1 and self.start is not None:
            self.start = values
        return self.sweep.point(self.asked - 1, values)

    def _new_place(self) -> np.ndarray:
        parameters = self.sweep.spec.parameters
        if self._climbs or self.start is None:
            return within(self._random.uniform(size=len(parameters)))
        return within(np.array([_part_of(of, self.start[name]) for name, of in parameters.items()]))

    def tell(self, number: int, row: Row) -> None:
        """Take the outcome of a run."""
        climb, place = self._asked.pop(number)
        value, climb.busy = row.metrics.get(self.metric), False
        known = row.outcome is Outcome.DONE and isinstance(value, int | float) and value == value
        self.found_none = self.found_none or row.reason
        if known and row.slopes:
            named = zip(self.sweep.spec.parameters.items(), place.tolist(), strict=True)
            rates = [row.slopes[name] * _rate_at(of, part) for (name, of), part in named]
            climb.arrive(place, self._sign * value, self._sign * np.array(rates))
        else:
            climb.step *= SHORTER

    @property
    def is_lost(self) -> bool:
        """True if no run told which way is up."""
        return all(climb.slopes is None for climb in self._climbs)


def _part_of(parameter: Parameter, value: float) -> float:
    """Return at which part of a range a value is."""
    begin, end = parameter.ends
    return (
        math.log(value / begin) / math.log(end / begin)
        if parameter.spacing == "log"
        else (value - begin) / (end - begin)
    )


def _rate_at(parameter: Parameter, part: float) -> float:
    """Return how fast the value changes with the part of a range."""
    begin, end = parameter.ends
    return at(parameter, part) * math.log(end / begin) if parameter.spacing == "log" else end - begin
