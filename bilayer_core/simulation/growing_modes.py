"""Modes of small motions about an equilibrium that grow, where forces have no potential.

Forces that turn with what they act on, moments and a flow make the stiffness unsymmetric, and signs of
pivots tell nothing: Beck's column under a follower load of 20.05 EI/L² flutters, while its Hessian has lost its sign at
2.6. Small motions q about rest follow

    M q̈ + C q̇ + (K + L) q = 0,    q ~ e^{λt}

K and M are the Hessian and the mass matrix that Newton's method has, C that of what depends on velocities (damping,
viscosity, drag, friction). L is what K lacks: ∂/∂z of forces that are held at a configuration z while Newton goes on
(differences of their gradients, of these forces alone, so that stiff elasticity does not hide them). A moment M that
acts on the body whose turn φ is the unknown has besides −½ [M]× : its power is M·ω, ω the turn's rate in space, and
∂ω/∂φ̇ = 1 + ½ [φ]× + …. The momentum of a flow about added mass is not in it: such scenes are not for this.

Modes with Re λ > 0 grow: by divergence where λ is real, by flutter where it is not. They are found by shift and invert
next to 0 (Arnoldi), where a structure is slow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import eigvals
from scipy.sparse.linalg import ArpackError, eigs

from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.engine.request_modes import SLOWEST_GROWTH
from bilayer_core.model.force_list import Kind, kinds
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import Configuration
from bilayer_core.model.state import State

Array = np.ndarray
HELD = ("followers", "moments", "drag")
"""Forces that are held at a configuration while Newton's method goes on."""
STEP = 1e-6
"""Of the longest rod, or of one radian: differences of the configuration at which such forces are held."""
MODES = 40
"""How many of the slowest modes are looked at."""
DENSE = 2 * MODES
"""Unknowns up to which all modes are found: with 160, that takes ten times as long as the slowest."""
ROUNDING = 1e-6
"""Part of |λ| that the real part of an undamped mode may have by rounding."""
LONG = 1e9
"""Length of a stage over which nothing depends on velocities [s]."""


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
    matrices = _Linearised(model, state, load_factor, within)
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


class _Linearised:
    """Mass, damping and stiffness about a state, of the unknowns that are free."""

    def __init__(self, model: Model, state: State, load_factor: Array, within: Model | None):
        self._model, self._load_factor = model, load_factor
        self._evaluator = evaluator = Evaluator(model)
        self._at: Configuration = evaluator.new()
        evaluator.take_state(state, self._at)
        self._state, self._rest = state, evaluator.rest_strains_of(state.transduction)
        self._chosen = self._free_motions(within)
        of_kind = {kind: [name for name in model.forces if kinds()[name] is kind] for kind in Kind}
        held = [name for name in HELD if name in model.forces]
        self.stiffness = self._matrix(of_kind[Kind.CONSERVATIVE] + of_kind[Kind.EXTERNAL], LONG)
        self.damping = self._matrix(of_kind[Kind.DISSIPATIVE], 1.0)
        self.mass = self._matrix(of_kind[Kind.INERTIAL], 1.0)
        self.stiffness = self.stiffness + self._derivative_of_held(held)

    def _free_motions(self, within: Model | None) -> sparse.csc_matrix:
        """Return what unknowns and bodies do in each motion that is possible, a column each."""
        model = self._model
        size, freedom = model.layout.size, (within or model).free_bodies.freedom
        fixed = np.zeros(size, dtype=bool)
        fixed[(model.layout.attached[:, None] + np.arange(3)).ravel()] = True
        columns = sparse.identity(size, format="lil")
        if model.joins.exists:
            for first, copy in zip(model.joins.first, model.joins.copy, strict=True):
                columns[copy, first] = 1.0
                fixed[copy] = True
        free = columns.tocsc()[:, np.flatnonzero(~fixed)]
        if within is not None:
            free = self._in_plane(columns.tocsc(), fixed, within.rods.axes)
        return sparse.block_diag([free, sparse.csc_matrix(freedom)], format="csc")

    def _in_plane(self, columns: sparse.csc_matrix, fixed: Array, axes: Array) -> sparse.csc_matrix:
        """Return the motions of free nodes along the axes of a plane, shape (2, 3)."""
        first = self._model.layout.node
        first = first[~fixed[first]]
        return sparse.hstack(
            [sum(axis[c] * columns[:, first + c] for c in range(3)) for axis in axes],
            format="csc",
        )

    def _stand(self, length: float) -> None:
        evaluator, rest = self._evaluator, self._rest
        evaluator.stand_still(self._state, self._at, length, rest.edge, rest.joint, self._load_factor)
        evaluator.start_stage(self._at)

    def _matrix(self, forces: list[str], length: float) -> sparse.csc_matrix:
        """Return the second derivatives of forces over a stage of that length, times it for those of velocities."""
        size = self._model.layout.size
        self._stand(length)
        self._evaluator.evaluate(self._at, forces, second=True)
        band, border, corner = self._evaluator.assemble(self._at)
        rows = range(min(band.shape[1], size))
        lower = sparse.diags([band[: size - r, r] for r in rows], [-r for r in rows], format="csc")
        whole = lower + sparse.tril(lower, -1).T
        if corner.size:
            whole = sparse.bmat([[whole, border], [border.T, corner]], format="csc")
        return self._reduced(whole)

    def _reduced(self, whole: sparse.spmatrix) -> sparse.csc_matrix:
        return sparse.csc_matrix(self._chosen.T @ whole @ self._chosen)

    def _derivative_of_held(self, forces: list[str]) -> sparse.csc_matrix:
        """Return ∂/∂z of the gradient of forces that are held at z."""
        evaluator, model = self._evaluator, self._model
        size, bodies = model.layout.size, 6 * len(model.free_bodies.mass)
        span = max(rod.path.length for rod in model.scene.rods)
        moved, begins, rows, values = evaluator.new(), [0], [], []
        self._stand(LONG)
        is_length = np.zeros(size, dtype=bool)
        is_length[(model.layout.node[:, None] + np.arange(3)).ravel()] = True
        for j in range(size + bodies):
            step = STEP * (span if (is_length[j] if j < size else (j - size) % 6 < 3) else 1.0)
            both = []
            for sign in (1.0, -1.0):
                unit = np.zeros(size + bodies)
                unit[j] = sign * step
                evaluator.move(self._at, unit[:size], unit[size:].reshape(-1, 6), moved)
                evaluator.update_lagged(moved)
                evaluator.evaluate(self._at, forces)
                both.append(
                    np.concatenate([evaluator.sums.gradient[:size], evaluator.sums.body[: bodies // 6].ravel()])
                )
            column = (both[0] - both[1]) / (2.0 * step)
            rows.append(np.flatnonzero(column))
            values.append(column[rows[-1]])
            begins.append(begins[-1] + len(rows[-1]))
        shape = (size + bodies, size + bodies)
        derivative = sparse.csc_matrix((np.concatenate(values), np.concatenate(rows), begins), shape).tolil()
        if "moments" in forces:
            self._stand(LONG)
            moments = evaluator.problem.moments
            for body, (x, y, z) in zip(moments.body, moments.present, strict=True):
                own = slice(size + 6 * body + 3, size + 6 * body + 6)
                derivative[own, own] = derivative[own, own] - 0.5 * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return self._reduced(derivative.tocsc())
