"""A process that compiles the pieces whose names it reads, one a line, and prints each when it is done."""

from __future__ import annotations

import sys
from importlib import import_module

from .compile_all import ENGINE
from .piece import PIECES


def main() -> None:
    """Compile what standard input names."""
    import_module(ENGINE)
    for line in sys.stdin:
        name = line.strip()
        _ = PIECES[name].address
        print(name, flush=True)


if __name__ == "__main__":
    main()
