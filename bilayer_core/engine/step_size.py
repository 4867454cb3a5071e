"""How long the next step is to be, from the errors of the last two and from what Newton did.

With the error E of a step as a part of the tolerance, and E ∝ hᵏ, k one more than the order of the integrator:

    accepted   h ← 0.9 h Eₙ^(−3/5k) Eₙ₋₁^(1/5k)      Söderlind's PI controller 4.2 (2003, ACM Trans. Math. Softw. 29)
    rejected   h ← 0.9 h Eₙ^(−1/k)
    no solution   h ← ½ h

An accepted step is followed by one at most `LARGEST_GROWTH` times as long, and by none longer where Newton has needed
many iterations, or where the step had to be shortened first.
"""

from __future__ import annotations

import sys

from bilayer_core.jit.kernel import kernel

SAFETY = 0.9
PROPORTIONAL, INTEGRAL = 0.6, 0.2
SMALLEST_FACTOR, LARGEST_GROWTH = 0.2, 2.5
LEAST_ERROR = 1e-4
"""Part of the tolerance below which an error is no sign of how far the next step may reach."""
FAILURE_FACTOR = 0.5
MANY_ITERATIONS = 15
"""Newton iterations of a stage that are no reason to lengthen steps; with twice as many they are halved."""
GROWTH_LIMIT = 1.05
"""By which a step is lengthened to end where it must; the safety above covers it."""
BEYOND = 1.01 * GROWTH_LIMIT
"""By which a step is lengthened at most, and rounding."""
LONG_STEP = 0.02
"""Up to which Newton's tolerance is a speed [s]. In longer steps it is the displacement that this makes in one of this
length: else what rests would creep for as long as a step may be."""
NUMBER_ROUNDING = 4.0 * sys.float_info.epsilon
"""Part of a time by which a sum of steps may be off."""


@kernel
def after_success(order, h, error, error_before, iterations, shortened):
    """Return the length of the step after one that was accepted [s].

    Parameters
    ----------
    order : int
        Of the integrator.
    h : float
        Length of the step [s].
    error, error_before : float
        Its error, and that of the step before it, as parts of the tolerance; the latter is 0 if there is none.
    iterations : float
        Of Newton's in a stage.
    shortened : bool
        Whether it was tried with another length before.
    """
    k = order + 1
    now = max(error, LEAST_ERROR)
    before = max(error_before, LEAST_ERROR) if error_before > 0.0 else now
    factor = SAFETY * now ** (-PROPORTIONAL / k) * before ** (INTEGRAL / k)
    most = min(1.0 if shortened else LARGEST_GROWTH, max(MANY_ITERATIONS / max(iterations, 1.0), FAILURE_FACTOR))
    return h * min(max(factor, SMALLEST_FACTOR), most)


@kernel
def after_rejection(order, h, error):
    """Return the length of the next attempt after one whose error, as a part of the tolerance, exceeds 1 [s]."""
    return h * max(SAFETY * error ** (-1.0 / (order + 1)), SMALLEST_FACTOR)


@kernel
def fit(h, left):
    """Return a length near `h` with which steps end after exactly `left` [s], without a short last step."""
    if left <= GROWTH_LIMIT * h:
        return left
    return 0.5 * left if left < 2.0 * h else h


@kernel
def tolerance_in(h, newton_tolerance):
    """Return what Newton's last correction may be in a step [m/s], from what it may be in one that is not long."""
    return newton_tolerance * min(1.0, LONG_STEP / h)


@kernel
def reach(planned):
    """Return a length that no step exceeds which is planned to be so long [s]."""
    return BEYOND * planned
