"""How a loop ends, or what keeps it from going on by itself."""

from __future__ import annotations

from ..solve.newton import NewtonStatus

READY = 0
NO_ROOM = 1
"""There are more near pairs than room for them."""
RODS_FAR = 2
"""Rods have moved farther than their list of near pairs reaches."""
RODS_TOUCH = 3
JUMPED = 4
"""Something has jumped: another integrator has to make this step."""
CONVERGED, MAX_ITERATIONS, LINE_SEARCH, INDEFINITE, NOT_FINITE, BLOCKED = 5, 10, 11, 12, 13, 14
"""How Newton ended; from `MAX_ITERATIONS` on it failed."""

FAILURES = {
    MAX_ITERATIONS: NewtonStatus.MAX_ITERATIONS,
    LINE_SEARCH: NewtonStatus.LINE_SEARCH,
    INDEFINITE: NewtonStatus.INDEFINITE,
    NOT_FINITE: NewtonStatus.NOT_FINITE,
    BLOCKED: NewtonStatus.BLOCKED,
}
