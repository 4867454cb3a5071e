"""A compiler for what the interpreter calls: machine code, and a wrapper for it, around the function inside.

Kernels that call such a function take the function inside, too: most never get an entry for the interpreter, nor
machine code of their own.
"""

from __future__ import annotations

from functools import partial
from types import FunctionType

from numba import njit
from numba.core import types
from numba.core.compiler import CompilerBase, compile_result
from numba.core.registry import CPUDispatcher

from .collector import few_collections
from .flags import KernelFlags
from .inner_compiler import InnerFunction
from .libraries import EntryLibrary


class KernelFunction(CPUDispatcher):
    """A function that the interpreter calls.

    Attributes
    ----------
    inside : InnerFunction
        What kernels call in its place.
    """

    @property
    def _numba_type_(self) -> types.Type:
        """What it is in the code of kernels."""
        return types.Dispatcher(self.inside)


class _EntryCompiler(CompilerBase):
    def __init__(self, inside: InnerFunction, typing, target, library, arguments, returns, flags, types_of_locals):
        super().__init__(typing, target, library, arguments, returns, KernelFlags(flags), types_of_locals)
        self._inside = inside

    def compile_extra(self, function):
        """Wrap the function inside; there is nothing else in `function`."""
        state = self.state
        with few_collections():
            self._inside.compile(state.args)
        inside = self._inside.overloads[state.args]
        described, environment, target = inside.fndesc, inside.environment, state.targetctx
        library = EntryLibrary(target.codegen(), described.qualname)
        library.enable_object_caching()
        library.add_linking_library(inside.library)
        with target.push_code_library(library):
            target.create_cpython_wrapper(library, described, environment, None, release_gil=state.flags.release_gil)
        entry = target.get_executable(library, described, environment)
        return compile_result(
            typing_context=state.typingctx,
            target_context=target,
            entry_point=entry,
            library=library,
            signature=inside.signature,
            fndesc=described,
            environment=environment,
            objectmode=False,
            lifted=(),
            metadata={},
            reload_init=[],
        )


def with_entry(function, inside: InnerFunction, options: dict) -> KernelFunction:
    """Make a function that the interpreter can call of one that kernels call."""
    compiled = njit(**options, pipeline_class=partial(_EntryCompiler, inside))(function)
    compiled.__class__ = KernelFunction
    compiled.inside = inside
    return compiled


def renamed(function: FunctionType, suffix: str) -> FunctionType:
    """The same function by another name, which numba's cache knows apart."""
    copy = FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__qualname__ = f"{function.__qualname__}.{suffix}"
    return copy
