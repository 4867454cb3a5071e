"""A compiler for functions that only kernels call: their machine code is made once, as part of the kernel.

Numba optimises every function and makes machine code for it, and does both again for the copy of it in every function
that calls it, level by level. Here a function ends as what LLVM reads; what calls it is optimised with it. The loop
over steps takes a third less time to compile for it.

This replaces the last pass of the pipeline, `NativeLowering`, and the library that it fills.
"""

from __future__ import annotations

from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from .compiler import KernelCompiler
from .inner_cache import InnerCache, entry_point
from .inner_library import InnerLibrary, Origin


class InnerFunction(CPUDispatcher):
    """A function that only kernels call."""

    def __call__(self, *arguments):
        raise TypeError(f"{self.py_func.__qualname__} is called by kernels alone (`jit.inner`), not by the interpreter")

    def enable_caching(self):
        """Keep what is compiled on disk."""
        self._cache = InnerCache(self.py_func)


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):
    """`NativeLowering` into an `InnerLibrary`."""

    _name = "inner_lowering"

    def run_pass(self, state):
        state.library = library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        described = lowered.fndesc
        of = state.func_id
        library.origin = Origin(of.modname, of.func_qualname, tuple(state.args), described.mangled_name)
        entry = entry_point(described, lowered.env, library)
        state.targetctx.insert_user_function(entry, described, [library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


class InnerCompiler(KernelCompiler):
    """Compiles what kernels alone call."""

    lowering = _InnerLowering
