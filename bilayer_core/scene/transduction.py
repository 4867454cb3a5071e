"""Transduction: how fast a material follows its stimulus."""

from __future__ import annotations

import numpy as np


def follow(filtered: np.ndarray, target: np.ndarray, time_constant: np.ndarray, dt: float) -> np.ndarray:
    """First-order lag over one step, exact for a stimulus that is held over the step.

    The solution of  T dy/dt = u - y  is  y(t + dt) = y + (1 - exp(-dt/T)) (u - y); it is stable for every dt
    and tends to y = u for T = 0.

    Parameters
    ----------
    filtered : ndarray
        y at the start of the step, in the unit of the stimulus.
    target : ndarray
        u, the stimulus held over the step, of the same shape.
    time_constant : ndarray
        T >= 0 [s], of the same shape.
    dt : float
        Length of the step > 0 [s].

    Returns
    -------
    ndarray
        y at the end of the step.
    """
    with np.errstate(divide="ignore"):
        part = -np.expm1(-dt / np.asarray(time_constant, dtype=float))
    return filtered + part * (np.asarray(target) - filtered)
