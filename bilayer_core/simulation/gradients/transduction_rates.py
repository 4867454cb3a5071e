"""Derivatives of what modes of materials have reached of stimuli at a point of a step."""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.varied_diffusion import FieldDifferences, differentiate_field
from bilayer_core.scene.transduction import lagged
from bilayer_core.simulation.gradients.light_rates import slopes_of_parts
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain

Array = np.ndarray
CHANGE = 1e-6
"""Of a stimulus, over what is reached and asked for, by which varied diffusion is differentiated."""


class TransductionRates:
    """Maps from what modes had reached at the start of a step, and from stimuli, to what they reach at its point n."""

    def __init__(self, again: StepAgain, n: int, step: KeptStep, lit: Array):
        drives, inputs, state = again.problem.drives, again.inputs, step.start
        self._channel = np.repeat(drives.field_channel, np.diff(drives.field_first))
        self.lag = np.zeros((3, len(self._channel), 1))  # by what was reached, by the first stimulus and by the last
        self.by_others: list[tuple[slice, Array]] = []  # of modes of a field, by what all of them had reached
        light, modes = again.problem.light, len(self._channel)
        seen = light.seen if light.exists else np.ones((len(drives.field_channel), 2))
        varied, elapsed = again.problem.varied_fields, float(inputs.elapsed[n])
        for f, channel in enumerate(drives.field_channel):
            own = slice(int(drives.field_first[f]), int(drives.field_first[f + 1]))
            first, last = inputs.first[channel] * seen[f, 0], inputs.stimulus[n, channel] * seen[f, 1]
            if varied.exists and varied.number[f] >= 0:
                slope = _slope_of_field(again, f, state.transduction, np.array([first, last]), elapsed)
                self.by_others.append((own, slope[:, :-2]))
                self.lag[1:, own, 0] = slope[:, -2:].T
                continue
            for m in range(own.start, own.stop):
                rises = last > state.transduction[m]
                lag = float((drives.mode_rising if rises else drives.mode_falling)[m])  # on either side of it
                for k in range(3):
                    unit = [float(j == k) for j in range(3)]
                    self.lag[k, m] = lagged(*unit, lag, lag, elapsed)

        self.by_place, self.by_kept = np.zeros((modes, again.size)), np.zeros((modes, again.kept))
        if light.exists:
            field_of = np.repeat(np.arange(len(seen)), np.diff(drives.field_first))
            element = np.full(len(seen), -1)
            element[light.field] = np.arange(len(light.field))
            own = np.flatnonzero(element[field_of] >= 0)
            k, count = element[field_of[own]], len(light.field)
            stimuli = inputs.first[self._channel[own]], inputs.stimulus[n, self._channel[own]]
            slopes = slopes_of_parts(again, n, step)[:, :, k]
            slope = sum(self.lag[1 + i, own, 0] * stimuli[i] * slopes[i] for i in range(2))
            self.by_place[own] = slope[0][:, None] * lit[k] + slope[1][:, None] * lit[count + k]
            first_kept = len(again.speeds)
            self.by_kept[own, first_kept + k], self.by_kept[own, first_kept + count + k] = slope[2:]
            self.lag[1:, :, 0] *= seen[field_of].T


def _slope_of_field(again: StepAgain, f: int, state: Array, stimulus: Array, elapsed: float) -> Array:
    """Return how a field depends on its modes, as they were, and on its stimulus; see `FieldDifferences`."""
    size = int(np.diff(again.problem.drives.field_first)[f])
    found = FieldDifferences(start=state.copy(), end=state.copy(), stimulus=stimulus, slope=np.zeros((size, size + 2)))
    change = CHANGE * (max(np.abs(state).max(), np.abs(stimulus).max()) or 1.0)
    differentiate_field(again.problem, found, f, elapsed, change)
    return found.slope
