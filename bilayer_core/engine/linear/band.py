"""L D Lᵀ of a symmetric band matrix, and solution for one or several right-hand sides.

Storage is by columns of the lower triangle: ``band[j, r] = A[j + r, j]``, 0 ≤ r ≤ half-bandwidth, with as many rows
of padding at the end as the half-bandwidth. It is given as the length of a tuple, which is a compile-time constant:
inner loops have fixed lengths. Cost: n b² and 4 n b per right-hand side.
"""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.jit.called import stack_vector


def width(half_bandwidth: int) -> tuple[int, ...]:
    """Return a half-bandwidth as the functions below take it."""
    return (0,) * half_bandwidth


@kernel
def factor_band(band, n, b, counts):
    """Factorise a matrix of half-bandwidth `b` in place.

    Returns −1, or the first column whose pivot is not positive; or, if it `counts`, the number of negative pivots
    whatever their signs, which is that of negative eigenvalues (Sylvester's law of inertia).
    """
    negative = 0
    for j in range(n):
        pivot = band[j, 0]
        if not counts and not pivot > 0.0:
            return j
        negative += pivot < 0.0
        inverse = 1.0 / pivot
        for r in range(1, b + 1):
            multiplier = band[j, r] * inverse
            for s in range(r, b + 1):
                band[j + r, s - r] -= multiplier * band[j, s]
        for r in range(1, b + 1):
            band[j, r] *= inverse
    return negative if counts else -1


@kernel
def forward_band(band, n, bandwidth, right):
    """Overwrite `right`, of n + b values whose last b are zero, with L⁻¹ times it.

    The last b found are kept in registers: they would not be in memory in time for the next. (Each moves on where it is
    used: a loop for that alone would become one move in memory.)
    """
    b = len(bandwidth)
    found = stack_vector(bandwidth)
    for j in range(b):
        for r in range(1, b - j):
            right[j + r] -= band[j, r] * right[j]
        found[b - 1 - j] = right[j]
    for first in range(n - b):
        value = right[first + b]
        for r in range(b - 1, 0, -1):
            value -= band[first + b - 1 - r, r + 1] * found[r]
            found[r] = found[r - 1]
        value -= band[first + b - 1, 1] * found[0]
        found[0] = value
        right[first + b] = value


@kernel
def backward_band(band, n, bandwidth, right):
    """Overwrite the first n values of `right` with (D Lᵀ)⁻¹ times them."""
    b = len(bandwidth)
    found = stack_vector(bandwidth)
    for r in range(b):
        found[r] = 0.0
    for j in range(n - 1, -1, -1):
        value = right[j] / band[j, 0]
        for r in range(b - 1, 0, -1):  # what was found last is needed last
            value -= band[j, r + 1] * found[r]
            found[r] = found[r - 1]
        value -= band[j, 1] * found[0]
        found[0] = value
        right[j] = value
