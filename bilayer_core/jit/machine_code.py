"""From a piece to machine code: numba's optimised LLVM code, as an object file with one symbol, that of the piece.

Everything else in it is internal. So code that two pieces have alike stays apart, wherever they are linked, and last
digits do not depend on which pieces a process has loaded.
"""

from __future__ import annotations

import numba
from llvmlite import binding

from bilayer_core.jit.digest import CalledByName
from bilayer_core.jit.kernel import FASTMATH, OPTIONS
from bilayer_core.jit.target import machine, set_target

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


def symbol_of(name: str) -> str:
    """Return the name under which a piece is in its object."""
    return f"bilayer_piece_{name}"


def slot_of(name: str) -> str:
    """Return the symbol of the word that holds the address of a piece."""
    return f"bilayer_slot_of_{name}"


def compile_piece(piece: CalledByName) -> bytes:
    """Return the object file of a piece."""
    set_target()
    compiled = numba.cfunc(piece.signature, nopython=True, **OPTIONS, fastmath=FASTMATH)(piece.function)
    module = binding.parse_assembly(compiled.inspect_llvm())
    module.get_function(compiled.native_name).name = symbol_of(piece.name)
    if any(function.name == "numba_gil_ensure" for function in module.functions):
        module.link_in(binding.parse_assembly(LOCK))
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name != symbol_of(piece.name):
            value.linkage = "internal"
    return machine().emit_object(module)
