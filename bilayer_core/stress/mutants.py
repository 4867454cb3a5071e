"""Seeded bugs: each changes one place of the sources in a way that somebody might write, and that changes results.

They are in ``mutants.toml``, with the tests of each module. `stress.mutations` applies each to a copy of the checkout
and asks which test or case notices.
"""

from __future__ import annotations

import fnmatch
import hashlib
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError

FILE = Path(__file__).with_name("mutants.toml")
PACKAGE = "bilayer_core"


@dataclass(frozen=True)
class Mutant:
    """One bug.

    Attributes
    ----------
    name : str
        The module, and what happens in it.
    file : str
        In the package.
    old, new : str
        What is there exactly once, and what stands in its place.
    bug : str
        What is wrong then.
    tests : tuple of str
        Test files of its module, in the checkout.
    """

    name: str
    file: str
    old: str
    new: str
    bug: str
    tests: tuple[str, ...]

    @property
    def path(self) -> str:
        """In the checkout."""
        return f"{PACKAGE}/{self.file}"

    @property
    def digest(self) -> str:
        """Another one for another bug."""
        return hashlib.sha256(repr((self.file, self.old, self.new)).encode()).hexdigest()[:12]

    def applied_to(self, source: str) -> str:
        """A source with the bug in it.

        Raises
        ------
        InputError
            If the text that it replaces is not there exactly once.
        """
        found = source.count(self.old)
        if found != 1:
            raise InputError(
                f"{FILE.name}: mutant {self.name!r}: {self.path} has `{self.old.strip()}` {found} times; "
                "it must be there exactly once"
            )
        return source.replace(self.old, self.new)


def mutants() -> dict[str, Mutant]:
    """All by name, each checked against the sources that run.

    Raises
    ------
    InputError
        If one does not fit them.
    """
    content = tomllib.loads(FILE.read_text(encoding="utf-8"))
    found: dict[str, Mutant] = {}
    for entry in content["mutant"]:
        tests = tuple(f"tests/{name}" for name in content["tests"][entry["file"]])
        mutant = Mutant(**entry, tests=tests)
        mutant.applied_to((FILE.parents[1] / mutant.file).read_text(encoding="utf-8"))
        if mutant.name in found:
            raise InputError(f"{FILE.name}: two mutants are called {mutant.name!r}")
        found[mutant.name] = mutant
    return found


def chosen_mutants(only: Sequence[str]) -> dict[str, Mutant]:
    """Those whose names fit a pattern, such as ``newton*``, or all without one.

    Raises
    ------
    InputError
        If a pattern fits none, or a mutant does not fit the sources.
    """
    known = mutants()
    for pattern in only:
        if not fnmatch.filter(known, pattern):
            groups = ", ".join(dict.fromkeys(name.split(":")[0] for name in known))
            raise InputError(f"--only {pattern}: fits no mutant; there are mutants of {groups} (--list names all)")
    if not only:
        return known
    return {name: mutant for name, mutant in known.items() if any(fnmatch.fnmatchcase(name, p) for p in only)}
