"""A compiler for kernels: numba's pipeline without what serves nothing here.

Left out are passes for closures, `with`, `raise`, `literal_unroll`, overloads to inline, expressions of whole arrays
and parallel loops, all of which kernels do without; the record of types for people to read; and the ends of lifetimes
of variables, which matter where references are counted.

Passes and libraries are insides of numba that may change from release to release: `setup.py` names those for which this
is tested.
"""

from __future__ import annotations

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering, NoPythonBackend, NopythonTypeInference, PreLowerStripPhis
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FixupArgs,
    GenericRewrites,
    IRProcessing,
    ReconstructSSA,
    RewriteSemanticConstants,
    TranslateByteCode,
)

from .flags import KernelFlags

PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    RewriteSemanticConstants,
    DeadBranchPrune,
    GenericRewrites,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
)


class KernelLibrary(JITCodeLibrary):
    """The code of a kernel."""

    def _optimize_functions(self, module):
        """Tidy each function before it is linked: one pass manager for those that a module has, none for others'."""
        module.data_layout = self._codegen._data_layout
        passes, builder = None, None
        for function in module.functions:
            if function.is_declaration:
                continue
            if passes is None:
                builder = self._codegen._pass_builder()
                passes = builder.getFunctionPassManager()
            passes.run(function, builder)


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(NativeLowering):
    """`NativeLowering` into a `KernelLibrary`."""

    _name = "kernel_lowering"

    def run_pass(self, state):
        state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


class KernelCompiler(CompilerBase):
    """Compiles what the interpreter calls."""

    lowering = _KernelLowering

    def __init__(self, typing, target, library, arguments, returns, flags, types_of_locals):
        super().__init__(typing, target, library, arguments, returns, KernelFlags(flags), types_of_locals)

    def define_pipelines(self):
        """The passes of a compilation, in order."""
        pipeline = PassManager("kernel")
        for each in (*PASSES, self.lowering, NoPythonBackend):
            pipeline.add_pass(each, each.__name__)
        pipeline.finalize()
        return [pipeline]
