"""Requests of other threads to the one that simulates, or plays."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from bilayer_core.errors import InputError

Action = Callable[[Future], None]
"""Does what is asked and sets the future's result, at once or later."""


def answered(value: Any) -> Future:
    """Return a future that has its result already."""
    future: Future = Future()
    future.set_result(value)
    return future


class Requests:
    """Requests in the order in which they came; any thread asks, one serves.

    `ended`: the answer to requests that come too late.
    """

    def __init__(self, ended: str = "the simulation has ended"):
        self._ended = ended
        self._queue: queue.SimpleQueue[tuple[Future, Action] | None] = queue.SimpleQueue()
        self._closed = threading.Event()

    def ask(self, action: Action) -> Future:
        """Ask for `action` to be done. The future's result says what happened; InputError if it could not be done."""
        future: Future = Future()
        self._queue.put((future, action))
        if self._closed.is_set():
            self._refuse()
        return future

    def wake(self) -> None:
        """End the wait of the thread that serves."""
        self._queue.put(None)

    def serve(self, wait: float) -> bool:
        """Serve one request or be woken, after at most `wait` [s]; whether anything came."""
        try:
            request = self._queue.get(timeout=wait) if wait > 0.0 else self._queue.get_nowait()
        except queue.Empty:
            return False
        if request is not None:
            future, action = request
            try:
                action(future)
            except Exception as error:
                future.set_exception(error)
                if not isinstance(error, InputError):
                    raise
        return True

    def close(self) -> None:
        """Refuse all that nobody will do any more."""
        self._closed.set()
        self._refuse()

    def _refuse(self) -> None:
        while True:
            try:
                request = self._queue.get_nowait()
            except queue.Empty:
                return
            if request is not None:
                request[0].set_exception(InputError(self._ended))
