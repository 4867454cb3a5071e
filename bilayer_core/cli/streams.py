"""Standard output and standard error of the process: closed, full, or read by nobody."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable

from bilayer_core.errors import OutputError


class _Stream(io.FileIO):
    """A standard stream whose failures `on_failure` takes; after one, the rest goes nowhere."""

    def __init__(self, descriptor: int, on_failure: Callable[[OSError], None]):
        super().__init__(descriptor, "w", closefd=False)
        self._on_failure = on_failure

    def write(self, data) -> int:
        """Write bytes; how many were."""
        try:
            return super().write(data)
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            self._on_failure(error)
        return len(data)


def guard_streams() -> None:
    """Let output that cannot be written raise OutputError, and lose messages that cannot be written quietly.

    A reader that goes away raises BrokenPipeError, as ever. Descriptors that are closed are taken, so that no file
    which is opened later gets one and with it what other code prints.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest that is free
    sys.stdout = _guarded(sys.stdout, _refuse)
    sys.stderr = _guarded(sys.stderr, lambda error: None)


def _guarded(stream: io.TextIOWrapper | None, on_failure: Callable[[OSError], None]) -> io.TextIOWrapper:
    if stream is None:  # closed
        return open(os.devnull, "w", encoding="utf-8")
    return io.TextIOWrapper(
        io.BufferedWriter(_Stream(stream.fileno(), on_failure)),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _refuse(error: OSError) -> None:
    if isinstance(error, BrokenPipeError):
        raise error
    raise OutputError(f"standard output: cannot be written: {error.strerror}") from error
