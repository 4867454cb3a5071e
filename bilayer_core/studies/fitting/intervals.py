"""Intervals of fitted parameters, from the Jacobian J of weighted residuals at the solution.

Where the noise of the data is known, residuals are divided by its standard deviation, the covariance is (Jᵀ J)⁻¹ and
half an interval is 1.96 standard deviations. Where it is not, s² = |r|²/(n − p) estimates it, the covariance is
s² (Jᵀ J)⁻¹ and half an interval has Student's t with n − p degrees of freedom. In no case is s taken smaller than the
numerical noise of the runs. All this is linear: it holds as far as runs change in proportion within the intervals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

Array = np.ndarray
LEVEL = 0.95
"""Share of intervals that cover the truth."""


@dataclass(frozen=True)
class Spread:
    """How well parameters are known.

    Attributes
    ----------
    covariance : ndarray
        In parts of the way between bounds, shape (parameters, parameters).
    wide : float
        Half width of intervals, in standard deviations.
    noise : float
        Of weighted residuals: s, or 1 where the noise of the data is known.
    freedom : int
        Degrees of freedom, n − p.
    """

    covariance: Array
    wide: float
    noise: float
    freedom: int

    @property
    def deviations(self) -> Array:
        """Standard deviations, shape (parameters,)."""
        found: Array = np.sqrt(np.diag(self.covariance))
        return found

    @property
    def correlations(self) -> Array:
        """Shape (parameters, parameters)."""
        scale = np.where(self.deviations > 0.0, self.deviations, 1.0)
        found: Array = self.covariance / np.outer(scale, scale)
        np.fill_diagonal(found, 1.0)
        return found


def spread_of(matrix: Array, residuals: Array, known: bool, numerical_noise: float) -> Spread:
    """Return how well the parameters of a Jacobian of full rank are known.

    Parameters
    ----------
    matrix : ndarray
        Shape (residuals, parameters).
    residuals : ndarray
        Weighted, shape (residuals,).
    known : bool
        Whether their noise is 1 by the weights.
    numerical_noise : float
        Of weighted residuals.
    """
    freedom = matrix.shape[0] - matrix.shape[1]
    noise = 1.0 if known else float(np.sqrt(residuals @ residuals / freedom))
    upper = 0.5 + 0.5 * LEVEL
    wide = float(ndtri(upper)) if known else float(stdtrit(freedom, upper))
    inverse = np.linalg.pinv(matrix, rcond=0.0)
    return Spread(max(noise, numerical_noise) ** 2 * (inverse @ inverse.T), wide, noise, freedom)
