"""The passes of a compilation: numba's without what serves nothing in kernels.

Left out are passes for closures, `with`, `raise`, `literal_unroll`, overloads to inline, expressions of whole arrays
and parallel loops, all of which kernels do without; the record of types for people to read, and for debuggers; and the
ends of lifetimes of variables, which matter where references are counted: numba finds them anew in four of the passes.

Passes are insides of numba that may change from release to release: `setup.py` names those for which this is tested.
"""

from __future__ import annotations

from numba.core import cgutils
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import build_definitions
from numba.core.lowering import Lower
from numba.core.rewrites.static_binop import DetectStaticBinops
from numba.core.rewrites.static_getitem import RewriteConstGetitems, RewriteConstSetitems
from numba.core.ssa import reconstruct_ssa
from numba.core.transforms import canonicalize_cfg
from numba.core.typed_passes import NativeLowering, NoPythonBackend, NopythonTypeInference, PreLowerStripPhis
from numba.core.untyped_passes import DeadBranchPrune, FixupArgs, RewriteSemanticConstants, TranslateByteCode

from .indexing import counting_from_start
from .libraries import InnerLibrary, Origin, entry_point

REWRITES = (DetectStaticBinops, RewriteConstGetitems, RewriteConstSetitems)


class _Pass(FunctionPass):
    def __init__(self):
        super().__init__()


@register_pass(mutates_CFG=True, analysis_only=False)
class _SimpleLoops(_Pass):
    """Loops with one way back each."""

    _name = "simple_loops"

    def run_pass(self, state):
        state.func_ir.blocks = canonicalize_cfg(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _Constants(_Pass):
    """Powers and indices that are constants."""

    _name = "constants"

    def run_pass(self, state):
        blocks = state.func_ir.blocks
        for each in REWRITES:
            rewrite, left = each(state), list(blocks.items())
            while left:
                label, block = left.pop()
                if rewrite.match(state.func_ir, block, state.typemap, state.calltypes):
                    blocks[label] = rewrite.apply()
                    left.append((label, blocks[label]))
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _SingleAssignment(_Pass):
    """Variables that are assigned once."""

    _name = "single_assignment"

    def run_pass(self, state):
        state.func_ir = reconstruct_ssa(state.func_ir)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _MergedVariables(PreLowerStripPhis):
    """Variables that may be assigned at several places again."""

    _name = "merged_variables"

    def run_pass(self, state):
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return True


class _Lower(Lower):
    """Numba's way into LLVM's language, without records of variables for a debugger."""

    def storevar(self, value, name, argidx=None):
        super().storevar(value, name)

    def alloca_lltype(self, name, lltype, datamodel=None):
        return cgutils.alloca_once(self.builder, lltype, name=name, zfill=False)


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):
    """`NativeLowering` into an `InnerLibrary`."""

    _name = "inner_lowering"
    lowering_class = _Lower

    def run_pass(self, state):
        of, state.targetctx = state.func_id, counting_from_start(state.targetctx)
        state.library = library = InnerLibrary(state.targetctx.codegen(), of.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        described = lowered.fndesc
        library.origin = Origin(
            module=of.modname,
            name=of.func_qualname,
            types=tuple(state.args),
            returns=state.return_type,
            mangled=described.mangled_name,
        )
        entry = entry_point(described, lowered.env, library)
        state.targetctx.insert_user_function(entry, described, [library])
        state["cr"] = lowered._replace(cfunc=entry)
        return True


PASSES = (
    TranslateByteCode,
    FixupArgs,
    _SimpleLoops,
    RewriteSemanticConstants,
    DeadBranchPrune,
    _Constants,
    _SingleAssignment,
    NopythonTypeInference,
    _MergedVariables,
    _InnerLowering,
    NoPythonBackend,
)
