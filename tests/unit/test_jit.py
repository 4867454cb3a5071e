"""What is special about how kernels are compiled: functions inside them, and elements of arrays."""

import gc
import operator
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from numba.core import types
from numba.core.compiler import Flags
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.core.typing.templates import signature

from bilayer_core.errors import InputError
from bilayer_core.jit import inner, kernel
from bilayer_core.jit.collector import few_collections
from bilayer_core.jit.flags import KernelFlags
from bilayer_core.jit.operators import RESULTS, TARGET


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


def test_a_kernel_within_a_kernel_gets_an_entry_only_when_the_interpreter_calls_it():
    @kernel
    def half(x):  # made here, it is not taken from the cache
        return 0.5 * x

    @kernel
    def sum_of_halves(values):
        total = 0.0
        for i in range(values.shape[0]):
            total += half(values[i])
        return total

    assert sum_of_halves(np.array([1.0, 2.0, 4.0])) == 3.5
    assert half.signatures == [] and len(half.inside.signatures) == 1
    assert half(3.0) == 1.5
    assert half.signatures == half.inside.signatures and len(half.signatures) == 1


def test_the_collector_is_left_as_it_was():
    before = gc.get_threshold()
    with pytest.raises(InputError), few_collections():
        assert gc.get_threshold() != before
        raise InputError("none")
    assert gc.get_threshold() == before


LEAF = """
from bilayer_core.jit import inner

@inner
def leaf(x):
    return {}
"""
MIDDLE = """
from bilayer_core.jit import inner
from leaf import leaf

@inner
def middle(x):
    return 2 * leaf(x)
"""
ENTRY = """
import sys
from bilayer_core.jit import kernel
from middle import middle

@kernel
def {0}(x):
    return middle(x) + max(x, 0.0)

print({0}(3.0), sum(middle._cache_hits.values()))
"""


def test_what_kernels_call_comes_from_the_cache_unless_it_calls_something_else_now(tmp_path):
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), str(tmp_path)]),
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }

    def run(entry):
        (tmp_path / f"{entry}.py").write_text(ENTRY.format(entry))
        done = subprocess.run(
            [sys.executable, "-m", entry], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    (tmp_path / "leaf.py").write_text(LEAF.format("x + 1"))
    (tmp_path / "middle.py").write_text(MIDDLE)
    assert run("first") == ["11.0", "0"]
    assert run("second") == ["11.0", "1"]
    (tmp_path / "leaf.py").write_text(LEAF.format("7"))  # an integer now
    assert run("third") == ["17.0", "0"]
    assert run("fourth") == ["17.0", "1"]


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
    for k in (0, 1):
        assert _ends(a, m, c, k) == (a[-1], a[k], m[-2, 1], m[k, -1], c[1, -1, 0], c[k, k, k])


def test_variables_count_from_either_end_in_what_is_no_kernel():
    ends, write = njit(_ends.py_func), njit(_write.py_func)
    a, m, c = np.arange(5.0), np.arange(12.0).reshape(3, 4), np.arange(24.0).reshape(2, 3, 4)
    assert ends(a, m, c, -1) == (a[-1], a[-1], m[-2, 1], m[-1, -1], c[1, -1, 0], c[-1, -1, -1])
    flags, counts = np.zeros((1, 3), dtype=bool), np.zeros(3, dtype=np.int64)
    write(a, m, flags, counts, -2)
    assert a[-2] == 7 and flags.tolist() == [[False, True, False]] and counts.tolist() == [0, -2, 0]


def test_elements_of_every_kind_are_written():
    a, m, flags, counts = np.zeros(3), np.zeros((2, 3)), np.zeros((1, 3), dtype=bool), np.zeros(3, dtype=np.int64)
    _write(a, m, flags, counts, 1)
    assert a.tolist() == [0, 7, 0] and m.tolist() == [[0, 0, 0], [0, 0.5, 0]]
    assert flags.tolist() == [[False, True, False]] and counts.tolist() == [0, -2, 0]


def test_strided_arrays_and_slices_mean_the_same():
    m = np.arange(12.0).reshape(3, 4)
    assert _row(m, 1) == m[1].sum() + m[:, 1].sum()
    strided = np.arange(24.0).reshape(3, 8)[:, ::2]
    assert _ends(np.arange(10.0)[::2], strided, np.arange(24.0).reshape(4, 3, 2).T, 1)[2] == strided[-2, 1]


def _found_by_numba(operation, arguments):
    """Signature that numba finds without what this package registers."""
    context = cpu_target.typing_context
    context.refresh()
    templates = context.resolve_value_type(operation).templates
    own = [of for of in templates if getattr(of, "metadata", None) is TARGET]
    assert len(own) == 1
    return types.Function([of for of in templates if of not in own]).get_call_type(context, arguments, {})


@pytest.mark.parametrize("operation", RESULTS)
def test_operations_have_the_types_that_numba_finds(operation):
    for arguments, result in RESULTS[operation].items():
        assert _found_by_numba(operation, arguments) == signature(result, *arguments)


@pytest.mark.parametrize("index", [types.int64, types.UniTuple(types.int64, 2), types.UniTuple(types.int64, 3)])
@pytest.mark.parametrize("number", [types.float64, types.int64, types.boolean])
def test_elements_have_the_types_that_numba_finds(number, index):
    array = types.Array(number, len(index) if isinstance(index, types.UniTuple) else 1, "C")
    assert _found_by_numba(operator.getitem, (array, index)).return_type == number
    for value in (number, types.int64):
        found = _found_by_numba(operator.setitem, (array, index, value))
        assert (
            cpu_target.typing_context.resolve_value_type(operator.setitem).get_call_type(
                cpu_target.typing_context, (array, index, value), {}
            )
            == found
        )


def test_read_only_arrays_are_not_written():
    @kernel
    def write(a):
        a[0] = 1.0

    values = np.zeros(2)
    values.flags.writeable = False
    with pytest.raises(TypingError, match="readonly"):
        write(values)


def test_flags_that_are_looked_up_are_one_object_for_equal_values_and_do_not_change():
    flags = KernelFlags(Flags())
    flags.nrt = False
    first, again = flags.copy(), KernelFlags(flags).copy()
    flags.nrt = True
    assert first is again and first is not flags.copy() and not first.nrt
    with pytest.raises(TypeError):
        first.nrt = True
