"""Findings about a scene, a line for each kind: where its worst case is, and how many others there are."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

ALIKE = 1e-9
"""Relative difference of severities that does not make one worse than another."""


class Told(Protocol):
    """Something that is said of a place in a scene."""

    @property
    def where(self) -> str:
        """Place."""
        ...

    @property
    def kind(self) -> Hashable:
        """Things of one kind are told as one."""
        ...

    @property
    def severity(self) -> float:
        """More for what is worse."""
        ...

    @property
    def superlative(self) -> str:
        """Word for the one with the largest severity among several."""
        ...

    def line(self, where: str) -> str:
        """Return the message about a place, in which the text `where` names the place."""
        ...


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


def told(found: Iterable[Told]) -> tuple[str, ...]:
    """Return a line for each kind, in the order in which the kinds occur first."""
    kinds: dict[Hashable, list[Told]] = {}
    for one in found:
        kinds.setdefault(one.kind, []).append(one)
    return tuple(_line(of_kind) for of_kind in kinds.values())


def _line(found: list[Told]) -> str:
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
