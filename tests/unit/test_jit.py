"""Records that kernels read, pieces that call each other, and arrays on the stack of a kernel."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba import errors

from bilayer_core.jit import caller, kernel, piece, record, record_at
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.jit.kernel import exact_kernel
from bilayer_core.jit.piece import Piece, loading
from bilayer_core.jit.record import CHANGES, Flags, IndexTable, Indices, Vector


@record
class Inner:
    values: Vector
    scale: float


@record
class Outer:
    flag: bool
    count: int
    nothing: Inner
    table: IndexTable
    marks: Flags
    inner: Inner
    others: Indices  # addresses of records
    last: float


inner_at = record_at(Inner)


def _outer():
    inner = Inner(values=np.arange(3.0), scale=2.0)
    other = Inner(values=np.array([7.0, 8.0]), scale=-0.5)
    outer = Outer(
        flag=True,
        count=5,
        nothing=Inner.absent(),
        table=np.arange(12, dtype=np.int64).reshape(3, 4),
        marks=np.array([False, True]),
        inner=inner,
        others=np.array([inner.address, other.address]),
        last=0.25,
    )
    return outer, other


@piece(float, Outer, int, Vector)
def read_for_a_test(o, which, out):
    chosen = inner_at(o.others[which])
    out[0], out[1], out[2], out[3] = o.flag, o.count, o.table[2, 1], o.table.shape[1]
    out[4], out[5], out[6], out[7] = o.marks[1], o.inner.scale, chosen.values[-1], o.nothing.exists
    return o.last


@record
class Reading:
    outer: Outer
    out: Vector


@piece(float, Reading, int)
def read_for_another_piece(r, which):
    return read_for_a_test(r.outer, which=which, out=r.out)


@record
class Tally:
    step: float
    rounds: int = CHANGES
    length: float = CHANGES
    full: bool = CHANGES


@piece(int, Tally, int)
def add_rounds(tally, most):
    for _ in range(most):
        tally.rounds += 1
        tally.length += tally.step
    tally.full = tally.rounds > 3
    return tally.rounds


@piece(int, Tally)
def change_what_lasts(tally):
    tally.step = 2.0
    return 0


def test_kernels_and_the_interpreter_change_the_same_numbers_of_a_record():
    tally = Tally(step=0.25)
    assert (tally.rounds, tally.length, tally.full) == (0, 0.0, False)
    assert add_rounds(tally, 3) == 3 and tally.length == 0.75 and not tally.full
    tally.rounds, tally.length = 10, -0.5
    assert add_rounds(tally, 1) == 11 and tally.length == -0.25 and tally.full
    assert repr(tally) == "Tally(step=0.25, rounds=11, length=-0.25, full=True)"


def test_a_kernel_may_not_change_a_number_whose_declaration_does_not_say_so():
    with pytest.raises(errors.LoweringError, match="step does not change"):
        change_what_lasts(Tally(step=0.25))


@piece(float, Outer)
def change_for_a_test(o):
    o.inner.values[1] = 42.0
    return 0.0


def _read(which):
    outer, other = _outer()
    reading = Reading(outer=outer, out=np.zeros(8))
    assert read_for_another_piece(reading, which) == 0.25
    return reading.out.tolist(), other


def test_a_piece_reads_every_kind_of_field_through_another_piece():
    assert _read(0)[0] == [1, 5, 9, 4, 1, 2, 2, 0]
    assert _read(1)[0] == [1, 5, 9, 4, 1, 2, 8, 0]


def _environment():
    """For a program that imports this module."""
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), str(Path(__file__).parent)])}


def test_what_a_piece_writes_is_seen_by_all_who_hold_the_array():
    outer, _ = _outer()
    change_for_a_test(outer)
    assert outer.inner.values[1] == 42.0


def test_a_record_keeps_its_arrays_alive():
    outer, _ = _outer()
    garbage = [np.full(12, -1) for _ in range(100)]
    change_for_a_test(outer)
    assert all(array[0] == -1 for array in garbage)


def test_an_absent_record_has_arrays_of_length_zero():
    nothing = Inner.absent()
    assert nothing.values.shape == (0,) and not nothing.exists and _outer()[0].inner.exists


@record
class Allocated:
    first: Vector = ("many",)
    given: Vector
    marks: Flags = ("many",)
    none: IndexTable = ("none", 2)
    last: Indices = (2,)


@piece(float, Allocated)
def fill_for_a_test(a):
    for k in range(a.first.shape[0]):
        a.first[k] = 1.0 + k
    for k in range(a.marks.shape[0]):
        a.marks[k] = True
    a.last[0], a.last[1] = a.none.shape[0], a.none.shape[1]
    a.given[0] = 7.0
    return 0.0


@pytest.mark.parametrize("many", [0, 1, 5, 100])
def test_arrays_that_a_record_makes_are_zeros_that_do_not_overlap(many):
    made = [Allocated.zeros({"many": many, "none": 0}, given=np.zeros(1)) for _ in range(2)]
    assert not any(getattr(made[0], name).any() for name in Allocated.names)
    fill_for_a_test(made[0])
    assert made[0].first.tolist() == [1.0 + k for k in range(many)] and made[0].marks.tolist() == [True] * many
    assert made[0].last.tolist() == [0, 2] and made[0].given.tolist() == [7.0] and made[0].none.shape == (0, 2)
    assert not any(getattr(made[1], name).any() for name in Allocated.names)


def test_sizes_that_change_back_and_forth_make_arrays_of_the_present_ones():
    for many in (3, 4, 3):
        found = Allocated.zeros({"many": many, "none": many - 3}, given=np.zeros(1))
        assert found.first.shape == (many,) and found.none.shape == (many - 3, 2)


def test_a_record_takes_the_fields_of_its_class_with_their_types_and_nothing_else():
    with pytest.raises(TypeError, match="Inner: these fields are missing or unknown: other, scale"):
        Inner(values=np.zeros(1), other=1)
    with pytest.raises(TypeError, match="Inner.values: int64, shape"):
        Inner(values=np.zeros(1, dtype=np.int64), scale=1.0)
    with pytest.raises(TypeError, match="Inner.values: float64, shape .* is not a contiguous array of 1 indices"):
        Inner(values=np.zeros((4, 2))[:, 0], scale=1.0)
    with pytest.raises(TypeError, match="Reading.outer: a Inner is no Outer"):
        Reading(outer=Inner.absent(), out=np.zeros(1))


def test_a_call_with_other_types_than_declared_is_an_error_of_compilation():
    @piece(float, Inner)
    def call_with_the_wrong_record(inner):
        return change_for_a_test(inner)

    with pytest.raises(numba.errors.TypingError, match="change_for_a_test: is called with .*Inner.*; it takes .*Outer"):
        _ = call_with_the_wrong_record.address


@piece(int, int)
def double_for_a_test(n):
    return 2 * n


@piece(int, int)
def double_odd_numbers(n):
    return double_for_a_test(n) if n % 2 else n


def test_a_piece_is_compiled_when_something_first_calls_it():
    assert double_odd_numbers(4) == 4 and double_for_a_test.seconds == 0.0 == double_for_a_test.slot.value
    before = loading.cpu
    assert double_odd_numbers(5) == 10 and loading.cpu - before >= double_for_a_test.seconds > 0.0
    assert double_for_a_test.slot.value == double_for_a_test.address


BROKEN = """
@piece(bool, int)
def broken(n):
    return n.nothing

@piece(int, int)
def count_until_broken(n):
    while not broken(n):
        n += not ENDLESS
        if n > 3:
            return n
    return -1
"""


def test_where_a_piece_cannot_be_compiled_who_called_it_ends_and_the_error_is_raised(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(f"from bilayer_core.jit import piece\nENDLESS = False\n{BROKEN}\ncount_until_broken(0)")
    run = subprocess.run([sys.executable, script], env=_environment(), capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "numba.core.errors.TypingError" in run.stderr and "n.nothing" in run.stderr
    script.write_text(script.read_text().replace("= False", "= True"))  # compiled code that would never end
    run = subprocess.run([sys.executable, script], env=_environment(), capture_output=True, text=True, check=False)
    assert run.returncode == 70 and "numba.core.errors.TypingError" in run.stderr and "n.nothing" in run.stderr


@piece(int, int)
def triple_for_a_test(n):
    return 3 * n


@piece(int, int)
def add_the_triple(n):
    return n + triple_for_a_test(n)


def test_an_interruption_while_a_piece_is_compiled_is_raised_when_compiled_code_is_done(monkeypatch):
    compiled, tries = Piece.address.fget, []

    def interrupted(of):
        if of is triple_for_a_test and not tries:
            tries.append(of)
            raise KeyboardInterrupt
        return compiled(of)

    monkeypatch.setattr(Piece, "address", property(interrupted))
    with pytest.raises(KeyboardInterrupt):
        add_the_triple(1)
    assert tries == [triple_for_a_test] and triple_for_a_test.slot.value != 0
    assert add_the_triple(1) == 4


call_reading = caller("call_reading", float, Reading, int)


@record
class Table:
    addresses: Indices
    reading: Reading


@piece(float, Table)
def sum_of_a_table(t):
    total = 0.0
    for k in range(t.addresses.shape[0]):
        total += call_reading(t.addresses[k], (t.reading, k))
    return total


def test_pieces_in_a_table_are_called_by_their_common_signature():
    outer, _ = _outer()
    reading = Reading(outer=outer, out=np.zeros(8))
    table = Table(addresses=np.full(2, read_for_another_piece.address), reading=reading)
    assert sum_of_a_table(table) == 0.5


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


@exact_kernel
def _rounding_error(a, b):
    total = a + b
    return (a - (total - (total - a))) + (b - (total - a))


def test_exact_kernels_keep_rounding_errors():
    assert _rounding_error(1.0, 1e-17) == 1e-17


def test_importing_and_compiling_leaves_numba_as_it_was():
    before = numba.config.CACHE_DIR
    _ = change_for_a_test.address
    assert before == numba.config.CACHE_DIR


def test_the_documented_ways_of_numba_alone_give_the_same():
    program = "import test_jit as t; print(t._read(1)[0])"
    environment = _environment() | {"BILAYER_JIT_PUBLIC": "1"}
    run = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == str(_read(1)[0])


BEYOND = """
import numpy as np, sys
from test_jit import Inner, beyond_the_end
sys.unraisablehook = lambda error: print(type(error.exc_value).__name__)
beyond_the_end(Inner(values=np.zeros(3), scale=1.0), 3)
"""


@piece(float, Inner, int)
def beyond_the_end(inner, index):
    return inner.values[index]


def test_with_bounds_checked_an_index_beyond_the_end_is_an_error():
    environment = _environment() | {"NUMBA_BOUNDSCHECK": "1"}
    run = subprocess.run([sys.executable, "-c", BEYOND], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "IndexError"
