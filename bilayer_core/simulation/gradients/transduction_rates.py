"""Derivatives of what modes of materials have reached of stimuli at a point of a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.scene.transduction import lagged
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain

if TYPE_CHECKING:
    from bilayer_core.simulation.gradients.step_rates import Inputs, Rates

Array = np.ndarray


class TransductionRates:
    """Maps from what modes had reached at the start of a step, and from stimuli, to what they reach at its point n."""

    def __init__(self, again: StepAgain, n: int, step: KeptStep):
        drives, inputs, state = again.problem.drives, again.inputs, step.start
        self._point, self._channel = n, np.repeat(drives.field_channel, np.diff(drives.field_first))
        self._lag = np.zeros((3, len(self._channel), 1))  # by what was reached, by the first stimulus and by the last
        for m, channel in enumerate(self._channel):
            own = state.transduction[m], inputs.first[channel], inputs.stimulus[n, channel]
            lags = float(drives.mode_rising[m]), float(drives.mode_falling[m])
            lag = lags[0] if own[2] > own[0] else lags[1]  # on either side of it
            for k in range(3):
                unit = [float(j == k) for j in range(3)]
                self._lag[k, m] = lagged(*unit, lag, lag, float(inputs.elapsed[n]))

    def forward(self, start: Rates, acts: Inputs) -> Array:
        """Return rates of what is reached."""
        found = self._lag[0] * start.reached
        if len(self._channel):
            found += self._lag[1] * acts.first[self._channel]
            found += self._lag[2] * acts.stimulus[self._point, self._channel]
        return found

    def backward(self, reached: Array, start: Rates, acts: Inputs) -> None:
        """Add derivatives by what they come from."""
        start.reached += self._lag[0] * reached
        if len(self._channel):
            np.add.at(acts.first, self._channel, self._lag[1] * reached)
            np.add.at(acts.stimulus[self._point], self._channel, self._lag[2] * reached)
