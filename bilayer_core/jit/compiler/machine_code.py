"""From a piece to machine code: numba's optimised LLVM code, as an object file with one symbol, that of the piece.

Everything else in it is internal. So code that two pieces have alike stays apart, wherever they are linked, and last
digits do not depend on which pieces a process has loaded.
"""

from __future__ import annotations

from collections.abc import Callable

import numba
from llvmlite import binding
from numba import types

from bilayer_core.jit.called import symbol_of
from bilayer_core.jit.compiler.calls import declare_calls, signature_of
from bilayer_core.jit.digest import CalledByName
from bilayer_core.jit.kernel import FASTMATH, OPTIONS, Kernel
from bilayer_core.jit.target import machine, target

LOCK = """
declare i32 @PyGILState_Ensure()
declare void @PyGILState_Release(i32)
define void @numba_gil_ensure(ptr %state) {
  %held = call i32 @PyGILState_Ensure()
  store i32 %held, ptr %state
  ret void
}
define void @numba_gil_release(ptr %state) {
  %held = load i32, ptr %state
  call void @PyGILState_Release(i32 %held)
  ret void
}
"""
"""What numba's library defines for code that reports an error to Python."""


def set_target() -> None:
    """Let numba compile for the target: it takes this when it compiles its first function, and optimises for it."""
    numba.config.reload_config()  # which would undo this if it came later, after a change of the environment
    numba.config.CPU_NAME, numba.config.CPU_FEATURES = target()


def dispatcher(kernel: Kernel, **options: bool) -> Callable:
    """Return a kernel as numba compiles it, with further `options`."""
    declare_calls()
    set_target()
    return numba.njit(**kernel.options, **options)(kernel.py_func)


def compile_piece(piece: CalledByName) -> bytes:
    """Return the object file of a piece."""
    declare_calls()
    set_target()
    compiled = numba.cfunc(signature_of(piece), nopython=True, **OPTIONS, fastmath=FASTMATH)(piece.function)
    module = binding.parse_assembly(compiled.inspect_llvm())
    module.get_function(compiled.native_name).name = symbol_of(piece.name)
    if any(function.name == "numba_gil_ensure" for function in module.functions):
        module.link_in(binding.parse_assembly(LOCK))
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name != symbol_of(piece.name):
            value.linkage = "internal"
    return machine().emit_object(module)


def address_of_helper(name: str) -> int:
    """Return the address of a function of numba's library, which it knows once it has compiled something."""
    if binding.address_of_symbol(name) is None:
        numba.cfunc(types.int64(types.int64))(_same)
    return binding.address_of_symbol(name)


def _same(number):
    return number
