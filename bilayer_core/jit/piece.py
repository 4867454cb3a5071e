"""Pieces of the engine: each compiled by itself, once, for declared types, and called by name.

Numba compiles a function with all that it calls, and what this calls, and optimises every level again; each new
combination of types is another function. A piece ends that: it is compiled once for all scenes, by any process.

    @piece(float, Problem, Configuration)
    def smallest_gap(problem, at): ...

The interpreter calls it with records and numbers, without the GIL, and kernels by the same line:
``gap = smallest_gap(problem, at)``. In compiled code that line goes through the piece's *slot*, a word of memory that
holds its address, or 0 until something calls it: the first call has the piece compiled, or read from the cache. So what
a scene does not reach is neither compiled nor loaded.

A call with other types than those declared is an error of compilation. What is chosen at run time, as forces are,
stands in a table of addresses, and `caller` makes the function that calls it.
"""

from __future__ import annotations

import ctypes
import os
import threading
import time
import traceback
from collections.abc import Callable
from functools import cached_property
from importlib import import_module
from typing import Any

from bilayer_core.jit import cache, library
from bilayer_core.jit.called import FIND, slot_of
from bilayer_core.jit.digest import CalledByName, digest_of
from bilayer_core.jit.kernel import COMPILER
from bilayer_core.jit.load_piece import load
from bilayer_core.jit.record import Record

IN_C = {int: ctypes.c_int64, float: ctypes.c_double, bool: ctypes.c_bool}
MOST_CALLS = 1000
"""Of a piece that cannot be compiled; who goes on calling it would never end."""
_lock = threading.RLock()


class Piece(CalledByName):
    """A function that is compiled by itself.

    Attributes
    ----------
    name : str
    function : callable
        As it is written.
    slot : ctypes.c_int64
        Its address, as kernels find it; 0 as long as none has called it, unless it is in the library.
    seconds : float
        CPU time that its compilation, or its reading from the cache, took [s]; 0 before.
    """

    def __init__(self, function: Callable, result: type, arguments: tuple):
        super().__init__(function.__name__, result, *arguments)
        self.function, self._result, self._arguments = function, result, arguments
        self._address, self._callable = 0, None
        self.slot, self.seconds = library.slot_of_piece(self) or ctypes.c_int64(0), 0.0
        _by_slot[ctypes.addressof(self.slot)] = self

    @property
    def address(self) -> int:
        """Where it is in memory; compiled, or read from the cache, when first asked for."""
        if not self._address:
            begin, wall = time.thread_time(), time.perf_counter()
            with _lock:
                self._address = self._address or self._load()
            self.seconds = time.thread_time() - begin
            loading.cpu, loading.wall = loading.cpu + self.seconds, loading.wall + time.perf_counter() - wall
        return self._address

    @property
    def file(self) -> str:
        """Name of its object file in the cache."""
        return f"{self.name}-{self._digest[0]}.o"

    @property
    def calls(self) -> frozenset[CalledByName]:
        """Pieces that it calls by name."""
        return self._digest[1]

    @cached_property
    def _digest(self) -> tuple[str, frozenset[CalledByName]]:
        return digest_of(self)

    def make_object(self) -> bytes:
        """Return its object file, from the cache or else compiled and kept there."""
        if (code := cache.kept(self.file)) is None:
            code = import_module(COMPILER).compile_piece(self)
            cache.keep(self.file, code)
        return code

    def _load(self) -> int:
        if self.slot.value:  # it is in the library
            return self.slot.value
        symbols = {FIND: self.finder}
        symbols |= {slot_of(of.name): ctypes.addressof(of.slot) for of in self.calls}
        try:
            return load(self.name, self.make_object(), symbols)
        except RuntimeError:  # the file is damaged
            cache.forget(self.file)
            return load(self.name, self.make_object(), symbols)

    def __call__(self, *arguments: Any):
        """Run it; records go by their addresses."""
        if self._callable is None:
            kinds = [IN_C.get(kind, ctypes.c_void_p) for kind in self._arguments]
            self._callable = ctypes.CFUNCTYPE(IN_C[self._result], *kinds)(self.address)
        result = self._callable(*[of.address if isinstance(of, Record) else of for of in arguments])
        if loading.errors:
            loading.raise_error()
        return result


class Loading(threading.local):
    """Time and errors of loading pieces in this thread.

    Attributes
    ----------
    cpu, wall : float
        Time for pieces so far [s].
    errors : list of BaseException
        What could not be raised where compiled code waited for a piece.
    """

    def __init__(self) -> None:
        self.cpu = self.wall = 0.0
        self.errors: list[BaseException] = []
        self._failed: dict[int, int] = {}

    def find(self, slot: int) -> int:
        """Return the address of the piece with a slot, and put it there; 0 if there is none.

        It is compiled code that asks, and it goes on whatever happens: with a piece that cannot be had, as if that had
        returned 0. The interpreter, which called it, raises the error when it returns.
        """
        piece = _by_slot[slot]
        while slot not in self._failed:
            try:
                piece.slot.value = piece.address
                return piece.slot.value
            except KeyboardInterrupt as interruption:
                self.errors.append(interruption)  # and what compiled code is at is done, so that its state is whole
            except BaseException as error:
                self.errors.append(error)
                self._failed[slot] = 0
        self._failed[slot] += 1
        if self._failed[slot] > MOST_CALLS:
            traceback.print_exception(self.errors[-1])
            os._exit(70)
        return 0

    def raise_error(self) -> None:
        """Raise the first error; a next call of what has failed tries it again."""
        first = self.errors[0]
        self.errors, self._failed = [], {}
        raise first


PIECES: dict[str, Piece] = {}
"""All that were declared, by name."""
loading = Loading()
_by_slot: dict[int, Piece] = {}
_find = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(loading.find)
CalledByName.finder = ctypes.cast(_find, ctypes.c_void_p).value or 0


def piece(result: type, *arguments) -> Callable[[Callable], Piece]:
    """Declare a function as a piece.

    Parameters
    ----------
    result : type
        int, float or bool.
    *arguments
        int, float, bool, a class of records, or an array type of `jit.record` (then only pieces can call it).
    """

    def declare(function: Callable) -> Piece:
        if function.__name__ in PIECES:
            raise ValueError(f"piece {function.__name__}: is declared twice")
        PIECES[function.__name__] = Piece(function, result, arguments)
        return PIECES[function.__name__]

    return declare
