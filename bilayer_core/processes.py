"""Processes beside this one: how many can work at once, and a pool whose processes end with this one in any case."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from typing import Any


def usable_cores() -> int:
    """Return how many cores this process may use; where the system does not tell that, how many the machine has."""
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Pool(ProcessPoolExecutor):
    """Its processes are started where work is handed over, and do not hear Ctrl-C, which is for who started them."""

    def submit(self, *arguments: Any, **named: Any) -> Future:
        with keyboard_unheard():
            return super().submit(*arguments, **named)


@contextmanager
def side_by_side(count: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of as many processes; those that still work when the block ends, or raises, are ended."""
    before = set(active_children())
    with _Pool(count, mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
        try:
            yield pool
        finally:
            for process in set(active_children()) - before:
                process.terminate()
            pool.shutdown(wait=True, cancel_futures=True)  # without its thread, Python's end would race with that one's


@contextmanager
def keyboard_unheard() -> Iterator[None]:
    """Block SIGINT in threads and processes that are started meanwhile; a SIGINT to this thread comes afterwards.

    Windows cannot block it: processes of its console all hear Ctrl-C.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    get_context("spawn").Lock()  # starts Python's tracker of resources, which would unblock the signal later
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
