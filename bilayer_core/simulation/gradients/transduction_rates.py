"""Derivatives of what modes of materials have reached of stimuli at a point of a step."""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.step_response import ElasticMaps
from bilayer_core.engine.varied_diffusion import FieldDifferences, differentiate_field
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.followed import append
from bilayer_core.simulation.gradients.light_rates import slopes_of_parts
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain

Array = np.ndarray
CHANGE = 1e-6
"""Of a stimulus, over what is reached and asked for, by which varied diffusion is differentiated."""


def write_reached(again: StepAgain, n: int, step: KeptStep, lit: Array, elastic: ElasticMaps) -> None:
    """Write by what modes reach at point n of a step what they had reached, stimuli, and what elements see of light,
    which depends on places at the start as `lit`.
    """
    again.write_lags(n, elastic)
    problem, inputs = again.problem, again.inputs
    drives, light, varied = problem.drives, problem.light, problem.varied_fields
    counts = np.diff(drives.field_first)
    seen = light.seen if light.exists else np.ones((len(counts), 2))
    elastic.by_reached.count[0] = 0
    for f in np.flatnonzero(varied.number >= 0) if varied.exists else ():
        own, channel = slice(int(drives.field_first[f]), int(drives.field_first[f + 1])), drives.field_channel[f]
        ends = np.array([inputs.first[channel], inputs.stimulus[n, channel]]) * seen[f]
        slope = _slope_of_field(again, f, step.start.transduction, ends, float(inputs.elapsed[n]))
        elastic.lag[0, own], elastic.lag[1:, own] = 0.0, slope[:, -2:].T
        row, column = np.nonzero(slope[:, :-2])
        reached = Entries(own.start + row, own.start + column, slope[row, column], slope.shape)
        append(elastic.by_reached, reached)
    if light.exists:
        field_of = np.repeat(np.arange(len(counts)), counts)
        element = np.full(len(seen), -1)
        element[light.field] = np.arange(len(light.field))
        own = np.flatnonzero(element[field_of] >= 0)
        k, count, channel = element[field_of[own]], len(light.field), drives.field_channel[field_of[own]]
        stimuli, slopes = (inputs.first[channel], inputs.stimulus[n, channel]), slopes_of_parts(again, n, step)[:, :, k]
        slope = sum(elastic.lag[1 + i, own] * stimuli[i] * slopes[i] for i in range(2))
        by_place = slope[0][:, None] * lit[k] + slope[1][:, None] * lit[count + k]
        row, column = np.nonzero(by_place)
        elastic.by_place.count[0] = elastic.by_kept.count[0] = 0
        append(elastic.by_place, Entries(own[row], column, by_place[row, column], by_place.shape))
        first_kept = len(again.speeds)
        for by, first in zip(slope[2:], (first_kept, first_kept + count), strict=True):
            append(elastic.by_kept, Entries(own, first + k, by, (len(field_of), again.kept)))
        elastic.lag[1:] *= seen[field_of].T


def _slope_of_field(again: StepAgain, f: int, state: Array, stimulus: Array, elapsed: float) -> Array:
    """Return how a field depends on its modes, as they were, and on its stimulus; see `FieldDifferences`."""
    size = int(np.diff(again.problem.drives.field_first)[f])
    found = FieldDifferences(start=state.copy(), end=state.copy(), stimulus=stimulus, slope=np.zeros((size, size + 2)))
    change = CHANGE * (max(np.abs(state).max(), np.abs(stimulus).max()) or 1.0)
    differentiate_field(again.problem, found, f, elapsed, change)
    return found.slope
