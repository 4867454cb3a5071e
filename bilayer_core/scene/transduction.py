"""Transduction: how fast a material follows its stimulus, and by how much it grows.

The engine compiles these formulas (`engine.laws`).
"""

from __future__ import annotations

import math

import numpy as np


def lagged(filtered, first, last, rising, falling, dt):
    """Return the first-order lag over a time, exact for a stimulus that is linear over it.

    The solution of  T dy/dt = u - y  for u from u₀ to u₁ is, with x = dt/T and φ = (1 - exp(-x))/x,

        y(t + dt) = y + (1 - exp(-x)) (u₀ - y) + (1 - φ) (u₁ - u₀)

    It is stable for every dt and tends to u₁ for T = 0. T is one of the two time constants throughout.

    Parameters
    ----------
    filtered : float
        y at the start, in the unit of the stimulus.
    first, last : float
        u₀ and u₁, at the start and the end.
    rising, falling : float
        T >= 0 [s] where u₁ > y and elsewhere.
    dt : float
        Length of the time > 0 [s].

    Returns
    -------
    float
        y at the end.
    """
    lag = rising if last > filtered else falling
    if lag == 0.0:
        return last
    x = dt / lag
    part = -math.expm1(-x)
    return filtered + part * (first - filtered) + (1.0 - part / x) * (last - first)


def eigenstrain_of(filtered, gain, reference, saturation):
    """Return the eigenstrain of a law: linear near the reference, with a smooth limit.

    η = S tanh(g (y - y0)/S), which tends to g (y - y0) for infinite S. Its slope is g (1 - (η/S)²): g at the
    reference, 0 far from it.

    Parameters
    ----------
    filtered : float
        y, the stimulus that the material has reached.
    gain : float
        g, eigenstrain per unit of the stimulus.
    reference : float
        y0, the stimulus without eigenstrain, in its unit.
    saturation : float
        S > 0, may be infinite.
    """
    strain = gain * (filtered - reference)
    return strain if math.isinf(saturation) else saturation * math.tanh(strain / saturation)


def free_strain(filtered: np.ndarray, gain, reference, saturation) -> np.ndarray:
    """Return `eigenstrain_of` for each of some laws, shape (n,)."""
    laws = np.broadcast(filtered, gain, reference, saturation)
    return np.array([eigenstrain_of(*(float(value) for value in law)) for law in laws], dtype=float)
