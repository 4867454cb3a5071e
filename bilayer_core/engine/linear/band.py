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


SHORT_GAP = 8
"""Zeros in a row of a border that cost less than another run of values."""
AT_ONCE = 16
"""Columns of a border that are eliminated together: one waits for what the row before has left in it, several do not.
More would not stay in the nearest cache."""


@kernel
def eliminate_band(band, n, b, m, border, scaled_out, corner, present):
    """Eliminate the factorised band A = L D Lᵀ from a matrix with m more columns and rows,

        [ A   U ]
        [ Uᵀ  C ]

    Parameters
    ----------
    b, m : int
        Half-bandwidth of A, and number of columns.
    border : Array
        U by columns, shape (≥ m, n + b), zeros at the end; overwritten with L⁻¹ U.
    scaled_out : Array
        Written: D⁻¹ L⁻¹ U, shape (≥ m, n + b).
    corner : Array
        C, shape (≥ m, ≥ m); overwritten with the Schur complement C − Uᵀ A⁻¹ U.
    present : Array
        Scratch: from and to which row a column is not zero, shape (≥ n + 1,).

    Notes
    -----
    With z = L⁻¹ r, the solution for a right-hand side (r, s) is y = S⁻¹ (s − (D⁻¹ L⁻¹ U)ᵀ z) and
    x = (D Lᵀ)⁻¹ (z − (L⁻¹ U) y), S being the Schur complement. Most of U is zero, and so is most of L⁻¹ U: blocks of A
    (strands) that a column does not touch stay zero. So the cost is m² times the rows of a few strands.
    """
    for first in range(0, m, AT_ONCE):
        last = min(first + AT_ONCE, m)
        for j in range(n):
            inverse = 1.0 / band[j, 0]
            for a in range(first, last):
                value = border[a, j]
                scaled_out[a, j] = value * inverse
                if value != 0.0:
                    for r in range(1, b + 1):
                        border[a, j + r] -= band[j, r] * value
    for a in range(m):
        runs = _runs(border[a], n, present)
        most = (a + 1) // 4 * 4
        for c in range(0, most, 4):  # four at once, so that a column is read a quarter as often
            t0, t1, t2, t3 = 0.0, 0.0, 0.0, 0.0
            for k in range(runs):
                for j in range(present[2 * k], present[2 * k + 1]):
                    value = scaled_out[a, j]
                    t0 += value * border[c, j]
                    t1 += value * border[c + 1, j]
                    t2 += value * border[c + 2, j]
                    t3 += value * border[c + 3, j]
            corner[a, c] -= t0
            corner[a, c + 1] -= t1
            corner[a, c + 2] -= t2
            corner[a, c + 3] -= t3
        for c in range(most, a + 1):
            for k in range(runs):
                total = 0.0
                for j in range(present[2 * k], present[2 * k + 1]):
                    total += scaled_out[a, j] * border[c, j]
                corner[a, c] -= total
        for c in range(a):
            corner[c, a] = corner[a, c]


@kernel
def _runs(values, n, present_out):
    """Write from and to where the first n values are not zero, one pair after the other; return how many there are.

    Zeros between two values that are nearer than `SHORT_GAP` belong to a run.
    """
    count, end = 0, -SHORT_GAP
    for j in range(n):
        if values[j] != 0.0:
            if j - end >= SHORT_GAP:
                present_out[2 * count] = j
                count += 1
            end = j + 1
            present_out[2 * count - 1] = end
    return count
