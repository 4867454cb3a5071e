"""Places in `problem.Outcome`."""

from __future__ import annotations

STATUS, PAIR, CONFIGURATION, SWAPPED, ITERATIONS, FACTORISATIONS, SETTLINGS, GAINS, REGULARISED = range(9)
"""Of counts: how it ended, the blocking pair, the configuration that is the last, whether the scratch is
the minimum, what Newton's method needed, whether the step makes energy, and how many matrices were regularised."""
RESIDUAL, GAP, SHIFT, FRACTION, FRICTION_FRACTION, ENERGY, SIMPLIFIED, CONTACT_ERROR, LIGHT_ERROR, GAINED = range(10)
"""Of figures: Newton's [m/s], the smallest gap [m], the multiple of the masses that was added, the fractions of a step
that keep gaps open and at which friction holds it up, energy [J], how far contacts of rods were simplified,
the error of the energy of contacts [J], that which light was wrong by, as a part of the longest rod,
and what steps have made of energy, over what they may."""
COUNTS, FIGURES = 9, 10
