"""Integrals of functions that are known at any point."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Array = np.ndarray


def simpson(
    function: Callable[[float], Array],
    interval: tuple[float, float],
    values: tuple[Array, Array, Array],
    tolerance: float,
    halvings: int,
) -> Array:
    """Return the integral by Simpson's rule, on halves where two of them differ from the whole by too much.

    Parameters
    ----------
    function : callable
        Of one variable, to arrays.
    interval : tuple of float
        Its two ends.
    values : tuple of Array
        Of the function at the first end, in the middle, at the other end.
    tolerance : float
        Largest error of any component, estimated as a fifteenth of the difference.
    halvings : int
        At most; what is left then is taken as it is.
    """
    (a, b), (first, middle, last) = interval, values
    centre, size = 0.5 * (a + b), b - a
    left, right = function(a + 0.25 * size), function(a + 0.75 * size)
    whole = size / 6.0 * (first + 4.0 * middle + last)
    halves = size / 12.0 * (first + 4.0 * left + 2.0 * middle + 4.0 * right + last)
    difference = halves - whole
    if halvings == 0 or np.abs(difference).max() <= 15.0 * tolerance:
        return halves + difference / 15.0
    parts = (((a, centre), (first, left, middle)), ((centre, b), (middle, right, last)))
    return sum(simpson(function, part, three, 0.5 * tolerance, halvings - 1) for part, three in parts)
