"""A compiler for functions that only kernels call: their machine code is made once, as part of the kernel.

Numba optimises every function and makes machine code for it, and does both again for the copy of it in every function
that calls it, level by level. Here a function ends as what LLVM reads; what calls it is optimised with it. The loop
over steps takes a third less time to compile for it.

This replaces the last pass of the pipeline, `NativeLowering`, and the library that it fills.
"""

from __future__ import annotations

from llvmlite.binding import newpassmanagers
from numba import _dynfunc
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from .compiler import KernelCompiler, KernelLibrary


class InnerFunction(CPUDispatcher):
    """A function that only kernels call."""

    def __call__(self, *arguments):
        raise TypeError(f"{self.py_func.__qualname__} is called by kernels alone (`jit.inner`), not by the interpreter")


class _Library(KernelLibrary):
    """Code that is linked into that of callers, and has no address of its own."""

    def _optimize_final_module(self):
        """Drop what nothing refers to, such as the addresses of functions that are called by name."""
        passes = newpassmanagers.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(self._final_module, self._codegen._pass_builder())

    def _finalize_final_module(self):
        """Be ready for linking; the engine that makes machine code does not see this."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def serialize_using_object_code(self):
        """What goes into numba's cache: there is no object code."""
        return self.serialize_using_bitcode()


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):
    """`NativeLowering` into a `_Library`."""

    _name = "inner_lowering"

    def run_pass(self, state):
        state.library = library = _Library(state.targetctx.codegen(), state.func_id.func_qualname)
        library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        described = lowered.fndesc
        # by this object numba finds what to link; no machine code is at its address, which is 0
        name = state.func_id.func_name
        entry = _dynfunc.make_function(described.lookup_module(), name, "", 0, lowered.env, (library,))
        state.targetctx.insert_user_function(entry, described, [library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


class InnerCompiler(KernelCompiler):
    """Compiles what kernels alone call."""

    lowering = _InnerLowering
