"""The one place with numba options.

``contract``, ``reassoc``, ``nsz`` and ``arcp`` allow fused and reordered arithmetic but keep NaN and infinity, so that
a diverging iterate is seen. Finiteness is nevertheless tested outside kernels.
"""

from __future__ import annotations

import numba

from bilayer_core.jit import undocumented

FASTMATH = {"contract", "reassoc", "nsz", "arcp"}
EXACT = {"contract", "nsz"}
"""For sums whose rounding errors are kept: their terms must not be reordered."""
OPTIONS = dict(nogil=True, error_model="numpy", **undocumented.OPTIONS)


def kernel(function):
    """Compile `function` for kernels that call it: nopython, GIL released, NaN-preserving fast arithmetic.

    It becomes part of each piece that calls it: left to itself, LLVM's engine would take one copy of a function for all
    pieces of a process, that which it met first, and last digits would depend on what a process has compiled or loaded
    before. The interpreter can call it, too, but then it is compiled by every process that does.
    """
    return numba.njit(**OPTIONS, fastmath=FASTMATH, forceinline=True)(function)


def exact_kernel(function):
    """`kernel` without reordered arithmetic."""
    return numba.njit(**OPTIONS, fastmath=EXACT, forceinline=True)(function)
