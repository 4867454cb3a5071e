"""Compilation: options, records that kernels read, pieces compiled by themselves, and their cache on disk.

Three kinds of functions are compiled:

`kernel`
    Called by other kernels, and by tests: compiled within each piece that calls it, and kept nowhere.
`piece`
    Compiled by itself for declared types, kept on disk, and called through its address: by other pieces, which find it
    in a record of addresses, or by the interpreter.
`entry`
    Called by the interpreter with arrays, where a model is built: kept on disk.
"""

from __future__ import annotations

from .kernel import entry, kernel
from .piece import addresses, call, caller, piece
from .record import Address, Record, record, record_at, shapes_of, zeros_in_one

__all__ = ["Address", "Record", "record", "record_at", "shapes_of", "zeros_in_one"]
__all__ += ["addresses", "call", "caller", "entry", "kernel", "piece"]
