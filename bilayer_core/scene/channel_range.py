"""The range of a stimulus channel, and values that only rounding puts outside it."""

from __future__ import annotations

import math

from bilayer_core.scene.faults import ROUNDING


def value_in_range(value: float, minimum: float, maximum: float) -> float | None:
    """Return a value of a channel, or the end of the range that it passes by no more than rounding.

    A controller computes 1.0000000000000002 or -1e-17 where it means an end of the range.

    `value`, `minimum`, `maximum`: in the unit of the channel. Rounding is a difference of up to `ROUNDING` times the
    width of the range. Returns None if the value is not finite, or farther outside.
    """
    margin = ROUNDING * (maximum - minimum)
    if math.isfinite(value) and minimum - margin <= value <= maximum + margin:
        return min(max(float(value), minimum), maximum)
    return None
