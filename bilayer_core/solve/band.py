"""L D Lᵀ of a symmetric band matrix, and solution for one or several right-hand sides.

Storage is by columns of the lower triangle: ``band[j, r] = A[j + r, j]``, 0 ≤ r ≤ half-bandwidth, with as many rows
of padding at the end
as the half-bandwidth. It is given as the length of a tuple, which is a compile-time constant: inner loops have fixed
lengths. Cost: n b² and 4 n b per right-hand side.
"""

from __future__ import annotations

from ..jit import kernel


def width(half_bandwidth: int) -> tuple[int, ...]:
    """A half-bandwidth as the functions below take it."""
    return (0,) * half_bandwidth


@kernel
def factor_band(band, n, bandwidth):
    """Factorise in place; return −1, or the first column whose pivot is not positive."""
    b = len(bandwidth)
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
def factor_signed(band, n, bandwidth):
    """Factorise a matrix that need not be positive definite, in place; return the number of its negative pivots, which
    is that of negative eigenvalues (Sylvester's law of inertia).
    """
    b = len(bandwidth)
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


@kernel
def solve_band(band, n, bandwidth, right):
    """Overwrite `right`, of n + b values whose last b are zero, with the solution of the factorised system."""
    b = len(bandwidth)
    for j in range(n):
        value = right[j]
        for r in range(1, b + 1):
            right[j + r] -= band[j, r] * value
    for j in range(n - 1, -1, -1):
        value = right[j] / band[j, 0]
        for r in range(b, 0, -1):  # what was found last is needed last
            value -= band[j, r] * right[j + r]
        right[j] = value


@kernel
def solve_columns(band, n, bandwidth, m, right):
    """As `solve_band` for each of the first m columns of `right`, shape (n + b, ≥ m): those of a border."""
    b = len(bandwidth)
    if right.shape[1] == 1:
        solve_band(band, n, bandwidth, right.reshape(right.size))
        return
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
