"""Error against CPU time: every problem with every family that its scene accepts, at several steps and meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bilayer_core.verification.bench import converged_answers, measuring
from bilayer_core.verification.bench.configurations import Configuration, families
from bilayer_core.verification.bench.problems import OF_ROBOTS, Problem
from bilayer_core.verification.bench.results import Results

PART = "work_precision"


def plan(problems: Iterable[Problem], quick: bool) -> list[tuple[Problem, Configuration]]:
    """Return all runs, problem by problem."""
    return [
        (problem, configuration)
        for problem in problems
        for family in families(problem.config(), OF_ROBOTS if quick else problem.integrators)
        for configuration in problem.configurations(family, quick)
    ]


def check_references(runs: Iterable[tuple[Problem, Configuration]]) -> None:
    """Refuse what no reference is there for, before anything is computed.

    Raises
    ------
    InputError
        Says how to make it.
    """
    for problem, model in dict.fromkeys((problem, configuration.family.model) for problem, configuration in runs):
        converged_answers.stored(problem, model)


def measure(
    runs: Iterable[tuple[Problem, Configuration]], results: Results, progress: Callable[[str], None] = lambda text: None
) -> None:
    """Make the runs that are not among the results yet.

    `runs`: as `plan` gives them. `progress`: called with what is done next, before every run.
    """
    for problem, configuration in runs:
        identity = {"problem": problem.name, **configuration.identity()}
        progress(f"{problem.name}: {configuration.family.label}")
        if results.find(PART, identity) is None:
            results.add(PART, {**identity, **_record(problem, configuration)})


def _record(problem: Problem, configuration: Configuration) -> dict:
    reference = converged_answers.stored(problem, configuration.family.model)
    run = measuring.run(problem, configuration)
    if run.values is None:
        return {"outcome": run.outcome, "error": None, "cpu_time": None, **run.cost}
    error = problem.measure.error(run.values, reference.values)
    value = float(run.values[0, 0]) if run.values.shape == (1, 1) else None
    return {"outcome": run.outcome, "error": error, "value": value, **run.cost}
