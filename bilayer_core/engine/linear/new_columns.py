"""New columns of the border, after those that are there, and in which blocks of rows each has values."""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.model.sizes import ROWS_OF_BLOCK


@kernel
def clear_column(bordered, a):
    """Clear a column, which has values in the blocks alone that are noted."""
    border, filled = bordered.border, bordered.filled
    for k in range(filled.shape[1]):
        if filled[a, k]:
            for i in range(k * ROWS_OF_BLOCK, min((k + 1) * ROWS_OF_BLOCK, border.shape[1])):
                border[a, i] = 0.0
            filled[a, k] = False


@kernel
def add_columns(bordered, count):
    """Add columns of zeros to the border, and to the corner; there must be capacity for them."""
    base = bordered.width[0]
    bordered.width[0] = base + count
    for a in range(base if bordered.coupled[0] == 1 else 0, bordered.width[0]):
        clear_column(bordered, a)
    bordered.coupled[0] = 1
    for a in range(bordered.width[0]):
        for b in range(base if a < base else 0, bordered.width[0]):
            bordered.schur[a, b] = 0.0


@kernel
def add_to_column(bordered, a, row, value):
    """Add to a value of a column."""
    bordered.border[a, row] += value
    bordered.filled[a, row // ROWS_OF_BLOCK] = True
