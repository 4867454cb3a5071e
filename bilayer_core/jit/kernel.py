"""Kernels, and the one place with numba's options for them.

``contract``, ``reassoc``, ``nsz`` and ``arcp`` allow fused and reordered arithmetic but keep NaN and infinity, so that
a diverging iterate is seen. Finiteness is nevertheless tested outside kernels.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property, update_wrapper
from importlib import import_module
from typing import Any

FASTMATH = {"contract", "reassoc", "nsz", "arcp"}
EXACT = {"contract", "nsz"}
"""For sums whose rounding errors are kept: their terms must not be reordered."""
PUBLIC = os.environ.get("BILAYER_JIT_PUBLIC", "0") != "0"
"""Switch that does without what `compiler.undocumented` describes."""
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"} | ({} if PUBLIC else {"_nrt": False})
WITHOUT_ENTRIES: dict[str, bool] = {} if PUBLIC else {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
COMPILER = "bilayer_core.jit.compiler.machine_code"
"""Module that imports numba: for processes that compile something."""


class Kernel:
    """A function that becomes part of each piece that calls it.

    Left to itself, LLVM's engine would take one copy of a function for all pieces of a process, that which it met
    first, and last digits would depend on what a process has compiled or loaded before.

    Attributes
    ----------
    py_func : callable
        As it is written.
    options : dict
        Of numba.
    """

    def __init__(self, function: Callable, fastmath: set[str]):
        update_wrapper(self, function)
        self.py_func, self.options = function, OPTIONS | {"fastmath": fastmath, "forceinline": True}

    @cached_property
    def compiled(self) -> Callable:
        """Its dispatcher, as numba calls it, for pieces that it becomes part of."""
        return import_module(COMPILER).dispatcher(self, **WITHOUT_ENTRIES)

    @cached_property
    def _for_interpreter(self) -> Callable:
        return import_module(COMPILER).dispatcher(self)

    def __call__(self, *arguments: Any) -> Any:
        """Run it for the interpreter, by which every process that does so compiles it: tests do."""
        return self._for_interpreter(*arguments)


def kernel(function):
    """Compile `function` for kernels that call it: nopython, GIL released, NaN-preserving fast arithmetic."""
    return Kernel(function, FASTMATH)


def exact_kernel(function):
    """Return `kernel` without reordered arithmetic."""
    return Kernel(function, EXACT)
