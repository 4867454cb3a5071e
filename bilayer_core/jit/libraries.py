"""Code of a function that kernels call, by itself: what it calls in turn is linked when a kernel is, once for all.

Numba links into the code of a function all that it calls, and what this calls: at every level a copy of all below.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from llvmlite.binding import Linkage, newpassmanagers
from numba import _dynfunc
from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.types import Type

TIDY = 2
"""LLVM's level for each function before it is linked: with 3 it takes longer and steps do not, with 1 they do."""


@dataclass(frozen=True)
class Origin:
    """What a library is the code of: a function of a module, compiled for some types, under a name in LLVM."""

    module: str
    name: str
    types: tuple[Type, ...]
    returns: Type
    mangled: str


class KernelLibrary(JITCodeLibrary):
    """Code of a function in LLVM's language."""

    def _optimize_functions(self, module):
        """Tidy each function before it is linked: one pass manager for those that a module has, none for others'."""
        module.data_layout = self._codegen._data_layout
        passes, builder = None, None
        for function in module.functions:
            if function.is_declaration:
                continue
            if passes is None:
                builder = self._codegen._pass_builder(opt=TIDY)
                passes = builder.getFunctionPassManager()
            passes.run(function, builder)


class InnerLibrary(KernelLibrary):
    """Code that is linked into kernels, and has no address of its own.

    Attributes
    ----------
    origin : Origin or None
        None if it is numba's own.
    """

    origin: Origin | None = None

    def finalize(self):
        """Be ready for linking. The engine that makes machine code does not see this.

        What nothing refers to is dropped, such as the addresses of functions that are called by name.
        """
        self._raise_if_finalized()
        passes = newpassmanagers.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(self._final_module, self._codegen._pass_builder())
        self._finalize_dynamic_globals()
        self._finalized = True

    def _get_module_for_linking(self):
        """The code itself: several kernels may have it, and leave out what they do not call."""
        self._ensure_finalized()
        if self._shared_module is None:
            for function in self._final_module.functions:
                if not function.is_declaration:
                    function.linkage = Linkage.linkonce_odr
            self._shared_module = self._final_module
        return self._shared_module

    @property
    def called(self) -> list[CodeLibrary]:
        """Libraries of what this calls directly."""
        return list(dict.fromkeys(self._linking_libraries))


def entry_point(described, environment, library: InnerLibrary):
    """An object by which numba finds what to link; no machine code is at its address, which is 0."""
    return _dynfunc.make_function(described.lookup_module(), described.qualname, "", 0, environment, (library,))


class EntryLibrary(KernelLibrary):
    """Code that the interpreter calls: that of a function, and of all that it calls."""

    def finalize(self):
        self._linking_libraries = list(dict.fromkeys(_with_all_that_is_called(self._linking_libraries)))
        super().finalize()

    def _optimize_final_module(self):
        """Numba's passes without those that come before it looks for counts of references: there are none."""
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)

    def _finalize_specific(self):
        """Keep what is called to itself.

        Several kernels have functions of the same name, each optimised with its kernel. The engine would take the first
        that it meets for all of them: results would depend, in the last digit, on which kernels a process has compiled
        or loaded before.
        """
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage is Linkage.linkonce_odr:
                function.linkage = Linkage.internal
        super()._finalize_specific()


def _with_all_that_is_called(libraries: list[CodeLibrary]) -> Iterator[CodeLibrary]:
    """Libraries, each before those that it calls."""
    seen, stack = set(), libraries[::-1]
    while stack:
        library = stack.pop()
        if library in seen:
            continue
        seen.add(library)
        yield library
        if isinstance(library, InnerLibrary):
            stack.extend(library.called[::-1])
