"""The band solver as pieces, one set for each half-bandwidth that models have (`model.unknown_order.HALF_BANDWIDTH`).

With the half-bandwidth known to the compiler inner loops have fixed lengths, and what the next row needs stays in
registers: for 200 nodes in space two to three times as fast as one set for all widths.
"""

from __future__ import annotations

from bilayer_core.engine.linear.band import backward_band, factor_band, forward_band, width
from bilayer_core.engine.linear.border import eliminate_border
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.piece import Piece
from bilayer_core.jit.record import Matrix, Vector
from bilayer_core.model.records.problem import BorderedSystem
from bilayer_core.model.records.status import READY


def _declare(function, suffix: str, *arguments) -> Piece:
    function.__name__ = f"{function.__name__}_{suffix}"
    return piece(int, *arguments)(function)


def _of_width(half_bandwidth: int) -> tuple[Piece, ...]:
    """Return the set of pieces for a half-bandwidth."""
    bandwidth = width(half_bandwidth)

    def factor(band, n, counts):
        return factor_band(band, n, half_bandwidth, counts)

    def forward(band, n, right):
        forward_band(band, n, bandwidth, right)
        return READY

    def backward(band, n, right):
        backward_band(band, n, bandwidth, right)
        return READY

    def eliminate(band, n, bordered):
        of = bordered
        eliminate_border(band, n, half_bandwidth, of.width[0], of.border, of.scaled, of.schur, of.present, of.filled)
        return READY

    return _set(factor, forward, backward, eliminate, str(half_bandwidth))


def _set(factorises, goes_forward, goes_backward, eliminates, suffix: str) -> tuple[Piece, ...]:
    return (
        _declare(factorises, suffix, Matrix, int, bool),
        _declare(goes_forward, suffix, Matrix, int, Vector),
        _declare(goes_backward, suffix, Matrix, int, Vector),
        _declare(eliminates, suffix, Matrix, int, BorderedSystem),
    )


SETS: dict[int, tuple[Piece, ...]] = {}
"""The pieces of each half-bandwidth."""
factor_5, forward_5, backward_5, eliminate_5 = SETS[5] = _of_width(5)
factor_7, forward_7, backward_7, eliminate_7 = SETS[7] = _of_width(7)
factor_9, forward_9, backward_9, eliminate_9 = SETS[9] = _of_width(9)
factor_10, forward_10, backward_10, eliminate_10 = SETS[10] = _of_width(10)
factor_14, forward_14, backward_14, eliminate_14 = SETS[14] = _of_width(14)
factor_18, forward_18, backward_18, eliminate_18 = SETS[18] = _of_width(18)
factor_26, forward_26, backward_26, eliminate_26 = SETS[26] = _of_width(26)


@kernel
def factorise_band(band, n, b, counts):
    """Factorise a band of any of these half-bandwidths, as `band.factor_band`; the band may hold more columns."""
    if b == 5:
        return factor_5(band, n, counts)
    if b == 7:
        return factor_7(band, n, counts)
    if b == 9:
        return factor_9(band, n, counts)
    if b == 10:
        return factor_10(band, n, counts)
    if b == 14:
        return factor_14(band, n, counts)
    if b == 18:
        return factor_18(band, n, counts)
    if b == 26:
        return factor_26(band, n, counts)
    return 0  # no width of a model: as if the first pivot were not positive


@kernel
def go_forward(band, n, b, right):
    """Overwrite `right` with L⁻¹ times it, as `band.forward_band`."""
    if b == 5:
        return forward_5(band, n, right)
    if b == 7:
        return forward_7(band, n, right)
    if b == 9:
        return forward_9(band, n, right)
    if b == 10:
        return forward_10(band, n, right)
    if b == 14:
        return forward_14(band, n, right)
    if b == 18:
        return forward_18(band, n, right)
    return forward_26(band, n, right)


@kernel
def go_backward(band, n, b, right):
    """Overwrite `right` with what `band.backward_band` finds."""
    if b == 5:
        return backward_5(band, n, right)
    if b == 7:
        return backward_7(band, n, right)
    if b == 9:
        return backward_9(band, n, right)
    if b == 10:
        return backward_10(band, n, right)
    if b == 14:
        return backward_14(band, n, right)
    if b == 18:
        return backward_18(band, n, right)
    return backward_26(band, n, right)


@kernel
def eliminate(band, n, b, bordered):
    """Eliminate the band from the border, as `border.eliminate_border`."""
    if b == 5:
        return eliminate_5(band, n, bordered)
    if b == 7:
        return eliminate_7(band, n, bordered)
    if b == 9:
        return eliminate_9(band, n, bordered)
    if b == 10:
        return eliminate_10(band, n, bordered)
    if b == 14:
        return eliminate_14(band, n, bordered)
    if b == 18:
        return eliminate_18(band, n, bordered)
    return eliminate_26(band, n, bordered)
