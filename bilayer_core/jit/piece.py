"""Pieces of the engine: each compiled by itself, once, for declared types, and called through its address.

Numba compiles a function with all that it calls, and what this calls, and optimises every level again; each new
combination of types is another function. A piece ends that: who calls it knows its address alone, so it is compiled
once for all scenes, by any process, and an absent force is an address that nobody calls.

    @piece(float, Problem, Configuration)
    def smallest_gap(problem, at): ...

The interpreter calls it with records and numbers, without the GIL: ``smallest_gap(problem, at)``. Kernels call it
through a record of addresses:

    @record
    class Calls:
        smallest_gap: Address

    gap = call(problem.calls.smallest_gap, (problem, at))

A call with other types than those declared is an error of compilation.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterable
from typing import Any

import numba
from llvmlite import ir
from numba import errors
from numba.core import cgutils
from numba.extending import intrinsic

from .cache import cache_folder, cached
from .kernel import FASTMATH, OPTIONS
from .record import NUMBERS, Record, type_in_kernels

IN_C = {int: ctypes.c_int64, float: ctypes.c_double, bool: ctypes.c_bool}


class Piece:
    """A function with an address.

    Attributes
    ----------
    name : str
    function : callable
        As it is written.
    seconds : float
        CPU time that its compilation, or its reading from the cache, took [s]; 0 before.
    """

    def __init__(self, function: Callable, result: type, arguments: tuple):
        self.name, self.function = function.__name__, function
        self._result, self._arguments = result, arguments
        self._compiled = self._callable = None
        self.seconds = 0.0

    @property
    def signature(self):
        """Types in kernels."""
        return NUMBERS[self._result](*map(type_in_kernels, self._arguments))

    @property
    def address(self) -> int:
        """Where it is in memory; compiled, or read from the cache, when first asked for."""
        if self._compiled is None:
            begin = time.thread_time()
            with cached():
                compiler = numba.cfunc(
                    self.signature, nopython=True, **OPTIONS, fastmath=FASTMATH, cache=cache_folder() is not None
                )
                self._compiled = compiler(self.function)
            self.seconds = time.thread_time() - begin
        return self._compiled.address

    def __call__(self, *arguments: Any):
        """Run it; records go by their addresses."""
        if self._callable is None:
            kinds = [IN_C.get(kind, ctypes.c_void_p) for kind in self._arguments]
            self._callable = ctypes.CFUNCTYPE(IN_C[self._result], *kinds)(self.address)
        return self._callable(*[of.address if isinstance(of, Record) else of for of in arguments])


PIECES: dict[str, Piece] = {}
"""All that were declared, by name."""


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


def caller(name: str, signature: Callable):
    """A function for kernels that calls what is at an address.

    Parameters
    ----------
    name : str
        For messages.
    signature : callable
        Signature of what is called, from the type of the address.
    """

    def check(typing_context, wanted: tuple, given: tuple) -> None:
        fits = len(wanted) == len(given)
        if not fits or any(typing_context.can_convert(*kinds) is None for kinds in zip(given, wanted, strict=True)):
            listed = [", ".join(map(str, kinds)) for kinds in (wanted, given)]
            raise errors.TypingError(f"{name}: is called with ({listed[1]}); it takes ({listed[0]})")

    @intrinsic
    def call_at(typing_context, address, arguments):
        called = signature(address)
        check(typing_context, called.args, arguments.types)

        def generate(context, builder, of_call, values):
            items = cgutils.unpack_tuple(builder, values[1], len(called.args))
            items = [
                context.cast(builder, item, of, to)
                for item, of, to in zip(items, arguments.types, called.args, strict=True)
            ]
            kinds = [context.get_value_type(of) for of in called.args]
            function = ir.FunctionType(context.get_value_type(called.return_type), kinds)
            return builder.call(builder.inttoptr(values[0], function.as_pointer()), items)

        return called.return_type(address, arguments), generate

    return call_at


call = caller("call", lambda address: PIECES[address.piece].signature)
"""For kernels: ``call(address, arguments)``, with the address of a piece from a record and a tuple."""


def addresses(declared: type[Record], needed: Iterable[str]) -> Record:
    """A record of addresses, filled with those of the pieces that are needed; the others are 0."""
    needed = set(needed)
    return declared(**{name: PIECES[name].address if name in needed else 0 for name in declared.names})
