"""What is special about how kernels are compiled: functions inside them, and elements of arrays."""

import numpy as np
import pytest

from bilayer_core.jit import inner, kernel


@inner
def _twice(x):
    return 2.0 * x


@inner
def _thrice(x):
    return _twice(x) + x


@kernel
def _sum_of_triples(values):
    total = 0.0
    for i in range(values.shape[0]):
        total += _thrice(values[i])
    return total


def test_functions_within_functions_are_compiled_into_the_kernel():
    assert _sum_of_triples(np.array([1.0, 2.0, 4.0])) == 21.0


def test_the_interpreter_cannot_call_what_only_kernels_call():
    with pytest.raises(TypeError, match="_twice is called by kernels alone"):
        _twice(1.0)


@kernel
def _ends(a, m, c, k):
    return a[-1], a[k], m[-2, 1], m[k, -1], c[1, -1, 0], c[k, k, k]


@kernel
def _write(a, m, flags, counts, k):
    a[k] = 7
    m[-1, k] += 0.5
    flags[0, k] = True
    counts[k] -= 2


@kernel
def _row(m, k):
    return m[k].sum() + m[:, 1].sum()


def test_elements_of_arrays_count_from_either_end():
    a, m, c = np.arange(5.0), np.arange(12.0).reshape(3, 4), np.arange(24.0).reshape(2, 3, 4)
    for k in (0, -1):
        assert _ends(a, m, c, k) == (a[-1], a[k], m[-2, 1], m[k, -1], c[1, -1, 0], c[k, k, k])


def test_elements_of_every_kind_are_written():
    a, m, flags, counts = np.zeros(3), np.zeros((2, 3)), np.zeros((1, 3), dtype=bool), np.zeros(3, dtype=np.int64)
    _write(a, m, flags, counts, -2)
    assert a.tolist() == [0, 7, 0] and m.tolist() == [[0, 0, 0], [0, 0.5, 0]]
    assert flags.tolist() == [[False, True, False]] and counts.tolist() == [0, -2, 0]


def test_strided_arrays_and_slices_mean_the_same():
    m = np.arange(12.0).reshape(3, 4)
    assert _row(m, 1) == m[1].sum() + m[:, 1].sum()
    strided = np.arange(24.0).reshape(3, 8)[:, ::2]
    assert _ends(np.arange(10.0)[::2], strided, np.arange(24.0).reshape(4, 3, 2).T, 1)[2] == strided[-2, 1]
