"""New columns of the border, after those that are there."""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.model.sizes import ROWS_OF_BLOCK


@kernel
def add_columns(bordered, count, noted):
    """Add columns of zeros to the border, and to the corner; there must be capacity for them.

    If it is `noted` in which blocks of rows these get values, it is by `add_to_column`; of all others they may be
    anywhere.
    """
    base, border, filled = bordered.width[0], bordered.border, bordered.filled
    bordered.width[0] = base + count
    cleared = base if bordered.coupled[0] == 1 else 0
    bordered.coupled[0] = 1
    for a in range(bordered.width[0]):
        for k in range(filled.shape[1]):
            if a >= cleared and (a >= bordered.noted[0] or filled[a, k]):
                for i in range(k * ROWS_OF_BLOCK, min((k + 1) * ROWS_OF_BLOCK, border.shape[1])):
                    border[a, i] = 0.0
            filled[a, k] = a < base or not noted
    for a in range(bordered.width[0]):
        for b in range(base if a < base else 0, bordered.width[0]):
            bordered.schur[a, b] = 0.0


@kernel
def add_to_column(bordered, a, row, value):
    """Add to a value of a column."""
    bordered.border[a, row] += value
    bordered.filled[a, row // ROWS_OF_BLOCK] = True
