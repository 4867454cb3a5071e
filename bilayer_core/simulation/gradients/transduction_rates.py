"""Derivatives of what modes of materials have reached of stimuli at a point of a step."""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.varied_diffusion import FieldDifferences, differentiate_field
from bilayer_core.simulation.gradients.light_rates import slopes_of_parts
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain

Array = np.ndarray
CHANGE = 1e-6
"""Of a stimulus, over what is reached and asked for, by which varied diffusion is differentiated."""


class TransductionRates:
    """Maps from what modes had reached at the start of a step, and from stimuli, to what they reach at its point n."""

    def __init__(self, again: StepAgain, n: int, step: KeptStep, lit: Array):
        drives, inputs, state = again.problem.drives, again.inputs, step.start
        counts, elapsed = np.diff(drives.field_first), float(inputs.elapsed[n])
        field_of, light, varied = (
            np.repeat(np.arange(len(counts)), counts),
            again.problem.light,
            again.problem.varied_fields,
        )
        channel = drives.field_channel[field_of]
        seen = light.seen if light.exists else np.ones((len(counts), 2))
        stimuli = np.stack([inputs.first[channel], inputs.stimulus[n, channel]])
        first, last = stimuli * seen[field_of].T
        lag = np.where(last > state.transduction, drives.mode_rising, drives.mode_falling)  # on either side of it
        self.lag = _slopes_of_lag(lag, elapsed)  # by what was reached, by the first stimulus and by the last
        self.by_others: list[tuple[slice, Array]] = []  # of modes of a field, by what all of them had reached
        for f in np.flatnonzero(varied.number >= 0) if varied.exists else ():
            own = slice(int(drives.field_first[f]), int(drives.field_first[f + 1]))
            slope = _slope_of_field(
                again, f, state.transduction, np.array([first[own.start], last[own.start]]), elapsed
            )
            self.by_others.append((own, slope[:, :-2]))
            self.lag[0, own], self.lag[1:, own] = 0.0, slope[:, -2:].T
        if light.exists:
            modes = len(channel)
            self.by_place, self.by_kept = np.zeros((modes, again.size)), np.zeros((modes, again.kept))
            element = np.full(len(seen), -1)
            element[light.field] = np.arange(len(light.field))
            own = np.flatnonzero(element[field_of] >= 0)
            k, count = element[field_of[own]], len(light.field)
            slopes = slopes_of_parts(again, n, step)[:, :, k]
            slope = sum(self.lag[1 + i, own] * stimuli[i, own] * slopes[i] for i in range(2))
            self.by_place[own] = slope[0][:, None] * lit[k] + slope[1][:, None] * lit[count + k]
            first_kept = again.kept - 2 * count
            self.by_kept[own, first_kept + k], self.by_kept[own, first_kept + count + k] = slope[2:]
            self.lag[1:] *= seen[field_of].T


def _slopes_of_lag(lag: Array, elapsed: float) -> Array:
    """Return by what a lag was, by the first and by the last stimulus, what it is (`scene.transduction.lagged`)."""
    x = elapsed / np.where(lag > 0.0, lag, 1.0)
    part = -np.expm1(-x)
    by_last = np.where(lag > 0.0, 1.0 - part / x, 1.0)
    by_reached = np.where(lag > 0.0, 1.0 - part, 0.0)
    return np.stack([by_reached, 1.0 - by_reached - by_last, by_last])


def _slope_of_field(again: StepAgain, f: int, state: Array, stimulus: Array, elapsed: float) -> Array:
    """Return how a field depends on its modes, as they were, and on its stimulus; see `FieldDifferences`."""
    size = int(np.diff(again.problem.drives.field_first)[f])
    found = FieldDifferences(start=state.copy(), end=state.copy(), stimulus=stimulus, slope=np.zeros((size, size + 2)))
    change = CHANGE * (max(np.abs(state).max(), np.abs(stimulus).max()) or 1.0)
    differentiate_field(again.problem, found, f, elapsed, change)
    return found.slope
