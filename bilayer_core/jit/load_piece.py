"""From an object file to an address, by LLVM's JITLink.

(The older linker that numba uses, RuntimeDyld, ends the process once code that is linked later lies too far away.)
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import cache
from importlib import import_module

from llvmlite import binding

from bilayer_core.jit.called import symbol_of
from bilayer_core.jit.kernel import COMPILER

HELPERS = ("numba_do_raise", "numba_runtime_build_excinfo_struct", "numba_unpickle", "NRT_MemInfo_call_dtor")
"""Functions of numba's library that code calls where bounds are checked, and where arrays are counted."""
_numbers = itertools.count()
_loaded: list[binding.ResourceTracker] = []
"""Whose memory holds the code: for ever, since addresses of it are in tables."""


@cache
def _linker() -> binding.LLJIT:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.create_lljit_compiler(use_jit_link=True)


def load(name: str, code: bytes, symbols: Mapping[str, int]) -> int:
    """Return the address of a piece.

    `code`: its object file. `symbols`: addresses of what it refers to, beside functions of C and of Python. Raises
    RuntimeError if it cannot be linked.
    """
    library = binding.JITLibraryBuilder().add_object_img(code).add_current_process().export_symbol(symbol_of(name))
    helpers = {name: import_module(COMPILER).address_of_helper(name) for name in HELPERS if name.encode() in code}
    for symbol, address in (helpers | dict(symbols)).items():
        library.import_symbol(symbol, address)
    _loaded.append(library.link(_linker(), f"{name} {next(_numbers)}"))
    return _loaded[-1][symbol_of(name)]
