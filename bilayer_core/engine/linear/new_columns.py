"""New columns of the border, after those that are there."""

from __future__ import annotations

from bilayer_core.jit import kernel


@kernel
def add_columns(bordered, count):
    """Add columns of zeros to the border, and to the corner; there must be capacity for them."""
    base = bordered.width[0]
    bordered.width[0] = base + count
    cleared = base if bordered.coupled[0] == 1 else 0
    bordered.coupled[0] = 1
    for a in range(cleared, bordered.width[0]):
        for i in range(bordered.border.shape[1]):
            bordered.border[a, i] = 0.0
    for a in range(bordered.width[0]):
        for b in range(base, bordered.width[0]):
            bordered.schur[a, b] = bordered.schur[b, a] = 0.0
