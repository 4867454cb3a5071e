"""Statics and dynamics of the planar bilayer beam.

Both minimise E(x) − Σ m g·x + ½ |x − x̃|²_m/h² + ½ α |x − xₙ|²_m/h with Newton's method and a line search: a step of
implicit Euler takes x̃ = xₙ + h v and its length for h, a search for equilibrium x̃ = xₙ and ever larger h (see
`simulation.equilibrium`). α is the damping.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from bilayer_core.errors import SimulationError
from bilayer_core.verification.beam2d.energy import BeamEnergy, Section

Array = np.ndarray
TOLERANCE = 1e-13  # correction that Newton may leave, of the beam's length
MAX_ITERATIONS = 200
ARMIJO, MAX_BACKTRACKS, ROUNDING = 1e-4, 40, 1e-13
FIRST_LENGTH, LAST_LENGTH, GROWTH = 1e-2, 1e4, 10.0  # h of the search for equilibrium [s], and its factor
FIRST_SHIFT, SHIFT_GROWTH = 1e-3, 10.0  # multiples of the Hessian's diagonal, where it is not positive definite


class PlanarBeam:
    """A straight bilayer in a plane: x along its interface, z along its normal.

    Parameters
    ----------
    section : Section
    length : float
        [m]
    node_count : int
    clamped : bool
        Whether a wall holds the first node and its direction.
    gravity : tuple of float
        In the plane [m/s²].
    damping : float
        Force per mass and velocity [1/s].

    Attributes
    ----------
    position, velocity : Array
        Of nodes of the interface [m, m/s], shape (n_node, 2).
    force, moment : Array
        N [N] and M [N m] from the eigenstrain of each edge, shape (n_edge,).
    """

    def __init__(
        self, section: Section, length: float, node_count: int, *, clamped=True, gravity=(0.0, 0.0), damping=0.0
    ):
        edge_length = length / (node_count - 1)
        wall = np.array([1.0, 0.0]) if clamped else None
        self.length, self.section, self.damping = length, section, damping
        self.energy_law = BeamEnergy(section, edge_length, node_count, wall)
        self.position = np.column_stack([np.linspace(0.0, length, node_count), np.zeros(node_count)])
        self.velocity = np.zeros((node_count, 2))
        self.force, self.moment = np.zeros(node_count - 1), np.zeros(node_count - 1)
        self._mass = np.full(node_count, section.mass * edge_length)
        self._mass[[0, -1]] *= 0.5
        self._weight = self._mass[:, None] * np.array(gravity, dtype=float)
        self._held = np.arange(2 if clamped else 0)

    @property
    def curvatures(self) -> Array:
        """χ of bending elements per rest length [1/m]: at the clamp, then at inner nodes, shape (n_bend,)."""
        return self.energy_law.strains(self.position).bend / self.energy_law.weight

    def energy(self) -> float:
        """Return the elastic energy, up to a constant that the eigenstrain sets, and that of gravity [J]."""
        return self._potential(self.position, self.position, math.inf)

    def solve_static(self) -> None:
        """Go to an equilibrium under the present eigenstrain and gravity.

        Raises SimulationError if none is found; the beam is unchanged then.
        """
        before, length = self.position, FIRST_LENGTH
        while length <= LAST_LENGTH:
            try:
                self.position = self._minimum(self.position, length)
            except SimulationError:
                self.position = before
                raise
            length *= GROWTH
        self.velocity = np.zeros_like(self.velocity)

    def step(self, dt: float) -> None:
        """Advance by one step of implicit Euler [s].

        Raises SimulationError if Newton's method does not converge; the beam is unchanged then.
        """
        end = self._minimum(self.position + dt * self.velocity, dt)
        self.velocity = (end - self.position) / dt
        self.position = end

    def _potential(self, position: Array, predicted: Array, length: float) -> float:
        inertia = 0.5 / length**2 * self._mass @ np.square(position - predicted).sum(axis=1)
        lost = 0.5 * self.damping / length * self._mass @ np.square(position - self.position).sum(axis=1)
        elastic = self.energy_law.value(position, self.force, self.moment)
        return elastic - float(np.sum(self._weight * position)) + float(inertia + lost)

    def _minimum(self, predicted: Array, length: float) -> Array:
        """Return where the potential of a step is least [m], shape (n_node, 2)."""
        masses = np.repeat(self._mass, 2) / length**2
        friction = np.repeat(self._mass, 2) * self.damping / length
        at = predicted.copy()
        at[0 : len(self._held) // 2] = self.position[0 : len(self._held) // 2]
        value = self._potential(at, predicted, length)
        for _ in range(MAX_ITERATIONS):
            gradient, band = self.energy_law.derivatives(at, self.force, self.moment)
            gradient += masses * (at - predicted).ravel() - self._weight.ravel()
            gradient += friction * (at - self.position).ravel()
            band[0] += masses + friction
            step = self._newton_step(gradient, band)
            size = np.abs(step).max()
            if size <= TOLERANCE * self.length:
                return at
            alpha = 1.0
            for _ in range(MAX_BACKTRACKS):
                trial = at + alpha * step.reshape(-1, 2)
                new = self._potential(trial, predicted, length)
                if new <= value + ARMIJO * alpha * (gradient @ step) + ROUNDING * abs(value):
                    break
                alpha *= 0.5
            at, value = trial, new
        raise SimulationError(
            f"the planar beam did not come to rest within {MAX_ITERATIONS} iterations (correction left {size:.3g} m, "
            f"allowed {TOLERANCE * self.length:.3g} m)",
            0.0,
        )

    def _newton_step(self, gradient: Array, band: Array) -> Array:
        """Return minus the inverse Hessian, made positive definite, times the gradient; zero where the clamp holds."""
        gradient[self._held] = 0.0
        for unknown in self._held:
            band[:, unknown] = 0.0
            band[0, unknown] = 1.0
        shift, diagonal = 0.0, np.abs(band[0])
        while True:
            shifted = band.copy()
            shifted[0] += shift * diagonal
            try:
                return -solveh_banded(shifted, gradient, lower=True)
            except LinAlgError:
                shift = max(FIRST_SHIFT, SHIFT_GROWTH * shift)
