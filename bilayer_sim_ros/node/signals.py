"""SIGINT and SIGTERM end a node with exit code 0, whenever they come and however many; the first one is the reason.

This module imports hardly anything: handlers are to be there before all that takes long to import.
"""

from __future__ import annotations

import os
import signal

TYPE_CHECKING = False
if TYPE_CHECKING:  # what checkers of types take for true, without an import of milliseconds
    from types import FrameType

NUMBERS = (signal.SIGINT, signal.SIGTERM)
STANDARD_ERROR = 2
"""Its descriptor."""


class Stop:
    """Set when a node is to end, by any thread or by a handler of signals.

    A handler may interrupt `set` and `wait` anywhere, even one that was called by another handler, so neither may hold
    a lock, as those of `threading.Event` do. Nor may `wait` wait for one: the system hands a signal to any thread, but
    Python calls handlers in the main thread alone, and then nothing wakes it from a lock. So it waits for bytes in a
    pipe, into which Python writes one for each signal, from whichever thread; see `Signals.take`.

    Attributes
    ----------
    reason : str
        Why, if a signal asked for it, such as ``ended by SIGINT``; else empty.
    wakes : int
        Descriptor of a file, never blocking: whatever is written to it has `wait` look again.
    """

    def __init__(self) -> None:
        self.reason = ""
        self._asked = False
        self._woken, self.wakes = os.pipe()
        os.set_blocking(self.wakes, False)

    def __del__(self) -> None:
        os.close(self._woken)
        os.close(self.wakes)

    def set(self) -> None:
        """Let `wait` return, now and always."""
        self._asked = True
        self._wake()

    def is_set(self) -> bool:
        """Return whether the node is to end."""
        return self._asked

    def wait(self) -> None:
        """Return as soon as it is set."""
        while not self._asked:
            os.read(self._woken, 1)
        self._wake()  # whoever else waits

    def _wake(self) -> None:
        try:
            os.write(self.wakes, b"\0")
        except BlockingIOError:
            return  # the pipe is full of bytes that will wake


class Signals:
    """The handlers of a process that is one node. Until `take` is called a signal ends the process at once.

    `executable`: the name with which its messages begin.
    """

    def __init__(self, executable: str):
        self._executable = executable
        self._stop: Stop | None = None
        for number in NUMBERS:
            signal.signal(number, self._handle)

    def take(self) -> Stop:
        """Take signals over: from now on one sets what is returned, and does nothing else."""
        self._stop = Stop()
        signal.set_wakeup_fd(self._stop.wakes, warn_on_full_buffer=False)
        return self._stop

    def end(self) -> None:
        """Ignore further signals: the process ends by itself. Handlers in Python would be gone before it has ended."""
        for number in NUMBERS:
            signal.signal(number, signal.SIG_IGN)
        signal.set_wakeup_fd(-1)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        reason = f"ended by {signal.Signals(number).name}"
        if self._stop is None:
            # An exception might be caught by what is being imported; there is nothing yet to be closed.
            os.write(STANDARD_ERROR, f"{self._executable}: {reason}, before there was a node\n".encode())
            os._exit(0)
        self._stop.reason = self._stop.reason or reason
        self._stop.set()
