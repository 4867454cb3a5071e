"""Numba's cache for functions that only kernels call: each is kept by itself, with the names of what it calls."""

from __future__ import annotations

from functools import reduce
from importlib import import_module

from llvmlite.binding import parse_bitcode
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import CodeLibrary
from numba.core.compiler import CompileResult, compile_result

from .libraries import InnerLibrary, Origin, entry_point


def _found(origin: Origin) -> InnerLibrary | None:
    """The library of a function, compiled or from its own cache; None if it is another than it was."""
    try:
        function = reduce(getattr, origin.name.split("."), import_module(origin.module))
    except (ImportError, AttributeError):
        return None
    function.compile(origin.types)
    library = function.overloads[origin.types].library
    return library if library.origin == origin else None


class _InnerCacheImpl(CompileResultCacheImpl):
    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        """Name of the files, another than numba's own have."""
        return "inner-" + super().get_filename_base(fullname, abiflags)

    def check_cachable(self, compiled: CompileResult) -> bool:
        """Whether it can be kept: not if it, or what it calls, cannot be found by name."""
        return not any("<locals>" in of.origin.name for of in _within(compiled.library)) and super().check_cachable(
            compiled
        )

    def reduce(self, compiled: CompileResult) -> tuple:
        """What goes into a file."""
        library, described = compiled.library, compiled.fndesc
        described.typemap = described.calltypes = None
        called = [of.origin if of in _within(library) else _code_of(of) for of in library.called]
        state = *_code_of(library), library.origin, called
        return state, described, compiled.environment, compiled.signature

    def rebuild(self, target_context, payload: tuple) -> CompileResult | None:
        """What comes from a file; None if what it calls has changed."""
        state, described, environment, signature = payload
        library = _rebuilt(target_context.codegen(), *state)
        if library is None:
            return None
        return compile_result(
            typing_context=target_context.typing_context,
            target_context=target_context,
            entry_point=entry_point(described, environment, library),
            library=library,
            signature=signature,
            fndesc=described,
            environment=environment,
            objectmode=False,
            lifted=(),
            reload_init=[],
        )


def _code_of(library: CodeLibrary) -> tuple[str, bytes]:
    return library.name, library._get_module_for_linking().as_bitcode()


def _from_code(codegen, name: str, bitcode: bytes) -> InnerLibrary:
    library = InnerLibrary(codegen, name)
    library._final_module = library._shared_module = parse_bitcode(bitcode)
    library._finalized = True
    return library


def _within(library: InnerLibrary) -> list[InnerLibrary]:
    """A library and those that it calls directly, numba's own left out."""
    return [of for of in (library, *library.called) if isinstance(of, InnerLibrary) and of.origin is not None]


def _rebuilt(codegen, name: str, bitcode: bytes, origin: Origin, called: list) -> InnerLibrary | None:
    library = _from_code(codegen, name, bitcode)
    library.origin = origin
    for each in called:
        found = _found(each) if isinstance(each, Origin) else _from_code(codegen, *each)
        if found is None:
            return None
        library.add_linking_library(found)
    return library


class InnerCache(FunctionCache):
    """Cache of one function that only kernels call."""

    _impl_class = _InnerCacheImpl
