"""Copies between arrays of one shape. (An assignment of slices compiles the text of its own error message: seconds.)"""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.jit.called import flat


@kernel
def copy(source, target):
    """Write target = source, for contiguous arrays."""
    a, b = flat(source), flat(target)
    for i in range(a.shape[0]):
        b[i] = a[i]


@kernel
def add_scaled(target, factor, source):
    """Add factor × source to target, for contiguous arrays."""
    a, b = flat(source), flat(target)
    for i in range(a.shape[0]):
        b[i] += factor * a[i]


@kernel
def copy_row(source, i, target, j):
    """Write target[j] = source[i], for rows of three."""
    for c in range(3):
        target[j, c] = source[i, c]


@kernel
def copy_matrix(source, i, target, j):
    """Write target[j] = source[i], for 3 × 3 matrices."""
    for c in range(3):
        for k in range(3):
            target[j, c, k] = source[i, c, k]
