"""Sums that keep what rounding cuts off.

A step of a slow or short motion may be smaller than the last digit of a coordinate. A coordinate is therefore kept as
an unevaluated sum x + r, with r at most half the last digit of x, to which displacements add up whatever their size.
"""

from __future__ import annotations

from bilayer_core.jit.kernel import exact_kernel


@exact_kernel
def add_exactly(value, low, increment):
    """Return (x, r) with x + r = value + low + increment, x the nearest number to it, as a tuple.

    Knuth's two-sum (The Art of Computer Programming 2, 4.2.2): what rounding cuts off value + (increment + low) is
    found exactly. Only `increment + low` is rounded itself, by a part of the increment or of r.
    """
    added = increment + low
    total = value + added
    part = total - value
    return total, (value - (total - part)) + (added - part)
