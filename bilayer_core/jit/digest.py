"""The digest of a piece: everything its machine code depends on, and nothing else.

That is the bytecode of its function and of the kernels that become part of it, their constants and globals, the fields
of the records that they read, and numba's options; for all pieces alike the sources that generate code, versions,
settings of numba and the target. Other pieces that it calls count with their names and types, so an edit changes the
digests of the pieces that it changes. Comments, docstrings and the place in a file count for nothing.
"""

from __future__ import annotations

import builtins
import ctypes
import dis
import hashlib
import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, ClassVar

import numpy as np

from bilayer_core.jit.called import Called
from bilayer_core.jit.kernel import PUBLIC, Kernel
from bilayer_core.jit.record import ArrayOf, Record, name_of
from bilayer_core.jit.target import compilers, target

CACHE_DIR = "NUMBA_CACHE_DIR"
OWN = "bilayer_core.jit"
"""Package whose functions generate code: its sources count as a whole."""
GENERATORS = ("called.py", "digest.py", "kernel.py", "record.py", "target.py", "compiler/*.py")
"""Its files that do."""
VERSIONED = frozenset({"numba", "llvmlite", "numpy", *sys.stdlib_module_names})
"""Packages whose functions count with their names: the versions of these packages are in every digest."""
_LOAD_GLOBAL, _EXTENDED_ARG = dis.opmap["LOAD_GLOBAL"], dis.opmap["EXTENDED_ARG"]


class CalledByName(Called):
    """Base of pieces: kernels that call one depend on its name and types alone.

    Attributes
    ----------
    function : callable
    slot : ctypes.c_int64
        Its address, as kernels find it; 0 as long as none has called it, unless it is in the library.
    finder : int
        Address of the function that kernels ask where a slot is 0.
    """

    finder: ClassVar[int]
    function: FunctionType
    slot: ctypes.c_int64


@cache
def settings() -> bytes:
    """Return what all digests have in common."""
    chosen = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_") and item[0] != CACHE_DIR)
    versions = sys.version, compilers(), np.__version__
    sources = [path.read_bytes() for pattern in GENERATORS for path in sorted(Path(__file__).parent.glob(pattern))]
    return hashlib.blake2b(repr((versions, target(), chosen, PUBLIC, sources)).encode()).digest()


def digest_of(piece: CalledByName) -> tuple[str, frozenset[CalledByName]]:
    """Return the digest of a piece, and the pieces that it calls.

    Raises
    ------
    TypeError
        If it uses a global of a kind that a digest does not know.
    """
    reader = _Reader()
    reader.read((piece.name, piece.about, piece.function), piece.name)
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
        elif isinstance(value, (ModuleType, BuiltinFunctionType, np.ufunc, np.dtype)):
            self._write(f"{type(value).__qualname__} {getattr(value, '__name__', value)}")
        elif id(value) in self._met:
            self._write(f"met {self._met[id(value)]}")
        else:
            self._met[id(value)] = len(self._met)
            self._read_once(value, user)

    def _read_once(self, value: Any, user: str) -> None:
        if isinstance(value, CalledByName):
            self._write(f"piece {value.name} {', '.join(map(name_of, value.about))}")
            self.called.append(value)
        elif isinstance(value, Called):
            self._write(f"called {value.name}")
            self.read(value.about, user)
        elif isinstance(value, type) and issubclass(value, Record):
            self._write(_record_text(value))
        elif isinstance(value, ArrayOf):
            self._write(name_of(value))
        elif isinstance(value, Kernel):
            self._write(f"kernel {sorted(_options(value))}")
            self.read(value.py_func, user)
        elif isinstance(value, FunctionType):
            self._read_function(value)
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
    for name, kind in declared.layout().fields.items():
        of = _record_text(kind) if isinstance(kind, type) and issubclass(kind, Record) else name_of(kind).encode()
        digest.update(b"%s: %s%s; " % (name.encode(), of, b" changes" * (name in declared.changing)))
    return digest.digest()


def _options(kernel: Kernel) -> Iterator[tuple[str, str]]:
    """Yield the options of numba, with those that are sets in an order."""
    for name, option in kernel.options.items():
        yield name, str(sorted(option) if isinstance(option, set) else option)


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
