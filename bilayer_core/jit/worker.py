"""A process that compiles the pieces whose names it reads, one a line, and prints each when it is done.

It ends at once when its input does, whatever it is at: whoever started it has ended, or has no more work.
"""

from __future__ import annotations

import gc
import os
import queue
import sys
import threading
from importlib import import_module

from bilayer_core.errors import OutputError
from bilayer_core.jit.compile_all import ENGINE
from bilayer_core.jit.piece import PIECES

OBJECTS_BETWEEN_COLLECTIONS = 50_000
"""Numba makes many, most of which stay: with Python's 700 collections take a tenth of the time."""


def main() -> None:
    """Compile what standard input names."""
    gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)
    names: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(names,), daemon=True).start()
    import_module(ENGINE)
    while True:
        name = names.get()
        try:
            PIECES[name].make_object()
        except OutputError as error:
            print(error, file=sys.stderr)
            sys.exit(error.exit_code)
        print(name, flush=True)


def _read(names: queue.SimpleQueue[str]) -> None:
    for line in sys.stdin:
        names.put(line.strip())
    os._exit(0)


if __name__ == "__main__":
    main()
