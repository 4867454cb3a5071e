"""The one place with numba options.

Kernels are compiled lazily at their first call, release the GIL and are cached on disk.
``contract``, ``reassoc``, ``nsz`` and ``arcp`` allow fused and reordered arithmetic but keep
NaN and infinity, so that a diverging iterate is seen. Finiteness is nevertheless tested outside kernels.
"""

from __future__ import annotations

import logging
import os

import numba

from . import indexing  # noqa: F401 (what it registers serves every kernel)
from .entry_compiler import KernelFunction, renamed, with_entry
from .inner_compiler import InnerCompiler, InnerFunction

FASTMATH = {"contract", "reassoc", "nsz", "arcp"}
_log = logging.getLogger(__name__)


def _cache_is_usable() -> bool:
    """Whether numba finds a directory to write compiled kernels to."""
    from numba.core.caching import FunctionCache

    def probe():
        return None

    try:
        FunctionCache(probe)
    except RuntimeError as error:
        _log.warning(
            "compiled kernels cannot be cached (%s): every start compiles again. "
            "Set NUMBA_CACHE_DIR to a writable directory.",
            error,
        )
        return False
    return True


CACHE = os.environ.get("BILAYER_JIT_CACHE", "1") != "0" and _cache_is_usable()
OPTIONS = dict(cache=CACHE, nogil=True, error_model="numpy", fastmath=FASTMATH, no_cfunc_wrapper=True, _nrt=False)


def kernel(function) -> KernelFunction:
    """Compile `function`: nopython, GIL released, cached, NaN-preserving fast arithmetic.

    For what the interpreter calls; other kernels may call it too. An index that is no literal must not be negative:
    it is not counted from the end of an array (`indexing`).
    """
    return with_entry(function, inner(renamed(function, "inside")), OPTIONS)


def inner(function):
    """A function that only kernels call, and the interpreter cannot: it is compiled within each of them."""
    return _within_kernels(function, FASTMATH)


def exact(function):
    """Like `inner`, with the operations in the order they are written: rounding is part of the result."""
    return _within_kernels(function, False)


def _within_kernels(function, fastmath):
    options = OPTIONS | {"cache": False, "no_cpython_wrapper": True, "fastmath": fastmath}
    compiled = numba.njit(**options, pipeline_class=InnerCompiler)(function)
    compiled.__class__ = InnerFunction
    if CACHE:
        compiled.enable_caching()
    return compiled
