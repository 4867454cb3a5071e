"""Groups of arrays as kernels read them, and arrays on the stack of a kernel."""

import numpy as np
import pytest

from bilayer_core.jit import kernel
from bilayer_core.kinematics.stack import stack_matrix, stack_vector
from bilayer_core.march.group import group


@group
class Inner:
    values: np.ndarray
    scale: float


@group
class Outer:
    flag: bool
    count: int
    absent: np.ndarray | None
    table: np.ndarray
    inner: Inner
    pair: tuple[Inner, ...]
    shape: tuple[int, ...]
    last: float


def _outer(absent=None):
    inner = Inner(values=np.arange(3.0), scale=2.0)
    other = Inner(values=np.array([7.0, 8.0]), scale=-0.5)
    table = np.arange(12, dtype=np.int64).reshape(3, 4)
    return Outer(
        flag=True, count=5, absent=absent, table=table, inner=inner, pair=(inner, other), shape=(4, 9), last=0.25
    )


@kernel
def _read(g, which):
    chosen = g.pair[which]
    return g.flag, g.count, g.table[2, 1], g.table.shape[1], g.inner.scale, chosen.values[-1], g.shape[1], g.last


@kernel
def _is_absent(values):
    if values is None:
        return True
    return False


@kernel
def _absent_in(g):
    return _is_absent(g.absent)


@kernel
def _change(g):
    g.inner.values[1] = 42.0


def test_a_kernel_reads_every_kind_of_field():
    assert _read(_outer(), 0) == (True, 5, 9, 4, 2.0, 2.0, 9, 0.25)
    assert _read(_outer(), 1) == (True, 5, 9, 4, 2.0, 8.0, 9, 0.25)


def test_an_absent_field_is_none_in_the_kernel():
    assert _absent_in(_outer()) is True
    assert _absent_in(_outer(np.zeros(2))) is False


def test_what_a_kernel_writes_is_seen_by_all_who_hold_the_array():
    g = _outer()
    _change(g)
    assert g.inner.values[1] == g.pair[0].values[1] == 42.0


def test_a_group_keeps_its_arrays_alive():
    g = _outer()
    garbage = [np.full(12, -1) for _ in range(100)]
    assert _read(g, 0) == (True, 5, 9, 4, 2.0, 2.0, 9, 0.25)
    assert all(array[0] == -1 for array in garbage)


def test_a_group_has_the_fields_of_its_class_and_no_others():
    with pytest.raises(TypeError, match="Inner: has the fields values, scale"):
        Inner(values=np.zeros(1))
    with pytest.raises(TypeError, match="scale: a str cannot stand in a group"):
        Inner(values=np.zeros(1), scale="2")


@kernel
def _products(n):
    a, m = stack_vector(3), stack_matrix(3, 4)
    total = 0.0
    for k in range(n):
        for i in range(3):
            a[i] = k + i
            for j in range(4):
                m[i, j] = a[i] * j
        total += m[2, 3] + m[1, 1]
    return total


def test_arrays_on_the_stack_hold_what_is_written():
    assert _products(4) == sum(3 * (k + 2) + (k + 1) for k in range(4))
