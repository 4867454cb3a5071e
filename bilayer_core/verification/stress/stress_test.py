"""A whole stress test: which cases, in what order, and what is written of them."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from bilayer_core.errors import InputError
from bilayer_core.verification.stress import outcome_pictures, stability_page
from bilayer_core.verification.stress.all_cases import QUICK_LIMIT, QUICK_STEPS, all_cases, quick_names
from bilayer_core.verification.stress.journal import Journal
from bilayer_core.verification.stress.pool import run_cases
from bilayer_core.verification.stress.shrink import is_shrinkable, shrink, write_scene
from bilayer_core.verification.stress.stress_case import Outcome, Record, StressCase

WORST = 10
"""Cases that are written as files that run again."""
MOST_SHRUNK = 20


def chosen_cases(only: Sequence[str], quick: bool, scenes: Sequence[str] = ()) -> dict[str, StressCase]:
    """Return the cases to run, in order.

    `only`: names with ``*``. `quick`: those of a quick run alone. `scenes`: scene files to judge instead. Raises
    InputError if a pattern fits none.
    """
    if scenes:
        return {name: StressCase(name, name, compared=True) for name in scenes}
    cases = all_cases()
    if only:
        for pattern in only:
            if not fnmatch.filter(cases, pattern):
                groups = ", ".join(dict.fromkeys(case.group for case in cases.values()))
                raise InputError(f"--only {pattern}: fits no case; there are groups {groups} (--list names all)")
        cases = {name: case for name, case in cases.items() if any(fnmatch.fnmatchcase(name, p) for p in only)}
    if quick:
        cases = {
            name: replace(case, most_steps=min(case.most_steps, QUICK_STEPS), cpu_limit=QUICK_LIMIT)
            for name, case in cases.items()
            if name in quick_names()
        }
    return cases


def measure(cases: dict[str, StressCase], journal: Journal, workers: int, tell: Callable[[Record], None]) -> None:
    """Run the cases that the journal does not have yet."""

    def done(record: Record) -> None:
        journal.add(record)
        tell(record)

    run_cases([case for name, case in cases.items() if name not in journal.records], workers, done)


def write(cases: dict[str, StressCase], journal: Journal, directory: Path, shrinks: bool) -> list[Path]:
    """Write the page of stability, its pictures, and the scenes of failures and of the worst cases."""
    written = []
    records = list(journal.records.values())
    failed = [record for record in records if record.outcome is Outcome.FAILED]
    for record in failed[:MOST_SHRUNK] if shrinks else ():
        if is_shrinkable(cases[record.name]):
            written.append(shrink(cases[record.name], record, directory / "failures"))
    made_here = [record for record in records if not isinstance(cases[record.name].content, str)]
    for number, record in enumerate(stability_page.worst(made_here, WORST), 1):
        written.append(write_scene(cases[record.name], record, directory / "worst", f"{number:02d}_"))
    written += outcome_pictures.draw(records, directory)
    written.append(stability_page.write_page(journal, directory))
    return written
