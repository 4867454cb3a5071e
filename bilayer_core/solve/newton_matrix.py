"""The Newton matrix: a band for rods, bordered by six unknowns for each free body, and its factorisation.

    [ A   U ] [ δ   ]     [ g   ]
    [ Uᵀ  D ] [ δ_b ] = − [ g_b ]

A is factorised as L D Lᵀ in linear time, S = D − Uᵀ A⁻¹ U by Cholesky. Where no ball is near a node U vanishes and is left out.
If a pivot is not positive the matrix is not convex there; multiples of the mass matrix are added until it is, so that the step is a descent direction.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ..model.model import Model
from .assembly import expand_bends, expand_edges, expand_pairs, hold_unknowns
from .band import band_kernels

Array = np.ndarray
FIRST_SHIFT = 0.01  # of the inertial part, where the Hessian is indefinite
SHIFT_GROWTH = 10.0
LARGEST_SHIFT = 1e8


class NewtonMatrix:
    """Second derivatives in edge space, filled by the forces, and the factorised matrix of the unknowns."""

    def __init__(self, model: Model, has_contact: bool, has_balls: bool):
        self._model = model
        self._has_contact = has_contact
        edges = model.edge_count + model.wall_count
        pairs, carriers = len(model.pair_top), model.carriers
        size, b = model.layout.size, model.layout.half_bandwidth
        balls = len(carriers.pair_first) if has_balls else 0
        self.edge_hessian = np.zeros((edges, 4, 4))
        self.cross_hessian = np.zeros((len(model.joint_a), 4, 4))
        self.pair_hessian = np.zeros((pairs, 3, 3))
        self.top_hessian = np.zeros((pairs, 3, 4))
        self.bottom_hessian = np.zeros((pairs, 3, 4))
        self.carrier_hessian = np.zeros((len(carriers.weight) if has_contact else 0, 3, 3))
        self.ball_hessian = np.zeros((balls, 3, 3))
        self.ball_turn_hessian = np.zeros((balls, 3, 3))
        self.body_hessian = np.zeros((6 * model.free_count, 6 * model.free_count))
        self._band = np.zeros((size + b, b + 1))
        self._factor, self._solve, self._solve_border = band_kernels(b)
        self._right = np.zeros(size + b)
        self._held = model.layout.node[model.attached_node]
        self._held_unknowns = (self._held[:, None] + np.arange(3)).ravel()
        self._border = np.zeros((size + b, 6 * model.free_count))
        self._border_solution = np.zeros_like(self._border)
        self._schur = None
        self._coupled = False
        self._balls = np.flatnonzero(carriers.free_body >= 0)
        self.shift = 0.0

    def clear(self) -> None:
        """Set all second derivatives to zero."""
        for array in (self.edge_hessian, self.cross_hessian, self.pair_hessian, self.top_hessian, self.bottom_hessian):
            array.fill(0.0)
        for array in (self.carrier_hessian, self.ball_hessian, self.ball_turn_hessian, self.body_hessian):
            array.fill(0.0)

    def add_balls_to_gradient(self, carrier_gradient: Array, body_gradient: Array) -> None:
        """Hand the force on the centre of each ball to its body."""
        for carrier in self._balls:
            body_gradient[self._model.carriers.free_body[carrier], :3] += carrier_gradient[carrier]

    def factorise(self, factor: float) -> bool:
        """Assemble and factorise; `factor` [1/s²] multiplies the masses. False if no shift makes the matrix positive definite."""
        self.assemble_border()
        self.shift = 0.0
        while True:
            if self._try_factorise(factor):
                return True
            self.shift = max(FIRST_SHIFT, self.shift * SHIFT_GROWTH)
            if self.shift > LARGEST_SHIFT:
                return False

    def assemble_band(self, factor: float) -> Array:
        """Band of the rods' unknowns, not factorised, see `solve.band`."""
        model, layout, band = self._model, self._model.layout, self._band
        band.fill(0.0)
        expand_edges(
            model.edge_node,
            layout.node,
            layout.edge,
            model.node_mass,
            model.spin_inertia,
            factor,
            self.edge_hessian,
            self.carrier_hessian,
            self._has_contact,
            band,
        )
        joints = (model.joint_a, model.joint_b, model.edge_node, layout.node, layout.edge)
        expand_bends(model.bend_count, model.edge_count, *joints, self.cross_hessian, band)
        if len(model.pair_top):
            expand_pairs(
                model.bend_count,
                model.pair_bottom,
                model.edge_node,
                layout.node,
                self.pair_hessian,
                self.top_hessian,
                self.bottom_hessian,
                self.cross_hessian,
                band,
            )
        hold_unknowns(self._held, layout.half_bandwidth, band)
        return band

    @property
    def border(self) -> Array:
        """U, shape (size, 6 n_free)."""
        return self._border[: self._model.layout.size]

    def assemble_border(self) -> None:
        """Complete D with the forces on balls' centres, and collect U from the balls' contacts with nodes."""
        model, carriers = self._model, self._model.carriers
        free = carriers.free_body
        for carrier in self._balls:
            rows = slice(6 * free[carrier], 6 * free[carrier] + 3)
            own = self.carrier_hessian[carrier]
            self.body_hessian[rows, rows] += own + np.triu(own, 1).T
        self._coupled = False
        self._border.fill(0.0)
        active = np.flatnonzero(self.ball_hessian.any(axis=(1, 2)))
        for k in active:
            i, j = carriers.pair_first[k], free[carriers.pair_second[k]]
            if j < 0:
                continue
            if i < model.node_count:
                rows = slice(model.layout.node[i], model.layout.node[i] + 3)
                self._border[rows, 6 * j : 6 * j + 3] += self.ball_hessian[k]
                self._border[rows, 6 * j + 3 : 6 * j + 6] += self.ball_turn_hessian[k]
                self._coupled = True
            elif free[i] >= 0:
                rows, columns = slice(6 * free[i], 6 * free[i] + 3), slice(6 * j, 6 * j + 3)
                self.body_hessian[rows, columns] += self.ball_hessian[k]
                self.body_hessian[columns, rows] += self.ball_hessian[k].T
        self._border[self._held_unknowns] = 0.0

    def _try_factorise(self, factor: float) -> bool:
        size = self._model.layout.size
        self.assemble_band(factor * (1.0 + self.shift))
        if self._factor(self._band, size) >= 0:
            return False
        if not self._model.free_count:
            return True
        schur = self.body_hessian.copy()
        if self.shift:
            bodies = self._model.bodies
            for b, mass in enumerate(bodies.mass):
                inertia = np.trace(bodies.second_moment[b])
                schur[range(6 * b, 6 * b + 6), range(6 * b, 6 * b + 6)] += self.shift * factor * np.repeat(
                    [mass, inertia], 3
                )
        if self._coupled:
            self._border_solution[:] = self._border
            self._solve_border(self._band, size, self._border_solution)
            schur -= self._border.T @ self._border_solution
        try:
            self._schur = cho_factor(schur, check_finite=False)
        except LinAlgError:
            return False
        return True

    def newton_step(self, gradient: Array, body_gradient: Array) -> tuple[Array, Array]:
        """Minus the inverse matrix times the gradient: of rods, shape (size,), and of bodies, shape (n_free, 6)."""
        size = self._model.layout.size
        right = self._right
        np.negative(gradient, out=right[:size])
        right[size:] = 0.0
        self._solve(self._band, size, right)
        step = right[:size].copy()
        if not self._model.free_count:
            return step, np.zeros((0, 6))
        load = -body_gradient.ravel()
        if self._coupled:
            load = load - self._border[:size].T @ step
        body_step = cho_solve(self._schur, load, check_finite=False)
        if self._coupled:
            step -= self._border_solution[:size] @ body_step
        return step, body_step.reshape(-1, 6)
