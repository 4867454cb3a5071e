"""Where on a Newton step friction holds it up.

A contact that comes to rest, or turns round, has its friction changed by up to 2 μ λ within a slip of 2 ε_v h, mostly
far less than a step: second derivatives at its beginning do not know of that. A full step goes beyond the minimum, one
from there comes back, and halves of it end anywhere but where the contact rests. Along a straight step, however,
friction is known. With the potential φ, the step s, the contacts' D (`forces.friction`) and the exact Hessian H,

    φ′(α) ≈ φ′(0) + α (sᵀ H s − Σ D″(0)) + Σ (D′(α) − D′(0)),   sᵀ H s = −φ′(0)

grows with α, and the step ends where it is zero, at rest of one contact, mostly; from there on H knows of it. Slip of a
contact grows in proportion to α (bodies that turn do so nearly): its *way* is, with u·a and u·s as in
`forces.friction`,

    u·a, δu·a, u·s, δu·s, μ₊², μ₋², μ_s², λ, μ h
"""

from __future__ import annotations

import math

from ..contact.friction_law import friction_over_speed, friction_slope
from ..jit import kernel

WAY = 9
"""Numbers of a contact's way."""
PASSED = 0.1
"""Of −φ′(0): no step ends before a smaller slope than this."""
MAX_HALVINGS = 50


@kernel
def _rate(way, k, fraction):
    """D′ of a contact, and what its speed and the square of its slip are there."""
    forward, side = way[k, 0] + fraction * way[k, 1], way[k, 2] + fraction * way[k, 3]
    ca, cs, scale = way[k, 4] if forward >= 0.0 else way[k, 5], way[k, 6], way[k, 8]
    speed = math.sqrt(ca * forward * forward + cs * side * side) / scale
    work = ca * forward * way[k, 1] + cs * side * way[k, 3]
    return speed, work, ca * way[k, 1] ** 2 + cs * way[k, 3] ** 2


@kernel
def _force_along(count, way, threshold, fraction):
    """Σ D′(α) [J]"""
    total = 0.0
    for k in range(count):
        speed, work, _ = _rate(way, k, fraction)
        total += way[k, 7] * friction_over_speed(speed, threshold) / way[k, 8] * work
    return total


@kernel
def _curvature(count, way, threshold):
    """Σ D″(0) [J]"""
    total = 0.0
    for k in range(count):
        speed, work, square = _rate(way, k, 0.0)
        load, scale, ratio = way[k, 7], way[k, 8], friction_over_speed(speed, threshold)
        total += load * ratio / scale * square
        if speed > 0.0:
            total += load * (friction_slope(speed, threshold) - ratio) / (speed * speed * scale**3) * work * work
    return total


@kernel
def held_up(count, way, threshold, slope, bound):
    """Fraction of a step, at most `bound`, at which friction holds it up.

    Parameters
    ----------
    count : int
        Number of contacts.
    way : Array
        Of contacts, shape (≥ count, `WAY`).
    threshold : float
        ε_v [m/s].
    slope : float
        φ′(0) ≤ 0 [J], of a step with the exact Hessian.
    bound : float
    """
    enough = PASSED * -slope
    other = max(-slope - _curvature(count, way, threshold), 0.0)
    rest = slope - _force_along(count, way, threshold, 0.0)
    if rest + bound * other + _force_along(count, way, threshold, bound) <= enough:
        return bound
    low, high, middle = 0.0, bound, 0.5 * bound
    for _ in range(MAX_HALVINGS):
        middle = 0.5 * (low + high)
        present = rest + middle * other + _force_along(count, way, threshold, middle)
        if abs(present) <= enough:
            break
        if present > 0.0:
            high = middle
        else:
            low = middle
    return middle
