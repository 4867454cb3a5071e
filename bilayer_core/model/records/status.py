"""How steps end, or what keeps them from going on."""

from __future__ import annotations

READY = 0
PAIR_CAPACITY_EXCEEDED = 1
"""There are more near pairs with surfaces than capacity for them."""
ROD_CAPACITY_EXCEEDED = 2
"""Likewise of rods with rods, or more contacts."""
BORDER_CAPACITY_EXCEEDED = 3
"""Contacts of rods have more columns than the border has capacity for."""
INPUTS_END = 4
"""What acts from outside is not known as far as the step reaches."""
PAUSED = 6
"""Newton's method has made as many passes as were allowed for now."""
CONVERGED, MAX_ITERATIONS, LINE_SEARCH, INDEFINITE, NOT_FINITE, BLOCKED, BEYOND, UNSETTLED, COLLAPSED, CROSSED = (
    5,
    10,
    11,
    12,
    13,
    14,
    15,
    16,
    17,
    18,
)
"""How a step ended; from `MAX_ITERATIONS` on it failed."""
TOO_INACCURATE = 20
"""The error of a step exceeds its tolerance, however short it is."""
GAINS_ENERGY = 21
"""A step makes energy."""
