"""The border of the band matrix: each column has values in the rows of a few strands alone.

Rows are gone through in blocks. It is noted in which of these a column has values (`engine.linear.new_columns`), and no
others are read or written: memory is what a border of a thousand rows and some hundred columns takes long for. So the
Schur complement costs the sum over blocks of the squares of the columns that have values there.
"""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.model.sizes import ROWS_OF_BLOCK

AT_ONCE = 16
"""Columns that are eliminated together: one waits for what the row before has left in it, several do not."""


@kernel
def eliminate_border(band, n, b, m, border, scaled_out, corner, present, filled):
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
        Written in blocks with values alone: D⁻¹ L⁻¹ U, shape (≥ m, n + b).
    corner : Array
        C, shape (≥ m, ≥ m); overwritten with the Schur complement C − Uᵀ A⁻¹ U.
    present : Array
        Scratch, shape (≥ m,).
    filled : Array
        In which blocks of rows a column has values, brought up to date, shape (≥ m, ≥ number of blocks).

    Notes
    -----
    With z = L⁻¹ r, the solution for a right-hand side (r, s) is y = S⁻¹ (s − (D⁻¹ L⁻¹ U)ᵀ z) and
    x = (D Lᵀ)⁻¹ (z − (L⁻¹ U) y), S being the Schur complement.
    """
    for first in range(0, n, ROWS_OF_BLOCK):
        last, k, count = min(first + ROWS_OF_BLOCK, n), first // ROWS_OF_BLOCK, 0
        for a in range(m):
            if filled[a, k]:
                present[count] = a
                count += 1
        for begin in range(0, count, AT_ONCE):
            _solve_block(band, b, border, scaled_out, present, begin, min(begin + AT_ONCE, count), first, last)
        if last < n:
            for x in range(count):
                for j in range(last, min(last + b, n)):
                    if border[present[x], j] != 0.0:
                        filled[present[x], k + 1] = True
        for x in range(0, count, 2):
            _subtract_two(border, scaled_out, corner, present, count, x, first, last)
    for a in range(m):
        for c in range(a):
            corner[c, a] = corner[a, c]


@kernel
def _solve_block(band, b, border, scaled_out, present, begin, end, first, last):
    """Overwrite a few columns with L⁻¹ times them in a block of rows, and in what follows by them."""
    for j in range(first, last):
        inverse = 1.0 / band[j, 0]
        for x in range(begin, end):
            a = present[x]
            value = border[a, j]
            scaled_out[a, j] = value * inverse
            if value != 0.0:
                for r in range(1, b + 1):
                    border[a, j + r] -= band[j, r] * value


@kernel
def _subtract_two(border, scaled, corner, present, count, x, first, last):
    """Subtract the products of two columns, the x-th and the next that are present, with those up to them: four at
    once, so that each is read an eighth as often.
    """
    end = count - 1
    a, b = present[x], present[min(x + 1, end)]
    of_a, of_b = scaled[a, first:last], scaled[b, first:last]
    for y in range(0, min(x + 2, count), 4):
        c, d, e, f = present[y], present[min(y + 1, end)], present[min(y + 2, end)], present[min(y + 3, end)]
        of_c, of_d, of_e, of_f = (
            border[c, first:last],
            border[d, first:last],
            border[e, first:last],
            border[f, first:last],
        )
        s0, s1, s2, s3, t0, t1, t2, t3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(last - first):
            u, v = of_a[j], of_b[j]
            s0 += u * of_c[j]
            s1 += u * of_d[j]
            s2 += u * of_e[j]
            s3 += u * of_f[j]
            t0 += v * of_c[j]
            t1 += v * of_d[j]
            t2 += v * of_e[j]
            t3 += v * of_f[j]
        for k in range(min(4, x + 2 - y)):
            other = c if k == 0 else d if k == 1 else e if k == 2 else f
            if y + k <= x:
                corner[a, other] -= s0 if k == 0 else s1 if k == 1 else s2 if k == 2 else s3
            if x < end:
                corner[b, other] -= t0 if k == 0 else t1 if k == 1 else t2 if k == 2 else t3


@kernel
def column_times(values, filled, a, n, right):
    """Return the product of a column with a vector."""
    total = 0.0
    for first in range(0, n, ROWS_OF_BLOCK):
        if filled[a, first // ROWS_OF_BLOCK]:
            last = min(first + ROWS_OF_BLOCK, n)
            one, other = values[a, first:last], right[first:last]
            for j in range(last - first):
                total += one[j] * other[j]
    return total


@kernel
def subtract_column(values, filled, a, n, part, right):
    """Subtract a multiple of a column from a vector."""
    for first in range(0, n, ROWS_OF_BLOCK):
        if filled[a, first // ROWS_OF_BLOCK]:
            last = min(first + ROWS_OF_BLOCK, n)
            one, other = values[a, first:last], right[first:last]
            for j in range(last - first):
                other[j] -= one[j] * part
