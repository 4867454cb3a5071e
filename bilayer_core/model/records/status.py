"""How a loop ends, or what keeps it from going on by itself."""

from __future__ import annotations

READY = 0
NO_ROOM = 1
"""There are more near pairs with surfaces than room for them."""
NO_ROOM_FOR_RODS = 2
"""Likewise of rods with rods, or more contacts."""
NO_ROOM_IN_BORDER = 3
"""Contacts of rods have more columns than the border has room for."""
INPUTS_END = 4
"""What acts from outside is not known as far as the step reaches."""
CONVERGED, MAX_ITERATIONS, LINE_SEARCH, INDEFINITE, NOT_FINITE, BLOCKED, BEYOND = 5, 10, 11, 12, 13, 14, 15
"""How a step ended; from `MAX_ITERATIONS` on it failed."""
TOO_INACCURATE = 20
"""The error of a step exceeds its tolerance, however short it is."""
