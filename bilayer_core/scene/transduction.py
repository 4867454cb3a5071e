"""Transduction: how fast a material follows its stimulus, and by how much it grows."""

from __future__ import annotations

import numpy as np


def follow(
    filtered: np.ndarray, first: np.ndarray, last: np.ndarray, rising: np.ndarray, falling: np.ndarray, dt: float
) -> np.ndarray:
    """First-order lag over a time, exact for a stimulus that is linear over it.

    The solution of  T dy/dt = u - y  for u from u₀ to u₁ is, with x = dt/T and φ = (1 - exp(-x))/x,

        y(t + dt) = y + (1 - exp(-x)) (u₀ - y) + (1 - φ) (u₁ - u₀)

    It is stable for every dt and tends to u₁ for T = 0. T is one of the two time constants throughout.

    Parameters
    ----------
    filtered : ndarray
        y at the start, in the unit of the stimulus.
    first, last : ndarray
        u₀ and u₁, at the start and the end, of the same shape.
    rising, falling : ndarray
        T >= 0 [s] where u₁ > y and elsewhere, of the same shape.
    dt : float
        Length of the time > 0 [s].

    Returns
    -------
    ndarray
        y at the end.
    """
    with np.errstate(divide="ignore"):
        x = dt / np.where(last > filtered, rising, falling)
    part = -np.expm1(-x)
    return filtered + part * (first - filtered) + (1.0 - part / x) * (last - first)


def free_strain(filtered: np.ndarray, gain: np.ndarray, reference: np.ndarray, saturation: np.ndarray) -> np.ndarray:
    """Eigenstrain of each law: linear near the reference, with a smooth limit.

    η = S tanh(g (y - y0)/S), which tends to g (y - y0) for infinite S. Its slope is g (1 - (η/S)²): g at the
    reference, 0 far from it.

    Parameters
    ----------
    filtered : ndarray
        y, the stimulus that the material has reached.
    gain : ndarray
        g, eigenstrain per unit of the stimulus.
    reference : ndarray
        y0, the stimulus without eigenstrain, in its unit.
    saturation : ndarray
        S > 0, may be infinite.
    """
    strain = gain * (filtered - reference)
    limited = np.isfinite(saturation)
    strain[limited] = saturation[limited] * np.tanh(strain[limited] / saturation[limited])
    return strain
