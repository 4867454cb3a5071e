"""A whole benchmark: what is to be done, in order, and what is written of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from bilayer_core.errors import InputError
from bilayer_core.scene.faults import suggestion
from bilayer_core.verification.bench import cantilever, commands, plots, scaling, start, tables, work_precision
from bilayer_core.verification.bench.problems import PROBLEMS, Problem
from bilayer_core.verification.bench.results import Results

PEERS, SCALING, START, COMMANDS = "peers", "scaling", "start", "commands"


def names() -> list[str]:
    """Return all that ``--only`` takes."""
    return [*(problem.name for problem in PROBLEMS), PEERS, SCALING, START, COMMANDS]


def chosen_names(only: Sequence[str], quick: bool) -> list[str]:
    """Return the names of the parts to run, in order. Raises InputError if there is no such thing."""
    known = names()
    for name in only:
        if name not in known:
            raise InputError(f"--only {name}: no such part{suggestion(name, known)}; there are {', '.join(known)}")
    if only:
        return [name for name in known if name in only]
    long = {problem.name for problem in PROBLEMS if not problem.quick_levels} if quick else set()
    return [name for name in known if name not in long]


def chosen_problems(chosen: Sequence[str]) -> list[Problem]:
    """Return the problems among these names."""
    return [problem for problem in PROBLEMS if problem.name in chosen]


def count(chosen: Sequence[str], quick: bool) -> int:
    """Return how many times `measure` calls its progress."""
    total = len(work_precision.plan(chosen_problems(chosen), quick))
    total += len(cantilever.PEERS) * (PEERS in chosen)
    total += len(scaling.plan(quick)) * (SCALING in chosen)
    total += len(start.plan(quick)) * (START in chosen)
    return total + len(commands.plan(quick)) * (COMMANDS in chosen)


def measure(chosen: Sequence[str], results: Results, quick: bool, progress: Callable[[str], None]) -> list[str]:
    """Do what is not among the results yet; return lines on what was left out.

    `chosen`: from `chosen_names`. `results`: is filled, and written after every measurement. `progress`: called with
    what is done next.
    """
    runs = work_precision.plan(chosen_problems(chosen), quick)
    work_precision.check_references(runs)
    work_precision.measure(runs, results, progress)
    skipped = cantilever.measure(results, quick, progress) if PEERS in chosen else []
    if SCALING in chosen:
        scaling.measure(results, quick, progress)
    if START in chosen:
        start.measure(results, quick, progress)
    if COMMANDS in chosen:
        commands.measure(results, quick, progress)
    return skipped


def write(results: Results, directory: Path) -> list[Path]:
    """Write the conclusions into the json file, tables and pictures beside it."""
    content = results.content
    family = tables.recommendation(content)
    content["recommended"] = vars(family) if family else None
    content["slopes"] = {f"{m} {d}-D": slope for (m, d), slope in scaling.slopes(content[scaling.PART]).items()}
    results.write()
    return [results.path, *tables.write_csv(content, directory), tables.write_page(content, directory)] + plots.draw(
        content, directory
    )
