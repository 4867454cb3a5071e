"""Answers to two of the problems that do not come from this simulator: planar elastica as splines, in time by DOP853.

A planar extensible rod x(s), s its rest length, with ε = |x'| − 1 and χ = (x' × x'')/|x'|²:

    E = ∫ ½ A ε² − N ε + ½ D χ² + M χ ds − ∫ ρA g·x ds,    T = ∫ ½ ρA |ẋ|² ds

x is a spline of degree 5 with the clamp built in (Galerkin, consistent mass), integrated by an explicit method of
order 8: neither mesh nor step has anything in common with rods made of edges.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline
from scipy.linalg import cho_factor, cho_solve

Array = np.ndarray
DEGREE = 5
GAUSS_POINTS = 6


class SplineRod:
    """A planar rod along x, clamped at its start, at rest.

    Parameters
    ----------
    length, axial, bending, mass : float
        L [m], A [N], D [N m²], ρA [kg/m].
    spans : int
        Of the spline.
    gravity : float
        Downwards, along −z [m/s²].
    damping : float
        Force per mass and velocity [1/s].
    force, moment : callable
        N [N] and M [N m] at a time [s].
    """

    def __init__(
        self,
        length: float,
        axial: float,
        bending: float,
        mass: float,
        spans: int,
        gravity: float = 0.0,
        damping: float = 0.0,
        force: Callable[[float], float] = lambda t: 0.0,
        moment: Callable[[float], float] = lambda t: 0.0,
    ):
        self.axial, self.bending, self.mass, self.damping = axial, bending, mass, damping
        self.force, self.moment = force, moment
        breaks = np.linspace(0.0, length, spans + 1)
        knots = np.concatenate([np.zeros(DEGREE), breaks, np.full(DEGREE, length)])
        self.count = spans + DEGREE
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * (breaks[1:] - breaks[:-1])
        at = (middle[:, None] + half[:, None] * nodes).ravel()
        self.weight = (half[:, None] * weights).ravel()
        basis = BSpline(knots, np.eye(self.count), DEGREE)
        self._value, self._first, self._second = (basis.derivative(n)(at) if n else basis(at) for n in range(3))
        self._tip = np.asarray(basis(length))
        self._mean = self.weight @ self._value / length
        # free unknowns: neither the first coefficient nor the height of the second
        self._free = np.ones((self.count, 2), dtype=bool)
        self._free[0] = self._free[1, 1] = False
        mass_matrix = mass * self._value.T @ (self.weight[:, None] * self._value)
        self._solve = [cho_factor(mass_matrix[np.ix_(free, free)]) for free in self._free.T]
        self._weight_force = np.outer(self.weight @ self._value, [0.0, -mass * gravity])
        self.start = np.zeros((self.count, 2))
        self.start[:, 0] = [knots[i + 1 : i + DEGREE + 1].mean() for i in range(self.count)]  # Greville: x(s) = s

    def potential_force(self, c: Array, time: float) -> Array:
        """Return −∂E/∂c of coefficients c [m], shape (count, 2), [N]."""
        a, b = self._first @ c, self._second @ c
        square = np.einsum("ij,ij->i", a, a)
        size = np.sqrt(square)
        chi = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / square
        tension = self.weight * (self.axial * (size - 1.0) - self.force(time)) / size
        moment = self.weight * (self.bending * chi + self.moment(time))
        turned = np.column_stack([b[:, 1], -b[:, 0]])
        of_first = tension[:, None] * a + (moment / square)[:, None] * (turned - 2.0 * chi[:, None] * a)
        of_second = (moment / square)[:, None] * np.column_stack([-a[:, 1], a[:, 0]])
        return self._weight_force - self._first.T @ of_first - self._second.T @ of_second

    def rate(self, time: float, y: Array) -> Array:
        """Return ẏ of y = (c, ċ), flat."""
        c, v = y.reshape(2, self.count, 2)
        force = self.potential_force(c, time)
        acceleration = np.zeros_like(c)
        for axis in range(2):
            free = self._free[:, axis]
            acceleration[free, axis] = cho_solve(self._solve[axis], force[free, axis]) - self.damping * v[free, axis]
        return np.concatenate([v.ravel(), acceleration.ravel()])

    def integrate(self, times: Array, corner: float | None = None, tolerance: float = 1e-6) -> tuple[Array, Array]:
        """Return the ways of tip and mass centre [m], shapes (n_time, 2), at times [s] from 0; `corner` is one of the
        drive's.
        """
        y = np.concatenate([self.start.ravel(), np.zeros(2 * self.count)])
        ends = [times[0], *([corner] if corner else []), times[-1]]
        found = []
        for begin, end in zip(ends[:-1], ends[1:], strict=True):
            inside = times[(times >= begin) & ((times < end) | (end == times[-1]))]
            asked = np.union1d(inside, end)
            part = solve_ivp(self.rate, (begin, end), y, "DOP853", asked, rtol=tolerance, atol=1e-2 * tolerance)
            found.append(part.y[:, : len(inside)])
            y = part.y[:, -1]
        shapes = np.concatenate(found, axis=1).T.reshape(len(times), 2, self.count, 2)[:, 0]
        return np.einsum("i,tij->tj", self._tip, shapes), np.einsum("i,tij->tj", self._mean, shapes)


def cantilever(spans: int = 20) -> Array:
    """Return the way of the tip of the common cantilever over 0.5 s: times [s] and places [m], shape (n_time, 4)."""
    e, width, thickness, density = 1e6, 0.01, 2e-3, 1000.0
    area = width * thickness
    rod = SplineRod(0.1, e * area, e * width * thickness**3 / 12.0, density * area, spans, gravity=9.81)
    times = np.arange(251) * 2e-3
    return _in_space(times, rod.integrate(times)[0])


def snap(spans: int = 10) -> Array:
    """Return the way of the mass centre of Timoshenko's bilayer, whose top grows by 5 % within 20 ms: as `cantilever`
    over 0.2 s.

    The curve is the interface of two equal layers: B = 0, A = 2EA, D = 2(EI + EA h²/4), N = EA η, M = EA η h/2.
    """
    e, width, h, density, strain, ramp = 1e8, 0.01, 1e-3, 1000.0, 0.05, 0.02
    stiffness = e * width * h
    own = e * width * h**3 / 12.0

    def eigenstrain_force(time: float) -> float:
        return stiffness * strain * min(time / ramp, 1.0)

    rod = SplineRod(
        0.1,
        2.0 * stiffness,
        2.0 * (own + stiffness * h**2 / 4.0),
        2.0 * density * width * h,
        spans,
        damping=20.0,
        force=eigenstrain_force,
        moment=lambda t: 0.5 * h * eigenstrain_force(t),
    )
    times = np.arange(201) * 1e-3
    return _in_space(times, rod.integrate(times, corner=ramp)[1])


def _in_space(times: Array, way: Array) -> Array:
    return np.column_stack([times, way[:, 0], np.zeros(len(times)), way[:, 1]])


ANSWERS = {
    "cantilever": ("splines of degree 5 (Galerkin) and DOP853", cantilever),
    "snap": ("splines of degree 5 (Galerkin) and DOP853, the bond rigid", snap),
}
"""By problem: what the method is, and the function that computes the answer."""
