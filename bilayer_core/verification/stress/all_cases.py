"""All stress cases by name: the matrix and the torture cases."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from bilayer_core.verification.stress.matrix import MOST_STEPS, SEED, MatrixCase, matrix
from bilayer_core.verification.stress.region import outside
from bilayer_core.verification.stress.robots import scene_of
from bilayer_core.verification.stress.stress_case import StressCase
from bilayer_core.verification.stress.torture import torture_cases

QUICK = 100
"""Cases of a quick run."""
LONG_STEP = "all/1154"
"""A case too long for a quick run: with a barrier of 87 thicknesses all rods feel each other, and its first step takes
46 s of CPU time, within which no limit is asked.
"""
QUICK_STEPS, QUICK_LIMIT = 300, 3.0
"""Accepted steps and CPU time [s] of a case of a quick run."""
CHOSEN = 0.2
"""Part of the cases, by the seed, whose energy budget is kept, and that are compared with a finer run also outside the
region; inside all are."""
LONG_LOOKS = 500
"""Looks of the judge at a long case."""
LONG_LIMIT = 240.0
"""CPU time of a long case [s]."""


@cache
def all_cases() -> dict[str, StressCase]:
    """Return every case by its name, in a fixed order: the matrix, and torture cases, which take longer."""
    chosen = np.random.default_rng(SEED)
    cases = [*(_of_matrix(case, chosen.random() < CHOSEN) for case in matrix()), *torture_cases()]
    return {case.name: case for case in cases}


def _of_matrix(case: MatrixCase, is_chosen: bool) -> StressCase:
    why = tuple(outside(case.parameters))
    is_long = case.most_steps > MOST_STEPS
    return StressCase(
        name=case.name,
        content=partial(scene_of, case.parameters),
        outside=why,
        most_steps=case.most_steps,
        look_every=max(1, case.most_steps // LONG_LOOKS) if is_long else 1,
        compared=(is_chosen or not why) and not is_long,
        budget=is_chosen and not is_long,
        axis=case.axis,
        **({"cpu_limit": LONG_LIMIT} if is_long else {}),
    )


@cache
def quick_names() -> frozenset[str]:
    """Return a seeded choice of short cases of the matrix, some of every group."""
    chosen, groups = np.random.default_rng(SEED), {}
    for name, case in all_cases().items():
        if case.most_steps <= MOST_STEPS and case.group not in ("stations", "long", "torture"):
            groups.setdefault(case.group, []).append(name)
    total = sum(map(len, groups.values()))
    names = []
    for group in groups.values():
        count = max(1, round(QUICK * len(group) / total))
        names += chosen.choice(group, size=min(count, len(group)), replace=False).tolist()
    return frozenset(names) - {LONG_STEP}
