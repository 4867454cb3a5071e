"""Find whether a run goes where its derivatives say: its steps once more, with all numbers a little changed.

Derivatives are exact for the steps that were made. But where each impact, or each change between sticking and slipping,
makes two runs differ more, they are right for changes that nobody can make, and only a run tells.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence

import numpy as np

from bilayer_core.errors import SceneError, SimulationError
from bilayer_core.observed.frame import Description
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.simulation.gradients.course import Course
from bilayer_core.simulation.gradients.nearby import Builders, described, values_of
from bilayer_core.simulation.gradients.run_response import Number, RunResponse

Array = np.ndarray
PART = 1e-2
"""By which numbers are changed, over their size and the root of how many there are."""
LIMIT = 0.2
"""Difference between derivatives and the run, over the larger of both, that is told."""
SEEN = 1e-2
"""A quantity is compared where it changes by so much of what it would, did all numbers act in one direction."""


def try_derivatives(
    run: RunResponse,
    course: Course,
    builders: Builders,
    description: Description,
    wanted: Sequence[str],
    found: Sequence[tuple[Number, list[Array]]],
) -> dict[str, float]:
    """Return by how much derivatives of quantities differ from a run with other numbers, over the larger of both; none
    where no such run can be made. Warns where that is much.

    `found` has the derivatives of all quantities by each number. The numbers change in the direction that moves the
    first quantity most.
    """
    each = np.array([np.concatenate([slope.ravel() for slope in slopes]) for _, slopes in found]).T
    scales = np.array([number.scale for number, _ in found])
    ends = np.cumsum([0, *(slope.size for slope in found[0][1])])
    first = np.abs(each[: ends[1]]) @ scales
    signs = np.where(each[int(first.argmax())] < 0.0, -1.0, 1.0)
    change = PART / math.sqrt(len(found)) * scales * signs
    for way in (1.0, -1.0):
        made = _run_with(run, course, builders, description, wanted, [number for number, _ in found], way * change)
        if made is not None:
            break
    else:
        return {}
    off = {}
    for name, begin, end, moved in zip(wanted, ends[:-1], ends[1:], made, strict=True):
        told = way * each[begin:end] @ change
        if np.linalg.norm(told) < SEEN * np.linalg.norm(np.abs(each[begin:end]) @ np.abs(change)):
            continue
        sizes = np.linalg.norm(told), np.linalg.norm(moved)
        off[name] = float(np.linalg.norm(told - moved) / max(*sizes, np.finfo(float).tiny))
        if not off[name] <= LIMIT:
            warnings.warn(
                f"gradient: with {_told(found)} changed by {100.0 * PART / math.sqrt(len(found)):.2g} %, a run moves "
                f"{name} by {sizes[1]:.3g}, where derivatives say {sizes[0]:.3g} ({100.0 * off[name]:.0f} % apart): "
                "it goes by leaps, as after impacts or where friction sticks and slips; differentiate a shorter run",
                RuntimeWarning,
                stacklevel=4,
            )
    return off


def _told(found: Sequence[tuple[Number, list[Array]]]) -> str:
    return found[0][0].path if len(found) == 1 else f"all {len(found)} numbers"


def _run_with(
    run: RunResponse,
    course: Course,
    builders: Builders,
    description: Description,
    wanted: Sequence[str],
    numbers: Sequence[Number],
    change: Array,
) -> list[Array] | None:
    """Return by how much quantities change with the numbers at the end of a run; None where it cannot be begun, NaN
    where it fails.
    """
    other = {number.path: number.value + by for number, by in zip(numbers, change, strict=True)}
    try:
        model = builders.model_of(load_content(scene_content(run.scene), other))
    except SceneError:
        return None
    stepper, state = builders.stepper_of(model), builders.state_of(model)
    if not run.from_start:
        if state.layout() != course.start.layout():
            return None
        state.take(course.start)
    before = values_of(builders.stepper_of(run.model), course.end, wanted, description)
    stepper.evaluate(state)
    try:
        course.repeat(stepper, state)
        after = values_of(stepper, state, wanted, described(description, stepper))
    except SimulationError:
        return [np.full(value.size, math.nan) for value in before]
    return [(one - other).ravel() for one, other in zip(after, before, strict=True)]
