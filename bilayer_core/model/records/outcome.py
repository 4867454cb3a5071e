"""Places in `problem.Outcome`."""

from __future__ import annotations

DONE, STATUS, PAIR, PLACE, SWAPPED, ITERATIONS, FACTORISATIONS, BACKTRACKS = range(8)
"""Of counts: steps made, how it ended, the blocking pair, the configuration that is the last, whether the scratch is
the minimum, and what Newton's method needed."""
RESIDUAL, LARGEST_RESIDUAL, GAP, SHIFT, HELD_UP, ENERGY, SIMPLIFIED = range(7)
"""Of figures: Newton's [m/s], the largest of several steps, the smallest gap [m], the multiple of the masses that was
added, the fraction of a step at which friction holds it up, energy [J], how far contacts of rods were simplified."""
COUNTS, FIGURES = 8, 7
