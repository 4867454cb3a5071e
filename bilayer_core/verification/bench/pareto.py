"""The Pareto front of runs, what an error costs, and the family of runs to recommend."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from bilayer_core.verification.bench.configurations import Family

AIM = 1e-2
"""Error at which families are compared: what an engineer asks of a figure."""
PENALTY = 10.0
"""Factor over the dearest family that reached the aim, for one that did not."""


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices of the points (cost, error) on the Pareto front, the cheapest first.

    No other point is both cheaper and more accurate than one of these.
    """
    order = sorted(range(len(points)), key=lambda i: points[i])
    found, least = [], math.inf
    for i in order:
        if points[i][1] < least:
            found.append(i)
            least = points[i][1]
    return found


def done(runs: Iterable[dict]) -> list[dict]:
    """Return the runs that have a result."""
    return [run for run in runs if run["outcome"] == "done"]


def cheapest(runs: Iterable[dict], error: float) -> dict | None:
    """Return the cheapest of the runs whose error is at most `error`."""
    reached = [run for run in done(runs) if run["error"] <= error]
    return min(reached, key=lambda run: run["cpu_time"], default=None)


def costs(runs: Sequence[dict], error: float = AIM) -> dict[str, dict[Family, float]]:
    """Return CPU time [s] of the cheapest run of each family that reaches an error, by problem; infinite where none
    does.
    """
    found: dict[str, dict[Family, float]] = {}
    for run in runs:
        by_family = found.setdefault(run["problem"], {})
        family = Family.of(run)
        cost = run["cpu_time"] if run["outcome"] == "done" and run["error"] <= error else math.inf
        by_family[family] = min(by_family.get(family, math.inf), cost)
    return found


def scores(by_problem: Mapping[str, Mapping[Family, float]]) -> dict[Family, float]:
    """Return the geometric mean over problems of a family's cost relative to the cheapest family's, the least first.

    What does not reach the aim counts `PENALTY` times the dearest that does. Problems that no family brings to the aim
    do not count. A family must have run every problem that some family reached, in some dimension: the lean ones that
    a scene refuses are judged with the family that stands in for them there, of the same model and integrator.
    """
    reached = {name: costs for name, costs in by_problem.items() if any(map(math.isfinite, costs.values()))}
    candidates = sorted({family for costs in reached.values() for family in costs})
    found = {}
    for family in candidates:
        ratios = []
        for costs in reached.values():
            substitute = stand_in(family, costs)
            if substitute is None:
                break
            finite = [cost for cost in costs.values() if math.isfinite(cost)]
            cost = costs[substitute] if math.isfinite(costs[substitute]) else PENALTY * max(finite)
            ratios.append(cost / min(finite))
        else:
            found[family] = math.exp(sum(map(math.log, ratios)) / len(ratios)) if ratios else math.inf
    return dict(sorted(found.items(), key=lambda item: item[1]))


def stand_in(family: Family, there: Iterable[Family]) -> Family | None:
    """Return the family itself, or the same in the other dimension if the scene accepts only that."""
    there = list(there)
    if family in there:
        return family
    return next((f for f in there if replace(f, dimension=family.dimension) == family), None)


def recommended(runs: Sequence[dict]) -> Family | None:
    """Return the family with the least score, None if no run reached the aim."""
    return next(iter(scores(costs(runs))), None)
