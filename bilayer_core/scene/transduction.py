"""Transduction: how fast a material follows its stimulus, and by how much it grows."""

from __future__ import annotations

import numpy as np


def follow(filtered: np.ndarray, target: np.ndarray, rising: np.ndarray, falling: np.ndarray, dt: float) -> np.ndarray:
    """First-order lag over one step, exact for a stimulus that is held over the step.

    The solution of  T dy/dt = u - y  is  y(t + dt) = y + (1 - exp(-dt/T)) (u - y); it is stable for every dt
    and tends to y = u for T = 0. It never crosses u, so T is one of the two throughout.

    Parameters
    ----------
    filtered : ndarray
        y at the start of the step, in the unit of the stimulus.
    target : ndarray
        u, the stimulus held over the step, of the same shape.
    rising, falling : ndarray
        T >= 0 [s] where u > y and elsewhere, of the same shape.
    dt : float
        Length of the step > 0 [s].

    Returns
    -------
    ndarray
        y at the end of the step.
    """
    way = np.asarray(target) - filtered
    with np.errstate(divide="ignore"):
        part = -np.expm1(-dt / np.where(way > 0.0, rising, falling))
    return filtered + part * way


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
