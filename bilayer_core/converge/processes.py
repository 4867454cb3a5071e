"""Processes beside this one that end with it, however it ends."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from typing import Any


class _Pool(ProcessPoolExecutor):
    """Its processes are started where work is handed over, and do not hear Ctrl-C, which is for who started them."""

    def submit(self, *arguments: Any, **named: Any) -> Future:
        with _keyboard_unheard():
            return super().submit(*arguments, **named)


@contextmanager
def side_by_side(count: int) -> Iterator[ProcessPoolExecutor]:
    """As many processes; those that still work when the block ends, or raises, are ended."""
    before = set(active_children())
    with _Pool(count, mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
        try:
            yield pool
        finally:
            for process in set(active_children()) - before:
                process.terminate()
            pool.shutdown(wait=True, cancel_futures=True)  # without its thread, Python's end would race with that one's


@contextmanager
def _keyboard_unheard() -> Iterator[None]:
    """Processes that are started meanwhile have SIGINT blocked; a SIGINT to this one comes afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """In each of the processes: end when the one that started it has ended, though it could not say so."""

    def watch() -> None:
        parent_process().join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
