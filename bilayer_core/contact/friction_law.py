"""Smoothed Coulomb friction: f₁(v) = 2v/ε − v²/ε² below the threshold ε, 1 above (Li et al. 2020, eq. 13).

(The paper prints v/ε for 2v/ε, which is zero at the threshold.) f₀ is its integral: a dissipation potential.
"""

from __future__ import annotations

from bilayer_core.jit import kernel


@kernel
def friction_potential(v, threshold):
    """Return f₀(v) = v²/ε − v³/(3ε²), continued by v − ε/3 [m/s]."""
    if v >= threshold:
        return v - threshold / 3.0
    return v * v / threshold * (1.0 - v / (3.0 * threshold))


@kernel
def friction_over_speed(v, threshold):
    """Return f₁(v)/v, finite at rest [s/m]."""
    if v >= threshold:
        return 1.0 / v
    return (2.0 - v / threshold) / threshold


@kernel
def friction_slope(v, threshold):
    """Return f₁′(v) [s/m]."""
    if v >= threshold:
        return 0.0
    return 2.0 * (1.0 - v / threshold) / threshold
