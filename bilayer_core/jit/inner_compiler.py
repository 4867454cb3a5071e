"""A compiler for functions that only kernels call: their machine code is made once, as part of the kernel.

Numba optimises every function and makes machine code for it, and does both again for the copy of it in every function
that calls it, level by level. Here a function ends as what LLVM reads; what calls it is optimised with it. The loop
over steps takes a third less time to compile for it.
"""

from __future__ import annotations

from numba.core import sigutils
from numba.core.compiler import CompilerBase
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.registry import CPUDispatcher

from .flags import KernelFlags
from .inner_cache import InnerCache
from .passes import PASSES


class InnerFunction(CPUDispatcher):
    """A function that only kernels call."""

    def __call__(self, *arguments):
        raise TypeError(f"{self.py_func.__qualname__} is called by kernels alone (`jit.inner`), not by the interpreter")

    def enable_caching(self):
        """Keep what is compiled on disk."""
        self._cache = InnerCache(self.py_func)

    def compile(self, sig):
        """Compile for some types, or take that from the cache.

        As numba does, but for the clocks that it starts for each function: they are told of every call of LLVM by all
        functions that are being compiled.
        """
        arguments, returns = sigutils.normalize_signature(sig)
        known = self.overloads.get(tuple(arguments))
        if known is not None:
            return known.entry_point
        with global_compiler_lock, self._compiling_counter:
            compiled = self._cache.load_overload(sig, self.targetctx)
            if compiled is not None:
                self._cache_hits[sig] += 1
                self.targetctx.insert_user_function(compiled.entry_point, compiled.fndesc, [compiled.library])
                self.add_overload(compiled)
            else:
                self._cache_misses[sig] += 1
                compiled = self._compiler.compile(arguments, returns)
                self.add_overload(compiled)
                self._cache.save_overload(sig, compiled)
        return compiled.entry_point


class InnerCompiler(CompilerBase):
    """Compiles what kernels alone call."""

    def __init__(self, typing, target, library, arguments, returns, flags, types_of_locals):
        super().__init__(typing, target, library, arguments, returns, KernelFlags(flags), types_of_locals)

    def define_pipelines(self):
        """The passes of a compilation, in order."""
        pipeline = PassManager("inner")
        for each in PASSES:
            pipeline.add_pass(each, each.__name__)
        pipeline.finalize()
        return [pipeline]
