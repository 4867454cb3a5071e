"""SIGINT and SIGTERM end a node with exit code 0, whenever they come and however many; the first one is the reason.

This module imports hardly anything: handlers are to be there before all that takes long to import.
"""

from __future__ import annotations

import os
import signal
from queue import SimpleQueue

TYPE_CHECKING = False
if TYPE_CHECKING:  # what checkers of types take for true, without an import of milliseconds
    from types import FrameType

NUMBERS = (signal.SIGINT, signal.SIGTERM)
STANDARD_ERROR = 2
"""Its descriptor."""


class Stop:
    """Set when a node is to end, by any thread or by a handler of signals.

    A handler may interrupt `set` and `wait` anywhere, even one that was called by another handler. A
    `threading.Event` holds a lock in both, and would wait for itself; putting into a `SimpleQueue` is reentrant.

    Attributes
    ----------
    reason : str
        Why, if a signal asked for it, such as ``ended by SIGINT``; else empty.
    """

    def __init__(self) -> None:
        self.reason = ""
        self._asked = False
        self._calls: SimpleQueue[None] = SimpleQueue()

    def set(self) -> None:
        """Have `wait` return, now and always."""
        self._asked = True
        self._calls.put(None)

    def is_set(self) -> bool:
        """Whether the node is to end."""
        return self._asked

    def wait(self) -> None:
        """Return as soon as it is set."""
        self._calls.get()
        self._calls.put(None)  # for whoever waits next


class Signals:
    """The handlers of a process that is one node. Until `take` is called a signal ends the process at once.

    Parameters
    ----------
    executable : str
        Begins what is said then.
    """

    def __init__(self, executable: str):
        self._executable = executable
        self._stop: Stop | None = None
        for number in NUMBERS:
            signal.signal(number, self._handle)

    def take(self) -> Stop:
        """From now on a signal sets what is returned, and does nothing else."""
        self._stop = Stop()
        return self._stop

    def end(self) -> None:
        """Heed no more signals: the process ends by itself. Handlers in Python would be gone before it has ended."""
        for number in NUMBERS:
            signal.signal(number, signal.SIG_IGN)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        reason = f"ended by {signal.Signals(number).name}"
        if self._stop is None:
            # An exception might be caught by what is being imported; there is nothing yet to be closed.
            os.write(STANDARD_ERROR, f"{self._executable}: {reason}, before there was a node\n".encode())
            os._exit(0)
        self._stop.reason = self._stop.reason or reason
        self._stop.set()
