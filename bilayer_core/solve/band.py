"""L D Lᵀ of a symmetric band matrix, and solution for one or several right-hand sides.

Storage is by columns of the lower triangle: ``band[j, r] = A[j + r, j]``, 0 ≤ r ≤ half-bandwidth, with as many rows
of padding at the end
as the half-bandwidth. It is a compile-time constant, so inner loops have fixed lengths. Cost: n b² and 4 n b per
right-hand side.
"""

from __future__ import annotations

from functools import cache

from ..jit import kernel


@cache
def band_kernels(half_bandwidth: int):
    """Compile-time specialised ``factor(band, n)``, ``solve(band, n, right)`` and ``solve_border(band, n, right)``.

    ``factor`` works in place and returns −1, or the first column whose pivot is not positive. The others overwrite
    ``right``, of n + half_bandwidth rows whose last half_bandwidth are zero: a vector, or a matrix with the columns
    of a border.
    """
    b = half_bandwidth

    @kernel
    def factor(band, n):
        for j in range(n):
            pivot = band[j, 0]
            if not pivot > 0.0:
                return j
            inverse = 1.0 / pivot
            for r in range(1, b + 1):
                multiplier = band[j, r] * inverse
                for s in range(r, b + 1):
                    band[j + r, s - r] -= multiplier * band[j, s]
            for r in range(1, b + 1):
                band[j, r] *= inverse
        return -1

    @kernel
    def solve(band, n, right):
        for j in range(n):
            value = right[j]
            for r in range(1, b + 1):
                right[j + r] -= band[j, r] * value
        for j in range(n - 1, -1, -1):
            value = right[j] / band[j, 0]
            for r in range(1, b + 1):
                value -= band[j, r] * right[j + r]
            right[j] = value

    @kernel
    def solve_border(band, n, right):
        m = right.shape[1]
        for j in range(n):
            for r in range(1, b + 1):
                for c in range(m):
                    right[j + r, c] -= band[j, r] * right[j, c]
        for j in range(n - 1, -1, -1):
            inverse = 1.0 / band[j, 0]
            for c in range(m):
                right[j, c] *= inverse
            for r in range(1, b + 1):
                for c in range(m):
                    right[j, c] -= band[j, r] * right[j + r, c]

    return factor, solve, solve_border


@cache
def signed_factor(half_bandwidth: int):
    """``factor(band, n)`` of `band_kernels` for matrices that need not be positive definite: it goes on behind negative
    pivots and returns their number, which is that of negative eigenvalues (Sylvester's law of inertia).
    """
    b = half_bandwidth

    @kernel
    def factor(band, n):
        negative = 0
        for j in range(n):
            pivot = band[j, 0]
            negative += pivot < 0.0
            inverse = 1.0 / pivot
            for r in range(1, b + 1):
                multiplier = band[j, r] * inverse
                for s in range(r, b + 1):
                    band[j + r, s - r] -= multiplier * band[j, s]
            for r in range(1, b + 1):
                band[j, r] *= inverse
        return negative

    return factor
