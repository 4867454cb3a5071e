"""The digest of a piece: everything its machine code depends on, and nothing else.

That is the bytecode of its function and of the kernels that become part of it, their constants and globals, the fields
of the records that they read, and numba's options; for all pieces alike the sources that generate code, versions,
settings of numba and the target. Other pieces that it calls count with their names and types, so an edit changes the
digests of the pieces that it changes. Comments, docstrings and the place in a file count for nothing.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
import os
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import is_jitted

from bilayer_core.jit.record import Record, RecordType
from bilayer_core.jit.target import target

CACHE_DIR = "NUMBA_CACHE_DIR"
OWN = "bilayer_core.jit"
"""Package whose functions generate code: its sources count as a whole."""
GENERATORS = ("digest", "flat", "kernel", "machine_code", "piece", "record", "stack", "target", "undocumented")
"""Its modules that do."""
VERSIONED = frozenset({"numba", "llvmlite", "numpy", *sys.stdlib_module_names})
"""Packages whose functions count with their names: the versions of these packages are in every digest."""
_LOAD_GLOBAL, _EXTENDED_ARG = dis.opmap["LOAD_GLOBAL"], dis.opmap["EXTENDED_ARG"]


class CalledByName:
    """Base of pieces: kernels that call one depend on its name and types alone."""

    name: str
    signature: Any
    function: FunctionType


@cache
def settings() -> bytes:
    """Return what all digests have in common."""
    chosen = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_") and item[0] != CACHE_DIR)
    public = os.environ.get("BILAYER_JIT_PUBLIC", "0")
    versions = sys.version, numba.__version__, llvmlite.__version__, np.__version__
    sources = [Path(__file__).with_name(f"{name}.py").read_bytes() for name in GENERATORS]
    return hashlib.blake2b(repr((versions, target(), chosen, public, sources)).encode()).digest()


def digest_of(piece: CalledByName) -> tuple[str, frozenset[CalledByName]]:
    """Return the digest of a piece, and the pieces that it calls.

    Raises
    ------
    TypeError
        If it uses a global of a kind that a digest does not know.
    """
    reader = _Reader()
    reader.read((piece.name, *piece.signature.args, piece.signature.return_type, piece.function), piece.name)
    return reader.hash.hexdigest(), frozenset(reader.called)


class _Reader:
    """Walks through everything that a piece is made of, in the order in which it meets it."""

    def __init__(self) -> None:
        self.hash = hashlib.blake2b(settings(), digest_size=12)
        self.called: list[CalledByName] = []
        self._met: dict[int, int] = {}

    def _write(self, text: str | bytes) -> None:
        coded = text.encode() if isinstance(text, str) else text
        self.hash.update(b"%d:" % len(coded) + coded)

    def read(self, value: Any, user: str) -> None:
        """Add a value to the digest; `user` uses it."""
        if value is None or isinstance(value, (bool, int, float, complex, str, bytes, np.generic)):
            self._write(f"{type(value).__qualname__} {value!r}")
        elif isinstance(value, (tuple, list)):
            self._write(f"{type(value).__qualname__} {len(value)}")
            for item in value:
                self.read(item, user)
        elif isinstance(value, (frozenset, set)):
            self._write(f"set {sorted(map(repr, value))}")
        elif isinstance(value, np.ndarray):
            self._write(f"array {value.dtype} {value.shape}")
            self._write(value.tobytes())
        elif isinstance(value, (ModuleType, BuiltinFunctionType, np.ufunc, np.dtype, types.Type, ir.Type)):
            self._read_by_name(value, user)
        elif id(value) in self._met:
            self._write(f"met {self._met[id(value)]}")
        else:
            self._met[id(value)] = len(self._met)
            self._read_once(value, user)

    def _read_by_name(self, value: Any, user: str) -> None:
        if isinstance(value, RecordType):
            self._write(_record_text(value.declared))
        else:
            self._write(f"{type(value).__qualname__} {getattr(value, '__name__', value)}")

    def _read_once(self, value: Any, user: str) -> None:
        if isinstance(value, CalledByName):
            self._write(f"piece {value.name} {value.signature}")
            self.called.append(value)
        elif isinstance(value, type) and issubclass(value, Record):
            self._write(_record_text(value))
        elif is_jitted(value):
            self._write(f"kernel {sorted((name, str(option)) for name, option in _options(value))}")
            self.read(value.py_func, user)
        elif isinstance(value, FunctionType):
            self._read_function(value)
        elif hasattr(value, "__wrapped__"):  # an intrinsic
            self.read(value.__wrapped__, user)
        elif getattr(value, "__module__", "").split(".")[0] in VERSIONED and hasattr(value, "__qualname__"):
            self._write(f"{value.__module__}.{value.__qualname__}")
        elif callable(value) and type(value).__module__.split(".")[0] in VERSIONED:
            self._write(repr(type(value)))
        else:
            raise TypeError(
                f"{user}: uses a global that is a {type(value).__qualname__}, and the digest of its machine code knows "
                "numbers, text, tuples, arrays, records, kernels, pieces and functions"
            )

    def _read_function(self, function: FunctionType) -> None:
        name = f"{function.__module__}.{function.__qualname__}"
        self._write(f"function {name}")
        if function.__module__.split(".")[0] in VERSIONED:
            return
        for cell, variable in zip(function.__closure__ or (), function.__code__.co_freevars, strict=True):
            self._write(variable)
            self.read(cell.cell_contents, name)
        if function.__module__.rpartition(".")[0] == OWN:
            return
        self.read((function.__defaults__, tuple((function.__kwdefaults__ or {}).items())), name)
        text, used = _code_of(function.__code__, function.__doc__)
        self._write(text)
        for variable in used:
            if variable in function.__globals__:
                self._write(variable)
                self._read_global(function, variable, name)
            elif not hasattr(builtins, variable):
                raise TypeError(f"{name}: uses the name {variable}, which is not defined")

    def _read_global(self, function: FunctionType, variable: str, name: str) -> None:
        value = function.__globals__[variable]
        self.read(value, name)
        if isinstance(value, ModuleType) and value.__name__.split(".")[0] not in VERSIONED:
            for attribute in function.__code__.co_names:
                if hasattr(value, attribute):
                    self.read((attribute, getattr(value, attribute)), name)


@cache
def _record_text(declared: type[Record]) -> bytes:
    """Return a hash of the fields of a record, and of those of records among them."""
    digest = hashlib.blake2b(f"record {declared.__module__}.{declared.__qualname__}".encode(), digest_size=16)
    for name, kind in declared.numba_type().fields.items():
        of = _record_text(kind.declared) if isinstance(kind, RecordType) else str(kind).encode()
        digest.update(b"%s: %s; " % (name.encode(), of))
    return digest.digest()


def _options(kernel: Any) -> Iterator[tuple[str, Any]]:
    """Options of numba, with those that are sets in an order."""
    options: Mapping[str, Any] = kernel.targetoptions
    for name, option in options.items():
        yield name, sorted(option) if isinstance(option, (set, frozenset)) else option


@cache
def _code_of(code: CodeType, documentation: str | None) -> tuple[bytes, tuple[str, ...]]:
    """Return the text of bytecode without its place in a file, and the globals that it loads."""
    parts: list[Any] = [code.co_code, code.co_exceptiontable, code.co_names, code.co_varnames, code.co_cellvars]
    parts += [code.co_freevars, code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags]
    used = list(_globals_in(code))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            text, inner = _code_of(constant, None)
            parts.append(text)
            used += inner
        elif documentation is None or constant != documentation:
            parts.append(sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant)
    return repr(parts).encode(), tuple(dict.fromkeys(used))


def _globals_in(code: CodeType) -> Iterator[str]:
    """Yield the names of globals; `co_names` has those of attributes as well."""
    extended = 0
    for operation, argument in zip(code.co_code[::2], code.co_code[1::2], strict=True):
        argument |= extended << 8
        extended = argument if operation == _EXTENDED_ARG else 0
        if operation == _LOAD_GLOBAL:
            yield code.co_names[argument >> 1]
