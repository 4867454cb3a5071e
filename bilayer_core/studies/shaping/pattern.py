"""Values of a pattern that solve linear equations as nearly as their bounds and palettes allow.

Unknowns u are parts of the way between bounds. Besides the equations, second differences of patterns are to be small.
A palette makes this a problem of whole numbers, for which each piece in turn, from the start of the rod on, takes the
value of its palette next to the best one, as those after it can make up for the rest (Babai). Then neighbours change
together as long as that helps.

L. Babai, On Lovász' lattice reduction and the nearest lattice point problem, Combinatorica 6 (1986), 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.linalg import lstsq
from scipy.optimize import lsq_linear

from bilayer_core.studies.shaping.varied import Varied

Array = np.ndarray
POINTS = 100
"""Of the pattern whose roughness has the given weight; that of others goes as the square of their number."""
FAINT = 1e-4
"""Weight of staying: pieces that cannot be told apart stay near what is best without a palette, within its bounds."""
SWEEPS = 20
"""Most passes over the pieces of palettes."""


class Pattern:
    """All values that vary, one after the other.

    Parameters
    ----------
    varied : sequence of Varied
    smoothness : float
        Weight of roughness.

    Attributes
    ----------
    low, high : ndarray
        Bounds of values, shape (n_value,).
    in_palette : ndarray of bool
        Which values are those of palettes, shape (n_value,).
    """

    def __init__(self, varied: Sequence[Varied], smoothness: float):
        counts = [len(v.start) for v in varied]
        self.low = np.repeat([v.low for v in varied], counts)
        self.high = np.repeat([v.high for v in varied], counts)
        self._begins = np.cumsum(counts)[:-1]
        self._palettes = [v.palette for v in varied for _ in v.start]
        self.in_palette = np.array([bool(palette) for palette in self._palettes])
        begin, rough = 0, [np.zeros((0, len(self.low)))]
        for v, count in zip(varied, counts, strict=True):
            part = np.zeros((max(count - 2, 0), len(self.low)))
            part[:, begin : begin + count] = np.diff(np.eye(count), 2, axis=0)
            begin += count
            if not v.palette:
                rough.append(smoothness * (count / POINTS) ** 2 * part)
        self._rough = np.concatenate(rough)

    def split(self, values: Array) -> list[Array]:
        """Return the values of each that varies."""
        return np.split(values, self._begins)

    def parts(self, values: Array) -> Array:
        """Return values as parts of the way between their bounds."""
        return (values - self.low) / (self.high - self.low)

    def is_printable(self, values: Array) -> bool:
        """Return whether values with a palette are of their palettes."""
        return all(not palette or value in palette for palette, value in zip(self._palettes, values, strict=True))

    def roughness(self, values: Array) -> float:
        """Return the sum of squares that is added to those of equations."""
        return float(((self._rough @ self.parts(values)) ** 2).sum())

    def solved(self, rows: Array, right: Array, now: Array, moving: Array, damping: float) -> Array:
        """Return the values v that minimise the squares of linear equations and the roughness, within their bounds.

        Parameters
        ----------
        rows, right : ndarray
            Equations rows · (v − now) + right = 0, shapes (n, n_value) and (n,).
        now : ndarray
        moving : ndarray of bool
            Which values may change, shape (n_value,).
        damping : float
            Weight of staying there.
        """
        matrix, wanted, part = *self._problem(rows, right, now, damping), self.parts(now)
        q, r = np.linalg.qr(matrix[:, moving])
        wanted = q.T @ (wanted - matrix[:, ~moving] @ part[~moving])
        found = lstsq(r, wanted)[0]
        if not ((found >= 0.0) & (found <= 1.0)).all():
            found = lsq_linear(r, wanted, bounds=(0.0, 1.0), tol=1e-12).x
        part[moving] = np.clip(found, 0.0, 1.0)
        return np.where(moving, self._at(part), now)

    def printable(self, rows: Array, right: Array, now: Array, moving: Array) -> Array:
        """Return values likewise, those with a palette of their palettes."""
        matrix, wanted, part = *self._problem(rows, right, now, FAINT), self.parts(now)
        chosen, free = (np.flatnonzero(moving & of).tolist() for of in (self.in_palette, ~self.in_palette))
        choices = {k: (np.array(self._palettes[k]) - self.low[k]) / (self.high[k] - self.low[k]) for k in chosen}
        order = free + chosen[::-1]
        q, r = np.linalg.qr(matrix[:, order])
        turned = q.T @ (wanted - matrix[:, ~moving] @ part[~moving])
        for place in reversed(range(len(order))):
            k = order[place]
            best = (turned[place] - r[place, place + 1 :] @ part[order[place + 1 :]]) / r[place, place]
            part[k] = choices[k][np.argmin(np.abs(choices[k] - best))] if k in choices else np.clip(best, 0.0, 1.0)
        self._change_together(matrix, matrix @ part - wanted, part, choices)
        values = np.where(moving, self._at(part), now)
        for k in chosen:
            values[k] = self._palettes[k][np.argmin(np.abs(choices[k] - part[k]))]
        return values

    def _change_together(self, matrix: Array, left: Array, found: Array, choices: dict[int, Array]) -> None:
        """Let neighbours have other values of their palettes as long as the squares of what is left get smaller."""
        pairs = [[k, k + 1] if k + 1 in choices else [k] for k in choices]
        for _ in range(SWEEPS):
            before = left @ left
            for pair in pairs:
                columns = matrix[:, pair]
                tried = np.array(list(product(*(choices[k] for k in pair))))
                after = left[:, None] + columns @ (tried - found[pair]).T
                best = int(np.argmin((after**2).sum(axis=0)))
                found[pair], left = tried[best], after[:, best]
            if left @ left >= (1.0 - 1e-9) * before:
                break

    def _at(self, part: Array) -> Array:
        return self.low + (self.high - self.low) * part

    def _problem(self, rows: Array, right: Array, now: Array, damping: float) -> tuple[Array, Array]:
        """Return the matrix and the right side of equations for parts of the way between bounds."""
        count, part = len(self.low), self.parts(now)
        held = damping * np.eye(count if damping else 0, count)
        rows = rows * (self.high - self.low)
        wanted = [rows @ part - right, np.zeros(len(self._rough)), held @ part]
        return np.concatenate([rows, self._rough, held]), np.concatenate(wanted)
