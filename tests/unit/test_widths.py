"""The band solver for half-bandwidths that have no pieces of their own."""

import numpy as np
import pytest

from bilayer_core.engine.linear.newton_matrix import call_factor, call_solve
from bilayer_core.engine.linear.widths import KNOWN, NAMES, addresses_for
from bilayer_core.jit import piece, record
from bilayer_core.jit.record import Matrix, Vector


@record
class BandProblem:
    band: Matrix
    right: Vector
    size: int
    factor: int
    forward: int
    backward: int


@piece(int, BandProblem)
def solve_band_for_a_test(p):
    status = call_factor(p.factor, (p.band, p.size, False))
    call_solve(p.forward, (p.band, p.size, p.right))
    call_solve(p.backward, (p.band, p.size, p.right))
    return status


@pytest.mark.parametrize("half_bandwidth", [3, 7, 10, 18])
def test_a_band_of_any_width_is_solved(half_bandwidth):
    rng, size = np.random.default_rng(half_bandwidth), 40
    dense = np.zeros((size, size))
    band = np.zeros((size + half_bandwidth, half_bandwidth + 1))
    for j in range(size):
        for r in range(min(half_bandwidth, size - 1 - j) + 1):
            value = 2.0 * half_bandwidth + 1.0 if r == 0 else rng.uniform(-1, 1)
            band[j, r] = dense[j, j + r] = dense[j + r, j] = value
    right = np.concatenate([rng.standard_normal(size), np.zeros(half_bandwidth)])
    expected = np.linalg.solve(dense, right[:size])
    found = dict(zip(NAMES, addresses_for(half_bandwidth).values(), strict=True))
    problem = BandProblem(
        band=band,
        right=right,
        size=size,
        factor=found["factor_band"],
        forward=found["forward_band"],
        backward=found["backward_band"],
    )
    assert solve_band_for_a_test(problem) == -1
    assert right[:size] == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_both_models_in_both_dimensions_have_pieces_of_their_own_width():
    assert KNOWN == (5, 9, 10, 18)
