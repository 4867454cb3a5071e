"""Processes beside this one: how many can work at once, and a pool whose processes end with this one in any case."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from typing import Any


def usable_cores() -> int:
    """Return how many cores this process may use; where the system does not tell that, how many the machine has."""
    if sys.version_info >= (3, 13):
        return os.process_cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def side_by_side(
    count: int, tasks_each: int = 0, prepare: Callable[[], None] | None = None
) -> Iterator[Callable[..., Future]]:
    """Yield a function that has others called in as many processes: ``schedule(function, *arguments, timeout=None)``.

    It returns a future; a process that takes longer than the timeout [s] is killed. When the block ends, or raises,
    what still works is ended, and what waits is cancelled. The processes do not hear Ctrl-C, which is for who started
    them.

    `tasks_each`: after which another process takes the place of one; 0 for never. `prepare`: called in each process
    first.
    """
    from pebble import ProcessPool

    pool = ProcessPool(count, tasks_each, _begin, [prepare], get_context("spawn"))
    futures: list[Future] = []

    def schedule(function: Callable, *arguments: Any, timeout: float | None = None) -> Future:
        futures[:] = [future for future in futures if not future.done()]
        futures.append(pool.schedule(function, arguments, timeout=timeout))
        return futures[-1]

    try:
        with keyboard_unheard():  # by the processes, and by the threads that start more of them
            schedule(_nothing)
        yield schedule
    finally:
        for future in futures:
            future.cancel()
        pool.stop()
        pool.join()


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


def _nothing() -> None:
    """Do nothing: the first task starts the processes."""


def _begin(prepare: Callable[[], None] | None) -> None:
    """End this process, one of a pool, when the one that started it has ended, though it could not say so."""

    def watch() -> None:
        parent_process().join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    if prepare is not None:
        prepare()
