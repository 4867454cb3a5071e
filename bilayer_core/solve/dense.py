"""Small dense systems of the border, in one thread: for a few dozen unknowns the threads of a BLAS cost far more than
the sums.

A = L Lᵀ is kept in the lower triangle.
"""

from __future__ import annotations

import math

from ..jit import kernel


@kernel
def factor_dense(matrix, n):
    """Factorise the first n rows and columns of a symmetric matrix in place; false if they are not positive
    definite.
    """
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if j < i:
                matrix[i, j] = total / matrix[j, j]
            elif total > 0.0:
                matrix[i, i] = math.sqrt(total)
            else:
                return False
    return True


@kernel
def solve_dense(factor, n, right):
    """Overwrite the first n values of a vector with the solution of the factorised system."""
    for i in range(n):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * right[k]
        right[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        right[i] /= factor[i, i]
        for k in range(i):
            right[k] -= factor[i, k] * right[i]
