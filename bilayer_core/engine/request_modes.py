"""Requests that can be made of a state at rest, and of Newton's method."""

from __future__ import annotations

EVALUATE_STATE = 0
"""Evaluate the potential at the state as it stands, without second derivatives."""
SETTLE = 1
"""One round of statics: minimise the potential with inertia that wants everything to stay where it is."""
COUNT = 2
"""Count the directions in which the state is unstable, or those in which disturbances grow faster than a rate."""

EVALUATION_TIME = 1e-6
"""Time over which an evaluation sees a velocity as a displacement [s]; rounding makes 1e-10 m/s of it."""
WITHOUT_INERTIA = 1e9
"""Length of a step in which neither inertia nor dissipation counts [s]."""
SLOWEST_GROWTH = 0.1
"""Disturbances that grow more slowly count as neutral, as motions do that nothing resists [1/s]."""

MINIMUM, VALUE, NEGATIVE = 0, 1, 2
"""What Newton's method is asked for: a minimum, the potential with its gradient where it is, or there how many
eigenvalues of its Hessian are negative.
"""
