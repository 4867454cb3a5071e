"""Validation cases and their results."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from bilayer_core.errors import BilayerError


@dataclass(frozen=True)
class Case:
    """A figure with a known answer."""

    name: str  # Family and case, with slashes between: ``"helix/laminate (40, 20)/radius"``
    against: str  # What it is checked against, in one line
    limit: float  # Largest error that passes
    measure: Callable[[], tuple[float, float]]  # Returns the figure as computed, and the answer
    unit: str = "1"  # Of both; ``"1"`` for pure numbers
    scale: float | None = None  # What their difference is divided by to be the error; None for the answer itself
    long: bool = False  # Whether it takes more than a second or two, and ``--quick`` leaves it out

    @property
    def family(self) -> str:
        """Part of the name before the first slash."""
        return self.name.split("/")[0]

    def run(self) -> Result:
        """Compute it. A simulation that cannot go on is a failed case with its message."""
        begin = clock.process_time()
        message = ""
        try:
            computed, reference = map(float, self.measure())
        except BilayerError as failure:
            computed, reference, message = math.nan, math.nan, str(failure)
        scale = abs(reference) if self.scale is None else self.scale
        error = abs(computed - reference) / scale
        return Result(self, computed, reference, error, clock.process_time() - begin, message)


def cases(
    name: str,
    against: str,
    limit: float,
    measure: Callable[..., tuple[float, float]],
    over: Iterable[object],
    unit: str = "1",
    scale: float | None = None,
    long: bool = False,
) -> list[Case]:
    """Return a case for each value or tuple in `over`: they stand in the braces of `name`, and `measure` takes them."""
    each = [values if isinstance(values, tuple) else (values,) for values in over]
    return [Case(name.format(*values), against, limit, partial(measure, *values), unit, scale, long) for values in each]


@dataclass(frozen=True)
class Result:
    """Result of a case."""

    case: Case
    computed: float
    reference: float
    """`computed`, `reference`: in the case's unit."""
    error: float  # NaN if it could not be computed
    cpu_time: float  # [s]; what cases share counts for the first of them
    message: str = ""  # Why it could not be computed

    @property
    def passed(self) -> bool:
        """True if the error is within the limit."""
        return self.error <= self.case.limit

    def record(self) -> dict[str, object]:
        """Return the result as a line of the table in json and csv, with None for a number that is not finite."""
        numbers = {"computed": self.computed, "reference": self.reference, "error": self.error}
        return {
            "case": self.case.name,
            **{key: value if math.isfinite(value) else None for key, value in numbers.items()},
            "limit": self.case.limit,
            "pass": self.passed,
            "unit": self.case.unit,
            "against": self.case.against,
            "message": self.message,
        }
