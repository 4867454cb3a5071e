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
from bilayer_core.simulation.gradients.run_response import RunResponse
from bilayer_core.simulation.gradients.varied_numbers import Number
from bilayer_core.simulation.settling import SETTLE, settle

Array = np.ndarray
PART = 1e-2
"""By which numbers are changed, over their size and the root of how many there are; zeros by its square."""
LIMIT = 0.2
"""Difference between derivatives and the run, over the larger of both, that is told."""
ROUNDED = 1e-9
"""Changes of a quantity, over it, that tell nothing."""
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
    parts = np.array([PART if number.value else PART**2 for number, _ in found])
    change = parts / math.sqrt(len(found)) * scales * signs
    for way in (1.0, -1.0):
        made = _run_with(run, course, builders, description, wanted, [number for number, _ in found], way * change)
        if made is not None:
            break
    else:
        return {}
    off = {}
    for name, begin, end, before, moved in zip(wanted, ends[:-1], ends[1:], *made, strict=True):
        told = way * each[begin:end] @ change
        sizes = float(np.linalg.norm(told)), float(np.linalg.norm(moved))
        least = max(SEEN * np.linalg.norm(np.abs(each[begin:end]) @ np.abs(change)), ROUNDED * np.linalg.norm(before))
        if max(sizes) <= least:
            continue
        off[name] = float(np.linalg.norm(told - moved)) / max(sizes)
        if off[name] > LIMIT:
            warnings.warn(
                f"gradient: with {_told(found, way * change)}, a run moves {name} by {sizes[1]:.3g}, where derivatives "
                f"say {sizes[0]:.3g} ({100.0 * off[name]:.0f} % apart): it goes by leaps, as after impacts or where "
                "friction sticks and slips; differentiate a shorter run",
                RuntimeWarning,
                stacklevel=4,
            )
    return off


def _told(found: Sequence[tuple[Number, list[Array]]], change: Array) -> str:
    number = found[0][0]
    if len(found) == 1:
        return f"{number.path} at {number.value + change[0]:.6g} in place of {number.value:.6g}"
    return f"all {len(found)} numbers changed by up to {100.0 * PART / math.sqrt(len(found)):.2g} %"


def _run_with(
    run: RunResponse,
    course: Course,
    builders: Builders,
    description: Description,
    wanted: Sequence[str],
    numbers: Sequence[Number],
    change: Array,
) -> tuple[list[Array], list[Array]] | None:
    """Return quantities at the end of a run, and by how much they change with the numbers; None where the other run
    cannot be made.
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
    try:
        if run.from_start and run.scene.start == SETTLE:
            settle(stepper, state, None)
        stepper.evaluate(state)
        course.repeat(stepper, state)
        after = values_of(stepper, state, wanted, described(description, stepper))
    except SimulationError:
        return None
    return before, [(one - other).ravel() for one, other in zip(after, before, strict=True)]
