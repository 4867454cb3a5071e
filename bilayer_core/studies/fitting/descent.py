"""Descent to the least sum of squares within bounds.

Each step minimises |r + J δ|² + λ² Σ (|J_k| δ_k)² within the bounds, with J_k the columns of J, first with λ = 0
(Gauss and Newton). A step that makes the sum no smaller is made again with a larger λ (Levenberg, Marquardt).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

Array = np.ndarray
SMALLEST_CHANGE = 1e-8
"""Of parameters, in parts of the way between bounds, and of the sum of squares, relative: smaller ones end a fit."""
CLOSE = 1e-2
"""Change of residuals by another step, in the standard deviation of noise (the relative offset of Bates and Watts,
Technometrics 23 (1981), 179): parameters are as near to the solution, in their standard deviations."""
MOST_EVALUATIONS = 200
"""Of the sum of squares, those for derivatives not counted."""
FIRST_DAMPING, STRONGER = 0.1, 4.0
"""λ once a step leads up, and its factor."""
ROOM = 1e-15
"""Part of the way between bounds by which a step may leave them, as its solver asks for some."""


@dataclass(frozen=True)
class Descent:
    """Where a descent ended.

    Attributes
    ----------
    parts : ndarray
        Parts of the way between bounds, shape (n,).
    residuals : ndarray
        There.
    matrix : ndarray
        Their Jacobian, from before the last step if that was a short one.
    converged : bool
    termination : str
    """

    parts: Array
    residuals: Array
    matrix: Array
    converged: bool
    termination: str


def descend(
    residuals: Callable[[Array], Array], derivatives: Callable[[Array], Array], start: Array, noise: float | None
) -> Descent:
    """Go to the least sum of squares near a start.

    Parameters
    ----------
    residuals : callable
        Returns residuals at some parts, not finite where there are none.
    derivatives : callable
        Returns their Jacobian.
    start : ndarray
        Parts of the way between bounds, from 0 to 1, shape (n,).
    noise : float or None
        Standard deviation of residuals; None if they tell it.

    Returns
    -------
    Descent
    """
    at, left, damping = start, residuals(start), 0.0
    matrix, evaluations = derivatives(at), 1
    while evaluations < MOST_EVALUATIONS:
        is_last = not damping and _is_close(matrix, left, at, noise)
        tried = _step(matrix, left, at, damping)
        if np.abs(tried - at).max() <= SMALLEST_CHANGE:
            return Descent(at, left, matrix, True, "the parameters change no more")
        found, evaluations = residuals(tried), evaluations + 1
        is_lower = found @ found < left @ left
        is_small = is_lower and left @ left - found @ found <= SMALLEST_CHANGE * (left @ left)
        if is_lower:
            at, left = tried, found
        if is_last:
            return Descent(at, left, matrix, True, "the last step was within a hundredth of standard deviations")
        if not is_lower:
            damping = max(STRONGER * damping, FIRST_DAMPING)
            continue
        damping = damping / STRONGER if damping > FIRST_DAMPING else 0.0
        matrix = derivatives(at)
        if is_small:
            return Descent(at, left, matrix, True, "the sum of squares changes no more")
    return Descent(at, left, matrix, False, "not converged after as many evaluations as a fit may make")


def _step(matrix: Array, left: Array, at: Array, damping: float) -> Array:
    """Return the parts after a step."""
    held = np.diag(damping * np.linalg.norm(matrix, axis=0)) if damping else np.zeros((0, at.size))
    wanted = np.concatenate([-left, np.zeros(len(held))])
    room = (-at - ROOM, 1.0 - at + ROOM)
    return np.clip(at + lsq_linear(np.concatenate([matrix, held]), wanted, room, tol=1e-12).x, 0.0, 1.0)


def _is_close(matrix: Array, left: Array, at: Array, noise: float | None) -> bool:
    """Return whether another step would change residuals by little of their noise."""
    slope = matrix.T @ left
    free = ~(((at <= 0.0) & (slope > 0.0)) | ((at >= 1.0) & (slope < 0.0)))
    q, _ = np.linalg.qr(matrix[:, free])
    seen = q.T @ left
    if noise is None:
        noise = float(np.linalg.norm(left - q @ seen)) / np.sqrt(left.size - seen.size)
    return bool(np.linalg.norm(seen) <= CLOSE * noise * np.sqrt(seen.size))
