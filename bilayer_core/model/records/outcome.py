"""Places in `problem.Outcome`."""

from __future__ import annotations

STATUS, PAIR, CONFIGURATION, SWAPPED, ITERATIONS, FACTORISATIONS, SETTLINGS = range(7)
"""Of counts: how it ended, the blocking pair, the configuration that is the last, whether the scratch is
the minimum, and what Newton's method needed."""
RESIDUAL, GAP, SHIFT, FRACTION, FRICTION_FRACTION, ENERGY, SIMPLIFIED = range(7)
"""Of figures: Newton's [m/s], the smallest gap [m], the multiple of the masses that was added, the fractions of a step
that keep gaps open and at which friction holds it up, energy [J], how far contacts of rods were simplified."""
COUNTS = FIGURES = 7
