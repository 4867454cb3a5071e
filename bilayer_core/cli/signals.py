"""Signals that ask the program to end, Ctrl-C and SIGTERM: one line and an exit code, whenever they come.

The first one raises an exception, so that files are closed, drafts are removed and other processes are ended; the next
one ends the process at once. This module imports hardly anything, so that it can be imported before all others.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:  # what checkers of types take for true, without an import of milliseconds
    from types import FrameType
    from typing import Any, NoReturn

WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "ended by SIGTERM"}
"""What the line says, by the number of the signal."""
STANDARD_ERROR = 2
"""Its descriptor."""
PERIOD = 0.1
"""Between two looks whether other code has caught the exception, as some does that tries what it can import [s]."""
MOST_LOOKS = 50
"""After which the process is ended at once."""


class Interruption(BaseException):
    """A signal asks the program to end.

    It is no `KeyboardInterrupt`: click answers that with an empty line, and Python may end with another exit code even
    where one was caught.
    """

    def __init__(self, number: int):
        super().__init__(WORDS[number])
        self.number = number  # Of the signal
        self.exit_code = 128 + number  # As shells count: 128 and the number of the signal
        self.heeded = False  # Whether who has caught it ends soon; who has not gets it again


def interruption_behind(error: BaseException | None) -> Interruption | None:
    """Return the interruption that led to an exception.

    Python raises a RuntimeError in its place while a class is being created.
    """
    behind, seen = [error], set()
    while behind:
        found = behind.pop()
        if isinstance(found, Interruption):
            return found
        if found is not None and id(found) not in seen:  # one may be behind itself
            seen.add(id(found))
            behind += [found.__context__, found.__cause__]
    return None


class Signals:
    """The handlers of one run of the program.

    `of_process`: the process ends with the program, so signals are heeded until then; otherwise `close` restores what
    was there.
    """

    def __init__(self, of_process: bool):
        self._of_process = of_process
        self._exit_code: int | None = None
        self._interruption: Interruption | None = None
        self._looks = 0
        self._before = {number: signal.getsignal(number) for number in WORDS}
        self._hook = sys.unraisablehook

    def heed(self) -> None:
        """Install the handlers. Signals of a process go to its main thread: elsewhere there is nothing to be done."""
        sys.unraisablehook = self._take_unraisable
        try:
            _handle_by(self._interrupt)
        except ValueError:
            return
        if self._of_process:
            atexit.register(_handle_by, signal.SIG_IGN)  # called last, and Python calls no handlers after that

    def _interrupt(self, number: int, _: FrameType | None) -> None:
        if self._exit_code is not None:
            os._exit(self._exit_code)  # all is done and said
        if self._interruption is not None:
            self._end_at_once()
        self._interruption = Interruption(number)
        if self._of_process and hasattr(signal, "setitimer"):
            signal.signal(signal.SIGALRM, self._look)
            signal.setitimer(signal.ITIMER_REAL, PERIOD, PERIOD)
        raise self._interruption

    def _look(self, *_: object) -> None:
        """Raise the exception again if nobody handles it."""
        if self._interruption.heeded:
            self._stop_looking()
            return
        self._looks += 1
        if self._looks > MOST_LOOKS:
            self._end_at_once()
        if interruption_behind(sys.exc_info()[1]) is None:
            raise self._interruption

    def _stop_looking(self) -> None:
        if self._of_process and self._interruption is not None and hasattr(signal, "setitimer"):
            signal.signal(signal.SIGALRM, signal.SIG_IGN)
            signal.setitimer(signal.ITIMER_REAL, 0.0)

    def behind(self, error: BaseException) -> Interruption | None:
        """Return the interruption that led to an exception, otherwise the last one that was raised.

        Compiled libraries turn interruptions into other exceptions that do not mention them.
        """
        return interruption_behind(error) or self._interruption

    def interrupted(self, interruption: Interruption) -> int:
        """Print the line; return the exit code."""
        _handle_by(signal.SIG_IGN)
        _tell(interruption)
        self.ended(interruption.exit_code)
        _handle_by(self._interrupt)
        return interruption.exit_code

    def ended(self, exit_code: int) -> int:
        """Note that all is done. Returns the exit code, with which a signal from now on ends the process."""
        self._exit_code = exit_code
        self._stop_looking()
        return exit_code

    def close(self) -> None:
        """Restore the handlers that were there, unless the process is about to end."""
        if self._of_process:
            return
        sys.unraisablehook = self._hook
        try:
            for number, handler in self._before.items():
                signal.signal(number, handler)
        except ValueError:
            pass  # as in `heed`

    def _take_unraisable(self, what: sys.UnraisableHookArgs) -> None:
        """End the process if an interruption was raised where Python goes on: in a destructor or a callback from C."""
        if what.exc_type is Interruption:
            self._end_at_once()
        self._hook(what)

    def _end_at_once(self) -> NoReturn:
        _handle_by(signal.SIG_IGN)
        _tell(self._interruption)
        os._exit(self._interruption.exit_code)


def _handle_by(handler: Any) -> None:
    for number in WORDS:
        signal.signal(number, handler)


def _tell(interruption: Interruption) -> None:
    """Write the interruption to standard error past Python's buffers, which may be in use where a signal comes."""
    try:
        os.write(STANDARD_ERROR, f"bilayer: {interruption}\n".encode())
    except OSError:
        pass  # nobody listens
