"""Derivatives of what modes of materials have reached of stimuli at a point of a step."""

from __future__ import annotations

import numpy as np

from bilayer_core.scene.transduction import lagged
from bilayer_core.simulation.gradients.step_again import KeptStep, StepAgain

Array = np.ndarray


def lags(again: StepAgain, n: int, step: KeptStep, channels: Array) -> Array:
    """Return what each mode, of some channels, takes at point n of a step of what it had reached at its start, of the
    first stimulus and of that at the point, shape (3, n_mode).
    """
    drives, inputs, state = again.problem.drives, again.inputs, step.start
    found = np.zeros((3, len(channels)))
    for m, channel in enumerate(channels):
        own = state.transduction[m], inputs.first[channel], inputs.stimulus[n, channel]
        both = float(drives.mode_rising[m]), float(drives.mode_falling[m])
        lag = both[0] if own[2] > own[0] else both[1]  # on either side of it
        for k in range(3):
            unit = [float(j == k) for j in range(3)]
            found[k, m] = lagged(*unit, lag, lag, float(inputs.elapsed[n]))
    return found
