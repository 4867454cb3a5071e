"""The garbage collector while kernels are compiled.

A compilation makes millions of objects that refer to each other and live as long as it does: looking through all of
them again and again takes a tenth of its time.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

YOUNG, TIMES = 20_000, 1_000
"""How many objects more are looked through, and after how many times older ones, too."""


@contextmanager
def few_collections() -> Iterator[None]:
    """Look for garbage among the youngest objects alone."""
    before = gc.get_threshold()
    gc.set_threshold(YOUNG, TIMES, before[2])
    try:
        yield
    finally:
        gc.set_threshold(*before)
