"""The band solver, with a set of pieces for each half-bandwidth that a model has."""

import numpy as np
import pytest

from bilayer_core.engine.linear.widths import factorise_band, go_backward, go_forward
from bilayer_core.jit import kernel
from bilayer_core.model.unknown_order import HALF_BANDWIDTH, OF_RAILS


@kernel
def solve(band, size, half_bandwidth, right):
    status = factorise_band(band, size, half_bandwidth, False)
    go_forward(band, size, half_bandwidth, right)
    go_backward(band, size, half_bandwidth, right)
    return status


ALL = {b for table in (HALF_BANDWIDTH, OF_RAILS) for widths in table.values() for b in widths.values()}


@pytest.mark.parametrize("half_bandwidth", sorted(ALL))
def test_a_band_of_each_width_is_solved(half_bandwidth):
    rng, size = np.random.default_rng(half_bandwidth), 40
    dense = np.zeros((size, size))
    band = np.zeros((size + half_bandwidth, half_bandwidth + 1))
    for j in range(size):
        for r in range(min(half_bandwidth, size - 1 - j) + 1):
            value = 2.0 * half_bandwidth + 1.0 if r == 0 else rng.uniform(-1, 1)
            band[j, r] = dense[j, j + r] = dense[j + r, j] = value
    right = np.concatenate([rng.standard_normal(size), np.zeros(half_bandwidth)])
    expected = np.linalg.solve(dense, right[:size])
    roomy, again = np.zeros((size + 26, 27)), np.concatenate([right, np.zeros(26 - half_bandwidth)])
    roomy[: len(band), : half_bandwidth + 1] = band
    assert solve(band, size, half_bandwidth, right) == -1
    assert right[:size] == pytest.approx(expected, rel=1e-12, abs=1e-14)
    assert solve(roomy, size, half_bandwidth, again) == -1
    assert np.array_equal(again[:size], right[:size])


def test_a_width_of_no_model_is_not_solved():
    assert factorise_band(np.ones((40, 4)), 30, 3, False) == 0
