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
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtpqrt
from scipy.optimize import lsq_linear

from bilayer_core.studies.shaping.varied import Varied

Array = np.ndarray
POINTS = 100
"""Of the pattern whose roughness has the given weight; that of others goes as the square of their number."""
FAINT = 1e-4
"""Weight of staying: pieces that cannot be told apart stay near what is best without a palette, within its bounds."""
FAINTEST = 1e-10
"""The least weight of staying: what moves nothing stays where it is."""
SWEEPS = 20
"""Most passes over the pieces of palettes."""
FEW, BLOCK, AT_ONCE = 200, 32, 8192
"""Columns that are reflected one by one, otherwise so many together, and elements of rows that are reflected at once:
threads, which BLAS starts else, wait for each other longer than a small problem takes.
"""


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
        order = np.flatnonzero(moving)
        matrix, wanted = self._triangle(rows, right, now, order, damping)
        least, most = (self.parts(of)[order] - self.parts(now)[order] for of in (self.low, self.high))
        step = solve_triangular(matrix, wanted)
        if not ((step >= least) & (step <= most)).all():
            step = lsq_linear(matrix, wanted, bounds=(least, most), tol=1e-12).x
        return self._moved(now, order, step)

    def printable(self, rows: Array, right: Array, now: Array, moving: Array) -> Array:
        """Return values likewise, those with a palette of their palettes."""
        chosen, free = (np.flatnonzero(moving & of) for of in (self.in_palette, ~self.in_palette))
        order = np.concatenate([free, chosen[::-1]])
        matrix, wanted = self._triangle(rows, right, now, order, FAINT)
        least, most = (self.parts(of)[order] - self.parts(now)[order] for of in (self.low, self.high))
        palettes = [np.array(self._palettes[k]) for k in order]
        steps = [(own - now[k]) / (self.high - self.low)[k] for k, own in zip(order, palettes, strict=True)]
        found = np.zeros(len(order))
        for k in reversed(range(len(order))):
            best = (wanted[k] - matrix[k, k + 1 :] @ found[k + 1 :]) / matrix[k, k]
            allowed = steps[k] if len(steps[k]) else np.clip([best], least[k], most[k])
            found[k] = allowed[np.argmin(np.abs(allowed - best))]
        self._change_together(matrix, matrix @ found - wanted, found, steps)
        values = self._moved(now, order, found)
        for k, own in zip(order, palettes, strict=True):
            values[k] = own[np.argmin(np.abs(own - values[k]))] if len(own) else values[k]
        return values

    def _change_together(self, matrix: Array, left: Array, found: Array, steps: list[Array]) -> None:
        """Let neighbours have other values of their palettes as long as the squares of what is left get smaller."""
        chosen = [k for k, own in enumerate(steps) if len(own)][::-1]
        pairs = [*zip(chosen, chosen[1:], strict=False), chosen[-1:]]
        for _ in range(SWEEPS):
            before = left @ left
            for pair in pairs:
                some = list(pair)
                tried = np.array(list(product(*(steps[k] for k in some))))
                after = left[:, None] + matrix[:, some] @ (tried - found[some]).T
                best = int(np.argmin((after**2).sum(axis=0)))
                found[some], left = tried[best], after[:, best]
            if left @ left >= (1.0 - 1e-9) * before:
                break

    def _moved(self, now: Array, order: Array, step: Array) -> Array:
        """Return values of which some are moved by parts of the way between their bounds."""
        part = self.parts(now)
        part[order] = np.clip(part[order] + step, 0.0, 1.0)
        values = now.copy()
        values[order] = (self.low + (self.high - self.low) * part)[order]
        return values

    def _triangle(self, rows: Array, right: Array, now: Array, order: Array, damping: float) -> tuple[Array, Array]:
        """Return the triangular matrix and the right side of equations for steps of some parts, in some order.

        Those of staying are triangular; a few of the others after the other are reflected into them.
        """
        count, rough = len(order), self._rough @ self.parts(now)
        equations = np.empty((len(rows) + len(rough), count + 1), order="F")
        equations[:, :-1] = np.concatenate([rows * (self.high - self.low), self._rough])[:, order]
        equations[:, -1] = np.concatenate([-right, -rough])
        found = np.asfortranarray(np.diag([max(damping, FAINTEST)] * count + [0.0]))
        columns = 1 if count <= FEW else BLOCK
        for some in np.array_split(equations, -(-equations.size // AT_ONCE)):
            found, *_ = dtpqrt(0, columns, found, some, overwrite_a=1)
        return found[:-1, :-1], found[:-1, -1]
