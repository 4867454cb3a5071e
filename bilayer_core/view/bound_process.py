"""A program that ends when this process does, however that ends.

Between both is a keeper: this file, run as a program. Its standard input is a pipe that nobody writes to. The system
closes it with the process that holds the other end, on every platform, and then the keeper ends its program.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence

EXIT_LIMIT = 5.0  # longest wait for the program to end before it is killed [s]


class BoundProcess:
    """A program in a process of its own, which Ctrl-C does not reach.

    `command`: the program and its arguments. `environment`: its environment variables.
    """

    def __init__(self, command: Sequence[str], environment: dict[str, str]):
        self._output = tempfile.TemporaryFile()
        self._keeper = subprocess.Popen(
            [sys.executable, "-I", __file__, *command],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    @property
    def exit_code(self) -> int | None:
        """Exit code of the program, None while it runs."""
        return self._keeper.poll()

    def said(self) -> str:
        """Return what it has written so far."""
        self._output.seek(0)
        return self._output.read().decode(errors="replace").strip()

    def end(self) -> None:
        """End the program, and wait until it has ended."""
        self._keeper.stdin.close()
        self._keeper.wait()
        self._output.close()


def keep(command: Sequence[str]) -> int:
    """Run a program until it ends, or standard input does; return its exit code."""
    program = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    threading.Thread(target=_end_with_input, args=(program,), daemon=True).start()
    return program.wait()


def _end_with_input(program: subprocess.Popen) -> None:
    os.read(0, 1)  # a lock of sys.stdin would be held when the interpreter ends
    program.terminate()
    try:
        program.wait(EXIT_LIMIT)
    except subprocess.TimeoutExpired:
        program.kill()


if __name__ == "__main__":
    sys.exit(keep(sys.argv[1:]))
