"""Compilation: options, records that kernels read, pieces compiled by themselves, and their cache on disk.

Two kinds of functions are compiled:

`kernel`
    Called by other kernels, and by tests: compiled within each piece that calls it, and kept nowhere.
`piece`
    Compiled by itself for declared types when it is first called, by other pieces or by the interpreter; kept on disk.
"""

from __future__ import annotations

from bilayer_core.jit.called import caller, record_at
from bilayer_core.jit.kernel import kernel
from bilayer_core.jit.piece import piece
from bilayer_core.jit.record import UNALLOCATED, Record, record, shapes_of, zeros_in_one

__all__ = ["UNALLOCATED", "Record", "record", "record_at", "shapes_of", "zeros_in_one"]
__all__ += ["caller", "kernel", "piece"]
