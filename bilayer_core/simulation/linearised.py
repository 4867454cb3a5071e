"""Mass, damping and stiffness of small motions about a state at rest, with forces that have no potential.

Small motions q about rest follow

    M q̈ + (C + G) q̇ + (K + L) q = 0

K and M are the Hessian and the mass matrix that Newton's method has, that of a flow's potential about added mass among
K; C is that of what depends on velocities (damping, viscosity, drag, friction). L is what K lacks: ∂/∂z of forces that
are held at a configuration z while Newton goes on (differences of their gradients, of these forces alone, so that stiff
elasticity does not hide them). A moment M that acts on the body whose turn φ is the unknown has besides −½ [M]× : its
power is M·ω, ω the turn's rate in space, and ∂ω/∂φ̇ = 1 + ½ [φ]× + …

G is gyroscopic: T_vq − T_qv of the kinetic energy T of a flow about added mass (`forces.added_mass`). Over a stage of
length h its gradient, held at z, has ∂/∂z = (T_vq − T_qv)/h − T_qq, since z moves at (z − x)/h. So G is h times the
difference of this for h = 1 s and for a long one.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.model.force_list import Kind, kinds
from bilayer_core.model.model import Model
from bilayer_core.model.records.step import AT_REST, Configuration
from bilayer_core.model.state import State

Array = np.ndarray
HELD = ("followers", "moments", "drag")
"""Forces that are held at a configuration while Newton's method goes on."""
ADDED_MASS = "added mass"
STEP = 1e-6
"""Of the longest rod, or of one radian: differences of the configuration at which such forces are held, by default."""
STRIDE = 6
"""Nodes apart from each other that no held force sees together: each sees two of its neighbours on either side."""
LONG = 1e9
"""Length of a stage over which nothing depends on velocities [s]."""


class Linearised:
    """Matrices of the motions that are free, about a configuration.

    Parameters
    ----------
    model : Model
        In space.
    state : State
        Whose configuration it is.
    load_factor : ndarray
        Of loads there, shape (n_load,).
    within : Model, optional
        Of the same scene in a plane: motions that do not leave it alone are free.
    step : float
        In place of `STEP`.

    Attributes
    ----------
    at : Configuration
    chosen : sparse matrix
        Motion of unknowns and bodies in each free motion, a column each.
    """

    def __init__(self, model: Model, state: State, load_factor: Array, within: Model | None = None, step: float = STEP):
        self._step = step
        self._model, self._load_factor, self._state = model, load_factor, state
        self._evaluator = evaluator = Evaluator(model)
        self.at: Configuration = evaluator.new()
        self._moved: Configuration = evaluator.new()
        evaluator.take_state(state, self.at)
        self._rest = evaluator.rest_strains_of(state.transduction)
        self.chosen = self._free_motions(within)
        self._of_kind = {kind: [name for name in model.forces if kinds()[name] is kind] for kind in Kind}
        self._held = [name for name in HELD if name in model.forces]
        self._wet = [ADDED_MASS] if ADDED_MASS in model.forces else []

    @property
    def mass(self) -> sparse.csc_matrix:
        """M, with added mass."""
        return self._matrix(self._of_kind[Kind.INERTIAL], 1.0)

    @property
    def damping(self) -> sparse.csc_matrix:
        """C + G."""
        found = self._matrix(self._of_kind[Kind.DISSIPATIVE], 1.0)
        if self._wet:
            found = found + self._derivative_of_held(self._wet, 1.0) - self._derivative_of_held(self._wet, LONG)
        return found

    @property
    def stiffness(self) -> sparse.csc_matrix:
        """K + L."""
        forces = self._of_kind[Kind.CONSERVATIVE] + self._of_kind[Kind.EXTERNAL] + self._wet
        found = self._matrix(forces, LONG, rests=True)
        return found + self._derivative_of_held(self._held, LONG) if self._held else found

    def gradient(self) -> Array:
        """Return minus the forces at rest on free motions."""
        self._stand(LONG, rests=True)
        self._evaluator.evaluate(self.at)
        return self.chosen.T @ self._gradient()

    def move(self, step: Array) -> None:
        """Move along the free motions."""
        self._stand(LONG, rests=True)
        self._move(self.chosen @ step)
        self.go_back()

    def go_back(self) -> None:
        """Return to where the last move began, if nothing was differentiated since."""
        self.at, self._moved = self._moved, self.at

    def displacement(self, step: Array) -> float:
        """Return the largest displacement of a node or body in a step of free motions [m]."""
        whole, size = self.chosen @ step, self._model.layout.size
        places = self._model.layout.node[:, None] + np.arange(3)
        lengths = [np.linalg.norm(part, axis=1) for part in (whole[places], whole[size:].reshape(-1, 6)[:, :3])]
        return float(np.concatenate(lengths).max())

    def write_shape(self, state: State) -> None:
        """Give a state the shape."""
        self._evaluator.write_shape(self.at, state)

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
                fixed[copy] |= copy != first
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

    def _stand(self, length: float, rests: bool = False) -> None:
        """Freeze a stage in which all stands still; if it `rests`, displacements are no motion."""
        evaluator, rest = self._evaluator, self._rest
        evaluator.stand_still(self._state, self.at, length, rest.edge, rest.joint, self._load_factor)
        if rests:
            evaluator.stage.still[0] = AT_REST
        evaluator.start_stage(self.at)

    def _move(self, whole: Array) -> None:
        """Put a step of unknowns and bodies, beside the configuration."""
        size = self._model.layout.size
        self._evaluator.move(self.at, whole[:size], whole[size:].reshape(-1, 6), self._moved)

    def _gradient(self) -> Array:
        """Return the gradient by unknowns and bodies in the last evaluation."""
        sums, bodies = self._evaluator.sums, len(self._model.free_bodies.mass)
        return np.concatenate([sums.gradient[: self._model.layout.size], sums.body[:bodies].ravel()])

    def _matrix(self, forces: list[str], length: float, rests: bool = False) -> sparse.csc_matrix:
        """Return the second derivatives of forces over a stage of that length, times it for those of velocities."""
        size = self._model.layout.size
        self._stand(length, rests)
        self._evaluator.evaluate(self.at, forces, second=True)
        band, border, corner = self._evaluator.assemble(self.at)
        rows = range(min(band.shape[1], size))
        lower = sparse.diags([band[: size - r, r] for r in rows], [-r for r in rows], format="csc")
        whole = lower + sparse.tril(lower, -1).T
        if corner.size:
            whole = sparse.bmat([[whole, border], [border.T, corner]], format="csc")
        return self._reduced(whole)

    def _reduced(self, whole: sparse.spmatrix) -> sparse.csc_matrix:
        return sparse.csc_matrix(self.chosen.T @ whole @ self.chosen)

    def _derivative_of_held(self, forces: list[str], length: float) -> sparse.csc_matrix:
        """Return ∂/∂z of the gradient of forces that are held at z, over a stage of that length."""
        evaluator, model = self._evaluator, self._model
        size, whole = model.layout.size, model.layout.size + 6 * len(model.free_bodies.mass)
        span = max(rod.path.length for rod in model.scene.rods)
        steps, place = np.full(whole, self._step), np.full(whole, np.inf)
        nodes, edges = model.layout.node[:, None] + np.arange(3), model.rods.edge_unknown
        steps[nodes] *= span
        steps[size:].reshape(-1, 6)[:, :3] *= span
        place[nodes] = np.arange(len(nodes))[:, None]
        place[edges] = model.rods.edge_node + 0.5
        self._stand(length)
        derivative = sparse.lil_matrix((whole, whole))
        for group in self._apart(nodes, edges):
            both = []
            for sign in (1.0, -1.0):
                moves = np.zeros(whole)
                moves[group] = sign * steps[group]
                self._move(moves)
                evaluator.update_lagged(self._moved)
                evaluator.evaluate(self.at, forces)
                both.append(self._gradient())
            change = 0.5 * (both[0] - both[1])
            rows = np.flatnonzero(change)
            nearest = np.abs(place[rows][:, None] - place[group]).argmin(axis=1) if len(group) > 1 else 0 * rows
            columns = group[nearest]
            derivative[rows, columns] = change[rows] / steps[columns]
        if "moments" in forces:
            self._stand(length)
            moments = evaluator.problem.moments
            for body, (x, y, z) in zip(moments.body, moments.present, strict=True):
                own = slice(size + 6 * body + 3, size + 6 * body + 6)
                derivative[own, own] = derivative[own, own] - 0.5 * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return self._reduced(derivative.tocsc())

    def _apart(self, nodes: Array, edges: Array) -> list[Array]:
        """Return groups of unknowns whose motions no held force sees together; with free bodies, which may feel many
        nodes, each by itself.
        """
        whole = self.chosen.shape[0]
        if whole > self._model.layout.size:
            return list(np.arange(whole)[:, None])
        groups = [nodes[k::STRIDE, c] for c in range(3) for k in range(STRIDE)]
        return [group for group in groups + [edges[k::STRIDE] for k in range(STRIDE)] if len(group)]
