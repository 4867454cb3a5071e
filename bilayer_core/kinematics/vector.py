"""Three-vectors as tuples of scalars, for kernels: after inlining they live in registers."""

from __future__ import annotations

import math

from bilayer_core.jit import kernel

SMALL_ANGLE = 0.05
"""Tangent up to which six terms of the series of the inverse tangent are exact to rounding."""

POSITIVE = 2**31 - 1
"""Mask that leaves places in arrays as they are, and tells the compiler that none counts from the end."""


@kernel
def row(array, k):
    """Return row k of an (n, ≥3) array as a tuple."""
    return array[k, 0], array[k, 1], array[k, 2]


@kernel
def dot(a, b):
    """Return a·b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def angle(cosine, sine):
    """Return the angle of the direction (cosine, sine) from (1, 0) [rad], −π to π: `math.atan2`, faster where it is
    small.
    """
    if abs(sine) < SMALL_ANGLE * cosine:
        x = sine / cosine
        y = x * x
        return x - x * y * (1.0 / 3.0 - y * (1.0 / 5.0 - y * (1.0 / 7.0 - y * (1.0 / 9.0 - y / 11.0))))
    return math.atan2(sine, cosine)


@kernel
def scaled(s, a):
    """Return s a"""
    return s * a[0], s * a[1], s * a[2]


@kernel
def combine(s, a, t, b):
    """Return s a + t b"""
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@kernel
def combine3(s, a, t, b, r, c):
    """Return s a + t b + r c"""
    return s * a[0] + t * b[0] + r * c[0], s * a[1] + t * b[1] + r * c[1], s * a[2] + t * b[2] + r * c[2]


@kernel
def add_row(array, k, s, a):
    """Add s a to array[k, :3]."""
    array[k, 0] += s * a[0]
    array[k, 1] += s * a[1]
    array[k, 2] += s * a[2]


@kernel
def add_column(array, k, column, s, a):
    """Add s a to array[k, :3, column]."""
    array[k, 0, column] += s * a[0]
    array[k, 1, column] += s * a[1]
    array[k, 2, column] += s * a[2]


@kernel
def add_outer(array, k, s, a, b):
    """Add s a bᵀ to array[k, :3, :3]."""
    for j in range(3):
        sb = s * (b[0] if j == 0 else (b[1] if j == 1 else b[2]))
        array[k, 0, j] += sb * a[0]
        array[k, 1, j] += sb * a[1]
        array[k, 2, j] += sb * a[2]


@kernel
def add_identity(array, k, s):
    """Add s I to array[k, :3, :3]."""
    array[k, 0, 0] += s
    array[k, 1, 1] += s
    array[k, 2, 2] += s


@kernel
def add_upper_outer(array, k, s, a):
    """Add s a aᵀ to the upper triangle of array[k, :3, :3]."""
    t0, t1 = s * a[0], s * a[1]
    array[k, 0, 0] += t0 * a[0]
    array[k, 0, 1] += t0 * a[1]
    array[k, 0, 2] += t0 * a[2]
    array[k, 1, 1] += t1 * a[1]
    array[k, 1, 2] += t1 * a[2]
    array[k, 2, 2] += s * a[2] * a[2]


@kernel
def add_upper_symmetric(array, k, s, a, b):
    """Add s (a bᵀ + b aᵀ) to the upper triangle of array[k, :3, :3]."""
    array[k, 0, 0] += 2.0 * s * a[0] * b[0]
    array[k, 0, 1] += s * (a[0] * b[1] + b[0] * a[1])
    array[k, 0, 2] += s * (a[0] * b[2] + b[0] * a[2])
    array[k, 1, 1] += 2.0 * s * a[1] * b[1]
    array[k, 1, 2] += s * (a[1] * b[2] + b[1] * a[2])
    array[k, 2, 2] += 2.0 * s * a[2] * b[2]


@kernel
def add_upper_projector(array, k, s, a):
    """Add s (I − a aᵀ) to the upper triangle of array[k, :3, :3], a a unit vector."""
    add_identity(array, k, s)
    add_upper_outer(array, k, -s, a)


@kernel
def add_upper_outer_sum(array, k, s, a, x, b, y, c, z):
    """Add s (a xᵀ + b yᵀ + c zᵀ), a sum that is symmetric, to the upper triangle of array[k, :3, :3]."""
    array[k, 0, 0] += s * (a[0] * x[0] + b[0] * y[0] + c[0] * z[0])
    array[k, 0, 1] += s * (a[0] * x[1] + b[0] * y[1] + c[0] * z[1])
    array[k, 0, 2] += s * (a[0] * x[2] + b[0] * y[2] + c[0] * z[2])
    array[k, 1, 1] += s * (a[1] * x[1] + b[1] * y[1] + c[1] * z[1])
    array[k, 1, 2] += s * (a[1] * x[2] + b[1] * y[2] + c[1] * z[2])
    array[k, 2, 2] += s * (a[2] * x[2] + b[2] * y[2] + c[2] * z[2])


@kernel
def add_outer_sum(array, k, s, a, x, b, y):
    """Add s (a xᵀ + b yᵀ) to array[k, :3, :3]."""
    for j in range(3):
        xj, yj = (x[0], y[0]) if j == 0 else ((x[1], y[1]) if j == 1 else (x[2], y[2]))
        array[k, 0, j] += s * (a[0] * xj + b[0] * yj)
        array[k, 1, j] += s * (a[1] * xj + b[1] * yj)
        array[k, 2, j] += s * (a[2] * xj + b[2] * yj)
