"""The digest of a piece: another one exactly where its machine code may be another."""

import math
import os
import subprocess
import sys
import textwrap
from itertools import count

import pytest

from bilayer_core.jit import caller, digest, kernel, piece, record, record_at, target
from bilayer_core.jit.digest import digest_of
from bilayer_core.jit.kernel import exact_kernel
from bilayer_core.jit.piece import PIECES
from bilayer_core.jit.record import Vector

SOURCE = """
FACTOR = 2.0
TABLE = (1, 2.5, "text")


@record
class Inner:
    values: Vector


@record
class Field:
    scale: float
    inner: Inner


inner_at = record_at(Inner)
call_other = caller("other", float, float)


@kernel
def scaled(x):
    "Scale it."
    return FACTOR * x


@kernel
def added(field, x):
    return scaled(x) + field.inner.values[0] + math.sin(x) + TABLE[0]


@piece(float, float)
def other(x):
    return x + 1.0


@piece(float, Field, float)
def whole(field, x):
    return added(field, x) + other(x)
"""
KNOWN = {"caller": caller, "exact_kernel": exact_kernel, "kernel": kernel, "math": math, "piece": piece}
KNOWN |= {"record": record, "record_at": record_at, "Vector": Vector}
_numbers = count()


@pytest.fixture
def digested(monkeypatch):
    """The digest of the piece `whole` of a module with this source, and the names of the pieces that it calls."""

    def of(source):
        monkeypatch.setattr(sys.modules["bilayer_core.jit.piece"], "PIECES", {})
        scope = KNOWN | {"__name__": "a_module"}
        exec(compile(textwrap.dedent(source), f"<{next(_numbers)}>", "exec"), scope)
        found, called = digest_of(scope["whole"])
        return found, {piece.name for piece in called}

    return of


def test_the_same_source_has_the_same_digest_wherever_it_stands(digested):
    first, called = digested(SOURCE)
    assert called == {"other"}
    assert digested(SOURCE)[0] == first
    assert digested("\n\n# a comment\n" + SOURCE)[0] == first
    assert digested(SOURCE.replace("Scale it.", "Return it as it is."))[0] == first


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("FACTOR = 2.0", "FACTOR = 3.0"),
        ("FACTOR = 2.0", "FACTOR = 2"),
        ("(1, 2.5", "(2, 2.5"),
        ("FACTOR * x", "FACTOR + x"),
        ("@kernel\ndef scaled", "@exact_kernel\ndef scaled"),
        ("    scale: float", "    scale: int"),
        ("    scale: float", "    scale: float\n    more: float"),
        ("    values: Vector", "    more: float\n    values: Vector"),
        ("math.sin", "math.cos"),
        ("whole(field, x):", "whole(field, x):\n    x += 1.0"),
        ("+ other(x)", "+ other(x) + inner_at(0).values[0]"),
        ("@piece(float, float)\ndef other", "@piece(int, float)\ndef other"),
    ],
)
def test_a_change_of_anything_that_becomes_part_of_a_piece_changes_its_digest(digested, old, new):
    assert SOURCE.count(old) == 1
    assert digested(SOURCE.replace(old, new))[0] != digested(SOURCE)[0]


def test_a_change_of_another_piece_that_it_calls_leaves_the_digest_as_it_is(digested):
    assert digested(SOURCE.replace("x + 1.0", "x + 5.0"))[0] == digested(SOURCE)[0]


def test_records_behind_addresses_and_signatures_behind_tables_count(digested):
    through = SOURCE.replace("+ other(x)", "+ inner_at(0).values[0] + call_other(0, (x,))")
    one = digested(through)[0]
    assert digested(through.replace("    values: Vector", "    more: float\n    values: Vector"))[0] != one
    assert digested(through.replace("record_at(Inner)", "record_at(Field)"))[0] != one
    assert digested(through.replace('"other", float, float', '"other", float, Field, float'))[0] != one


def test_names_of_attributes_are_not_taken_for_globals(digested):
    assert len(digested(SOURCE.replace("FACTOR * x", "FACTOR * x.scaled.added"))[0]) == 24  # and it ends


def test_a_kernel_that_calls_itself_has_a_digest(digested):
    itself = SOURCE.replace("return FACTOR * x", "return FACTOR * x if x < 1.0 else scaled(x - 1.0)")
    assert digested(itself)[0] != digested(SOURCE)[0]


def test_a_global_of_an_unknown_kind_is_an_error_that_names_its_user(digested):
    with pytest.raises(TypeError, match=r"a_module\.scaled: uses a global that is a object"):
        digested(SOURCE.replace("FACTOR = 2.0", "FACTOR = object()"))
    with pytest.raises(TypeError, match=r"a_module\.scaled: uses the name MISSING, which is not defined"):
        digested(SOURCE.replace("FACTOR * x", "MISSING * x"))


def test_every_piece_of_the_engine_has_a_digest_of_its_own():
    import bilayer_core.engine  # noqa: F401 (declares pieces)

    own = {name: of for name, of in PIECES.items() if of.function.__module__.startswith("bilayer_core")}
    assert len({of.file for of in own.values()}) == len(own) > 100


def test_code_is_for_the_baseline_unless_native_code_or_another_processor_is_wanted(monkeypatch):
    monkeypatch.delenv("NUMBA_CPU_NAME", raising=False)
    monkeypatch.delenv("NUMBA_CPU_FEATURES", raising=False)
    native = target.binding.get_host_cpu_name(), target.binding.get_host_cpu_features().flatten()
    monkeypatch.delenv(target.SWITCH, raising=False)
    assert target.target.__wrapped__() == ((target.BASELINE, "") if target.reaches_baseline() else native)
    monkeypatch.setenv(target.SWITCH, target.NATIVE)
    assert target.target.__wrapped__() == native
    monkeypatch.delenv(target.SWITCH)
    monkeypatch.setattr(target, "reaches_baseline", lambda: False)
    assert target.target.__wrapped__() == native
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert target.target.__wrapped__() == ("generic", "")
    assert len(digest.settings()) == 64


COMPILED = """
import hashlib
import bilayer_core.engine
from bilayer_core.jit.compiler.machine_code import compile_piece
from bilayer_core.jit.piece import PIECES

print(hashlib.sha256(compile_piece(PIECES["corner_after"])).hexdigest())
"""


@pytest.mark.skipif(not target.reaches_baseline(), reason="the processor is below the baseline")
def test_numba_optimises_for_the_baseline_and_not_for_the_processor():
    wanted = {"NUMBA_CPU_NAME": target.BASELINE, "NUMBA_CPU_FEATURES": ""}
    plain = {name: text for name, text in os.environ.items() if name not in wanted} | {"PYTHONHASHSEED": "0"}
    codes = {
        subprocess.run([sys.executable, "-c", COMPILED], env=of, capture_output=True, text=True, check=True).stdout
        for of in (plain, plain | wanted)
    }
    assert len(codes) == 1
