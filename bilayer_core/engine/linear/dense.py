"""Small dense systems of the border, in one thread: for a few dozen unknowns the threads of a BLAS cost far more than
the sums.

A = L Lᵀ is kept in the lower triangle.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel


@kernel
def factor_dense(matrix, n, begins_out):
    """Factorise the first n rows and columns of a symmetric matrix in place; false if they are not positive
    definite.

    Four rows are made together, so that those before are read a quarter as often: of a few hundred rows they would not
    stay in the nearest cache. Zeros at the beginnings of rows, which stay zero, are left out; their numbers are left in
    `begins_out`.
    """
    for first in range(0, n, 4):
        last = min(first + 4, n)
        begin = 0
        for i in range(first, last):
            begins_out[i] = 0
            while begins_out[i] < i and matrix[i, begins_out[i]] == 0.0:
                begins_out[i] += 1
        if last == first + 4:
            begin = first
            left = min(min(begins_out[first], begins_out[first + 1]), min(begins_out[first + 2], begins_out[first + 3]))
            for j in range(left, first):
                t0, t1, t2, t3 = matrix[first, j], matrix[first + 1, j], matrix[first + 2, j], matrix[first + 3, j]
                both = max(left, begins_out[j])
                row0, row1, row2 = matrix[first, both:j], matrix[first + 1, both:j], matrix[first + 2, both:j]
                row3, other = matrix[first + 3, both:j], matrix[j, both:j]
                for k in range(other.shape[0]):
                    value = other[k]
                    t0 -= row0[k] * value
                    t1 -= row1[k] * value
                    t2 -= row2[k] * value
                    t3 -= row3[k] * value
                pivot = matrix[j, j]
                matrix[first, j], matrix[first + 1, j] = t0 / pivot, t1 / pivot
                matrix[first + 2, j], matrix[first + 3, j] = t2 / pivot, t3 / pivot
        for i in range(first, last):
            for j in range(max(begin, begins_out[i]), i + 1):
                total = matrix[i, j]
                for k in range(max(begins_out[i], begins_out[j]), j):
                    total -= matrix[i, k] * matrix[j, k]
                if j < i:
                    matrix[i, j] = total / matrix[j, j]
                elif total > 0.0:
                    matrix[i, i] = math.sqrt(total)
                else:
                    return False
    return True


@kernel
def solve_dense(factor, n, begins, right):
    """Overwrite the first n values of a vector with the solution of the factorised system."""
    for i in range(n):
        total = right[i]
        for k in range(begins[i], i):
            total -= factor[i, k] * right[k]
        right[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        right[i] /= factor[i, i]
        for k in range(begins[i], i):
            right[k] -= factor[i, k] * right[i]


PIVOT_RATIO = (1.0 + math.sqrt(17.0)) / 8.0
"""Of the largest value on the diagonal to that off it, above which a pivot is one value and not a block of two."""


@kernel
def count_negative_dense(matrix, n):
    """Return the number of negative eigenvalues of a symmetric matrix's first n rows and columns; −1 if not finite.

    Overwrite the lower triangle of the matrix.

    This is the number of negative eigenvalues of the pivots (Sylvester's law of inertia). Pivots are values on the
    diagonal or blocks of two, the largest left each time (Bunch and Parlett 1971, SIAM J. Numer. Anal. 8); a block has
    one.
    """
    total = 0.0
    for i in range(n):
        for j in range(i + 1):
            total += abs(matrix[i, j])
    if not math.isfinite(total):
        return -1
    negative = first = 0
    while first < n:
        on = off = 0.0
        pivot = low = high = first
        for i in range(first, n):
            if abs(matrix[i, i]) > on:
                on, pivot = abs(matrix[i, i]), i
            for j in range(first, i):
                if abs(matrix[i, j]) > off:
                    off, high, low = abs(matrix[i, j]), i, j
        if on == 0.0 and off == 0.0:
            return negative
        if on >= PIVOT_RATIO * off:
            exchange_dense(matrix, n, first, pivot)
            negative += matrix[first, first] < 0.0
            for i in range(first + 1, n):
                part = matrix[i, first] / matrix[first, first]
                for j in range(first + 1, i + 1):
                    matrix[i, j] -= part * matrix[j, first]
            first += 1
            continue
        exchange_dense(matrix, n, first, low)
        exchange_dense(matrix, n, first + 1, high)
        a, b, c = matrix[first, first], matrix[first + 1, first], matrix[first + 1, first + 1]
        determinant = a * c - b * b
        negative += 1
        for i in range(first + 2, n):
            u, v = matrix[i, first], matrix[i, first + 1]
            x, y = (c * u - b * v) / determinant, (a * v - b * u) / determinant
            for j in range(first + 2, i + 1):
                matrix[i, j] -= x * matrix[j, first] + y * matrix[j, first + 1]
        first += 2
    return negative


@kernel
def exchange_dense(matrix, n, a, b):
    """Exchange rows and columns a ≤ b of a symmetric matrix, kept in the lower triangle."""
    if a == b:
        return
    for j in range(a):
        matrix[a, j], matrix[b, j] = matrix[b, j], matrix[a, j]
    for i in range(a + 1, b):
        matrix[i, a], matrix[b, i] = matrix[b, i], matrix[i, a]
    for i in range(b + 1, n):
        matrix[i, a], matrix[i, b] = matrix[i, b], matrix[i, a]
    matrix[a, a], matrix[b, b] = matrix[b, b], matrix[a, a]
