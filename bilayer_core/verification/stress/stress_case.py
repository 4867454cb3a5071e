"""Stress cases and their results."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bilayer_core.testing.trial import Trial


class Outcome(StrEnum):
    """How a case ended."""

    ACCURATE = "accurate"  # its error is known and below 1 %
    STABLE = "stable"  # nothing was wrong with it; its error is larger, or nobody knows it
    REFUSED = "refused"  # with a reason, when the scene was read, built or run
    FAILED = "FAILED"  # anything else


@dataclass(frozen=True)
class Decision:
    """A figure that decides a case, and the interval in which it must lie."""

    what: str  # In one line, with the source of the reference
    computed: float
    low: float
    high: float
    unit: str = "1"  # Of all three; ``"1"`` for pure numbers

    @property
    def holds(self) -> bool:
        """True if the figure lies in the interval; False for NaN."""
        return self.low <= self.computed <= self.high

    @classmethod
    def near(cls, what: str, computed: float, reference: float, limit: float, unit: str = "1") -> Decision:
        """Return the decision that a figure is within a relative limit of a reference."""
        width = limit * abs(reference)
        return cls(what, float(computed), reference - width, reference + width, unit)

    def text(self) -> str:
        """Return the figure and its interval in one line."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        word = "" if self.holds else "not "
        return f"{self.what}: {self.computed:.5g}{unit} is {word}from {self.low:.5g} to {self.high:.5g}{unit}"


@dataclass(frozen=True)
class StressCase:
    """A scene, how far it goes, and what decides it."""

    name: str  # Groups and case with slashes between
    content: Callable[[], dict] | str  # Returns the content of its scene file; or the path of one
    outside: tuple[str, ...] = ()  # Why it is outside the region of validity; empty inside
    most_steps: int = 2000  # Accepted steps after which it ends
    look_every: int = 1  # The judge's looks, in steps
    cpu_limit: float = 20.0
    """CPU time [s] after which its run ends where it is; a multiple of it later its process is killed."""
    decide: Callable[[Trial], Decision] | None = None
    """Runs the trial as it needs to, and returns the decision; without one the trial runs to the end of the scene."""
    compared: bool = False  # Whether its error is found from a finer run
    budget: bool = False  # Whether its energy budget is kept and judged, beside the account that every run keeps
    axis: str = ""  # The axis that it belongs to alone

    def scene(self) -> dict | str:
        """Return the content or the path of the scene, as `load_scene` takes it."""
        return self.content if isinstance(self.content, str) else self.content()

    @property
    def group(self) -> str:
        """Part of the name before the first slash."""
        return self.name.split("/")[0]


@dataclass
class Record:
    """Result of a case: a line of the journal."""

    name: str
    axis: str
    inside: bool  # Whether it is in the region of validity
    outside: list[str]
    outcome: Outcome
    reason: str = ""  # Why it was refused or failed, or why its error is not known
    remedy: str = ""  # What a refusal says to change; ``remedy_works`` whether that helped, None if nothing was tried
    remedy_works: bool | None = None
    error: float | None = None
    """Largest distance of a node or a body from where a finer run has it, at output times, over the length of the
    longest strip, or over the longest way of anything if that is longer. Of a torture case the relative error of
    what decides it.
    """
    decision: str = ""  # What decided a torture case
    figures: dict[str, float | int | None] = field(default_factory=dict)  # Counts and extremes of the run
    warnings: list[str] = field(default_factory=list)
    cpu_time: float = 0.0  # Of all of it [s]

    def line(self) -> str:
        """Return the record as a line of JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_line(cls, line: str) -> Record:
        """Read a record back from its line."""
        content = json.loads(line)
        return cls(**content | {"outcome": Outcome(content["outcome"])})
