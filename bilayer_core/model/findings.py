"""Findings about a scene, a line for each kind: where its worst case is, and how many others there are."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

ALIKE = 1e-9
"""Relative difference of severities that does not make one worse than another."""


@dataclass(frozen=True)
class Finding:
    """A warning: what stands before and after its place."""

    kind: str
    where: str
    after: str
    before: str = ""
    severity: float = 0.0
    superlative = "worst"

    def line(self, where: str) -> str:
        """Return the message about a place, in which the text `where` names the place."""
        return f"{self.before}{where}{self.after}"


@dataclass(frozen=True)
class Figure:
    """A figure of a scene on which the validity of the model depends.

    Attributes
    ----------
    where : str
        Key path.
    what, value, limit : str
        The quantity, its value with the unit, and the range in which the model is meant to be used.
    severity : float
        A number to compare figures of one quantity by: 1 at the limit, more beyond.
    outside : str
        What it means that the value is out of the range; empty while it is within.
    """

    where: str
    what: str
    value: str
    limit: str
    severity: float
    outside: str = ""

    @property
    def kind(self) -> tuple[str, bool]:
        """The quantity, and whether it is out of its range."""
        return self.what, bool(self.outside)

    @property
    def superlative(self) -> str:
        """Phrase that describes this figure when it has the largest severity among several."""
        return "worst" if self.outside else "nearest to the limit"

    def line(self, where: str) -> str:
        """Return the figure, with the text that names the place."""
        text = f"{where}: {self.what} {self.value} ({self.limit})"
        return f"{text}: {self.outside}" if self.outside else text

    def __str__(self) -> str:
        return self.line(self.where)


def told(found: Iterable[Finding | Figure]) -> tuple[str, ...]:
    """Return a line for each kind, in the order in which the kinds occur first."""
    kinds: dict[Hashable, list[Finding | Figure]] = {}
    for one in found:
        kinds.setdefault(one.kind, []).append(one)
    return tuple(_line(of_kind) for of_kind in kinds.values())


def _line(found: list[Finding | Figure]) -> str:
    worst = max(found, key=lambda one: one.severity)
    others = list(dict.fromkeys(one.where for one in found if one.where != worst.where))
    if not others:
        return worst.line(worst.where)
    if all(math.isclose(one.severity, worst.severity, rel_tol=ALIKE) for one in found):
        return worst.line(few([worst.where, *others]))
    return worst.line(f"{worst.where} (the {worst.superlative} of {1 + len(others)}, with {few(others)})")


def few(names: Sequence[str], shown: int = 2) -> str:
    """Return the first names, and how many more there are."""
    if len(names) <= shown + 1:
        return ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + names[-1]
    return f"{', '.join(names[:shown])} and {len(names) - shown} more"
