"""A free plate strip of layers with any moduli and eigenstrains, solved across its width, with no code of the package.

Strains are those of a shallow shell that is curved by κ along and twisted by τ, with the elevation w(y) of its section:

    ε_x = e + f y − κ w + ½ τ² y² − z κ,   ε_y = a(y) − z w″,   γ = b(y) − 2 z τ

For given κ and τ the energy is a quadratic form of e, f, a, b and w″, Legendre polynomials of y here; that of least
energy is left, and κ and τ are searched for.

x is along the strip, z through it, y = z × x. Curvatures are positive where the strip bends to z, τ is right-handed.
"""

import numpy as np
from scipy.optimize import minimize

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(3)


def isotropic(youngs_modulus, poisson):
    """The compliance of a plane, (ε1, ε2, γ12) per (σ1, σ2, τ12)."""
    return orthotropic(youngs_modulus, youngs_modulus, poisson, 0.5 * youngs_modulus / (1 + poisson))


def orthotropic(along, across, poisson, shear):
    """Likewise of fibres; `poisson` is that of a pull along them."""
    return np.array([[1 / along, -poisson / along, 0], [-poisson / along, 1 / across, 0], [0, 0, 1 / shear]])


def turned(angle, vector):
    """Strains (ε1, ε2, γ12) of axes that are turned by an angle from x to y, in x and y, by the tensor of strain."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    tensor = turn @ np.array([[vector[0], vector[2] / 2], [vector[2] / 2, vector[1]]]) @ turn.T
    return np.array([tensor[0, 0], tensor[1, 1], 2 * tensor[0, 1]])


class Strip:
    """Layers from the bottom, each (thickness, compliance in its axes, strain (ε1, ε2) that it would have, angle), and
    perhaps the curvature and twist (κ, τ) that it would have.
    """

    def __init__(self, width, layers, degree=30, strained=0.0):
        """Take layers; their borders are as long as those of a strip that is twisted by `strained` [1/m]."""
        y, weight = np.polynomial.legendre.leggauss(degree + 12)
        self.width, y = width, 0.5 * width * y
        self.height = sum(layer[0] for layer in layers)
        curve = [np.polynomial.legendre.Legendre.basis(k, domain=[-width / 2, width / 2]) for k in range(degree)]
        bend = np.array([of(y) for of in curve]).T  # w″
        rise = np.array([of.integ(2, lbnd=0.0)(y) for of in curve]).T  # w
        one, none = np.ones((len(y), 1)), np.zeros((len(y), degree))
        self._parts = []  # height, weight, stiffness and free strain of points through the thickness
        low = -0.5 * self.height
        for thickness, compliance, free, angle, *bent in layers:
            stiffness = np.linalg.inv(compliance)
            frame = np.array([turned(-angle, unit) for unit in np.eye(3)]).T  # of x, y in the axes of the fibres
            q = frame.T @ stiffness @ frame
            eigen = turned(angle, (*free, 0.0))
            for point, part in zip(POINTS, WEIGHTS, strict=True):
                up = 0.5 * thickness * point
                own = up * np.array([bent[0][0], 0.0, 2.0 * bent[0][1]]) if bent else 0.0
                self._parts.append((low + 0.5 * thickness + up, 0.5 * thickness * part, q, eigen - own))
            low += thickness
        self._y, self._weight, self._rise, self._bend = y, 0.5 * width * weight, rise, bend
        self._mean, self._none, self._strained = np.hstack([one, y[:, None]]), none, strained

    def energy(self, along, twist):
        """The least energy per length at given κ and τ."""
        y, zero = self._y, np.zeros((len(self._y), 2))
        rows, target = [], []
        for z, part, q, eigen in self._parts:
            root = np.linalg.cholesky(q).T
            x = np.hstack([self._mean, -along * self._rise, self._none, self._none])
            across = np.hstack([zero, -z * self._bend, self._bend, self._none])
            shear = np.hstack([zero, self._none, self._none, self._bend])
            stretch = 0.5 * (twist**2 - self._strained**2) * y**2
            known = np.stack([stretch - z * along - eigen[0], 0 * y - eigen[1], -2 * z * twist - eigen[2] + 0 * y])
            scale = np.sqrt(part * self._weight)
            for r in range(3):
                rows.append(scale[:, None] * (root[r, 0] * x + root[r, 1] * across + root[r, 2] * shear))
                target.append(scale * (root[r] @ known))
        rows, target = np.concatenate(rows), np.concatenate(target)
        size = np.linalg.norm(rows, axis=0)
        size[size == 0] = 1
        found = -np.linalg.lstsq(rows / size, target, rcond=None)[0] / size
        left = rows @ found + target
        return 0.5 * left @ left

    def rest(self, start):
        """κ and τ of least energy near a start, whose size is the scale of both."""
        start = np.asarray(start, float)
        scale = np.linalg.norm(start)
        reference = self.energy(0.0, 0.0)
        found = minimize(
            lambda v: self.energy(*(scale * v)) / reference,
            start / scale,
            method="Nelder-Mead",
            options={"xatol": 1e-8, "fatol": 1e-15, "maxiter": 400},
        )
        return scale * found.x
