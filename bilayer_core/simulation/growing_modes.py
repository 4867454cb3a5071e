"""Modes of small motions about an equilibrium that grow, where forces have no potential.

Forces that turn with what they act on, moments and a flow make the stiffness unsymmetric, and signs of
pivots tell nothing: Beck's column under a follower load of 20.05 EI/L² flutters, while its Hessian has lost its sign at
2.6. Small motions q about rest follow

    M q̈ + (C + G) q̇ + (K + L) q = 0,    q ~ e^{λt}

with the matrices of `simulation.linearised`. Modes with Re λ > 0 grow: by divergence where λ is real, by flutter where
it is not. They are found by shift and invert next to 0 (Arnoldi), where a structure is slow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import eigvals
from scipy.sparse.linalg import ArpackError, eigs

from bilayer_core.engine.request_modes import SLOWEST_GROWTH
from bilayer_core.model.model import Model
from bilayer_core.model.state import State
from bilayer_core.simulation.linearised import Linearised

Array = np.ndarray
MODES = 40
"""How many of the slowest modes are looked at."""
DENSE = 2 * MODES
"""Unknowns up to which all modes are found: with 160, that takes ten times as long as the slowest."""
ROUNDING = 1e-6
"""Part of |λ| that the real part of an undamped mode may have by rounding."""


@dataclass(frozen=True)
class Growth:
    """Modes that grow.

    Attributes
    ----------
    count : int
        How many there are; a pair that flutters counts twice.
    rate : float
        Of the one that grows fastest [1/s]; 0 if none does.
    frequency : float
        With which that one swings [Hz]; 0 if it diverges.
    """

    count: int
    rate: float
    frequency: float


def growing_modes(model: Model, state: State, load_factor: Array, within: Model | None = None) -> Growth:
    """Return which small motions about a state at rest grow.

    Parameters
    ----------
    model : Model
        In space.
    state : State
    load_factor : ndarray
        Of loads there, shape (n_load,).
    within : Model, optional
        Of the same scene in a plane: motions that do not leave it alone are asked for.
    """
    matrices = Linearised(model, state, load_factor, within)
    values = _slowest(matrices.mass, matrices.damping, matrices.stiffness)
    grows = values[values.real > np.maximum(SLOWEST_GROWTH, ROUNDING * np.abs(values))]
    if not grows.size:
        return Growth(0, 0.0, 0.0)
    fastest = grows[np.argmax(grows.real)]
    return Growth(len(grows), float(fastest.real), float(abs(fastest.imag)) / (2.0 * math.pi))


def _slowest(mass: sparse.spmatrix, damping: sparse.spmatrix, stiffness: sparse.spmatrix) -> Array:
    """Return λ of M λ² + C λ + K nearest to 0."""
    size = mass.shape[0]
    nothing, unit = sparse.csc_matrix((size, size)), sparse.identity(size, format="csc")
    left = sparse.bmat([[nothing, unit], [-stiffness, -damping]], format="csc")
    right = sparse.bmat([[unit, nothing], [nothing, mass]], format="csc")
    if size <= DENSE:
        found = eigvals(left.toarray(), right.toarray())
        return found[np.isfinite(found)]
    start = np.ones(2 * size)
    try:
        return eigs(left, MODES, right, sigma=SLOWEST_GROWTH, v0=start, return_eigenvectors=False)
    except ArpackError as error:
        return error.eigenvalues
