"""Statics of a rod of two unlike layers along its path, by collocation: no neutral axis, nothing of the simulator.

The path r(s) has the tangent angle θ, t = (cos θ, sin θ) and n = (−sin θ, cos θ) from the first layer to the second.
With A, B, D of Σ EA (1, z, z²) + EI over the layers, z their heights over the path, the axial force and the moment are

    N·t = A ε − B θ′,   M = D θ′ − B ε,   r′ = (1 + ε) t.

What acts per length at the height c over the path is f, at the end F on the path:

    N′ = −f,   M′ = −r′ × N − c n × f,   N(L) = F,   M(L) = 0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp

Array = np.ndarray
Force = Callable[[Array], Array]
"""Of tangent angles, shape (n,), a force [N] or [N/m], shape (2, n)."""


@dataclass(frozen=True)
class Section:
    """Two layers of rectangles, the first below the path, the second above it; a thickness may be zero, and a pair of
    widths is that of the layers.
    """

    width: float | tuple[float, float]
    modulus: tuple[float, float]
    density: tuple[float, float]
    thickness: tuple[float, float]

    @property
    def _heights(self) -> Array:
        return np.array([-0.5, 0.5]) * self.thickness

    @property
    def _stretching(self) -> Array:
        return np.array(self.width) * self.modulus * self.thickness

    @property
    def _mass_of_layers(self) -> Array:
        return np.array(self.width) * self.density * self.thickness

    @property
    def stiffness(self) -> tuple[float, float, float]:
        """A [N], B [N m], D [N m²]."""
        z, stretching = self._heights, self._stretching
        own = np.array(self.width) * self.modulus * np.array(self.thickness) ** 3 / 12.0
        return float(stretching.sum()), float(stretching @ z), float((own + stretching * z**2).sum())

    @property
    def bending(self) -> float:
        """EI about the neutral axis [N m²]."""
        a, b, d = self.stiffness
        return d - b**2 / a

    @property
    def axis(self) -> float:
        """Height of the neutral axis over the path [m]."""
        a, b, _ = self.stiffness
        return b / a

    @property
    def mass(self) -> float:
        """Mass per length [kg/m]."""
        return float(np.sum(self._mass_of_layers))

    @property
    def centre(self) -> float:
        """Height of the mass centre over the path [m]."""
        return float(self._mass_of_layers @ self._heights / self.mass)

    @property
    def middle(self) -> float:
        """Height of the middle of the section over the path [m]."""
        return 0.5 * (self.thickness[1] - self.thickness[0])


def _nothing(angle: Array) -> Array:
    return np.zeros((2, np.size(angle)))


def end_of_rod(
    pieces: list[tuple[float, Section]],
    gravity: tuple[float, float] = (0.0, 0.0),
    drag: Force = _nothing,
    end: Force = _nothing,
) -> Array:
    """Return the end of the path (x, y) [m] and its angle [rad] of a rod clamped along x, shape (3,).

    Parameters
    ----------
    pieces : list
        Lengths [m] and sections, one after the other.
    gravity : tuple of float
        [m/s²]
    drag : callable
        Force per length at the middle of the section [N/m].
    end : callable
        Force at the end of the path [N].
    """
    count = len(pieces)

    def of_piece(k: int, y: Array) -> Array:
        length, section = pieces[k]
        _, _, angle, n1, n2, moment = y
        t, n = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        a, b, d = section.stiffness
        axial = n1 * t[0] + n2 * t[1]
        strain, bend = (d * axial + b * moment) / (a * d - b**2), (b * axial + a * moment) / (a * d - b**2)
        weight = section.mass * np.array(gravity)[:, None] * np.ones_like(angle)
        fluid = drag(angle)
        force, (x, y_) = weight + fluid, (1.0 + strain) * t
        couple = section.centre * (n[0] * weight[1] - n[1] * weight[0])
        couple = couple + section.middle * (n[0] * fluid[1] - n[1] * fluid[0])
        return length * np.array([x, y_, bend, -force[0], -force[1], -(x * n2 - y_ * n1) - couple])

    def slope(_: Array, y: Array) -> Array:
        return np.concatenate([of_piece(k, y[6 * k : 6 * k + 6]) for k in range(count)])

    def conditions(first: Array, last: Array) -> Array:
        joined = [first[6 * k : 6 * k + 6] - last[6 * k - 6 : 6 * k] for k in range(1, count)]
        pulled = last[-3:-1] - end(last[-4:-3])[:, 0]
        return np.concatenate([first[:3], *joined, pulled, last[-1:]])

    s = np.linspace(0.0, 1.0, 41)
    guess, begun = np.zeros((6 * count, len(s))), 0.0
    for k, (length, _) in enumerate(pieces):
        guess[6 * k] = begun + length * s
        begun += length
    found = solve_bvp(slope, conditions, s, guess, tol=1e-9, max_nodes=100000)
    if not found.success:
        raise ArithmeticError(found.message)
    return found.y[-6:-3, -1]
