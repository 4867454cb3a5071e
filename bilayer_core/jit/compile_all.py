"""Compile pieces ahead of time, in two processes where there are two cores.

`make install` compiles all, and the first run of a scene those that it can reach.
"""

from __future__ import annotations

import logging
import os
import queue
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from bilayer_core.errors import OutputError
from bilayer_core.jit import library
from bilayer_core.jit.cache import cache_folder, fingerprint, holds, keep, kept
from bilayer_core.jit.piece import PIECES, Piece

COMPLETE = "complete-{}"
"""Name of the file in the folder that says that all pieces are there for the present sources."""
_log = logging.getLogger(__name__)
PACKAGES = Path(__file__).resolve().parents[2]
PACKAGE = "bilayer_core"
WORKER = f"{PACKAGE}.jit.worker"
ENGINE = f"{PACKAGE}.engine"
"""Module that imports all that declare pieces."""


def is_complete() -> bool:
    """Return whether the library or the cache holds all pieces, or nothing is kept at all."""
    return library.is_in_use() or cache_folder() is None or kept(COMPLETE.format(fingerprint())) is not None


def ensure_compiled(
    report: Callable[[int, int], None] | None = None, needed: Callable[[], Collection[str]] | None = None
) -> None:
    """Compile pieces that the cache lacks; ``BILAYER_JIT_AHEAD=0``: those that are called, when they are.

    Parameters
    ----------
    report : callable, optional
        As for `compile_all`; without one, the log says what happens.
    needed : callable, optional
        Returns the names of pieces that a scene can reach (`engine.needed_pieces`); all others wait until something
        calls them. Default: all.

    Raises
    ------
    OutputError
        If what is compiled cannot be kept.
    RuntimeError
        If one cannot be compiled; the message has what the process printed.
    """
    if os.environ.get("BILAYER_JIT_AHEAD", "1") == "0" or is_complete():
        return
    names = _missing(None if needed is None else needed())
    if names and report is None:
        _log.warning("compiling kernels, once for this version on this machine: one to three minutes")
    _compile(names, report)
    if needed is None:
        keep(COMPLETE.format(fingerprint()), b"")


def compile_all(report: Callable[[int, int], None] | None = None) -> int:
    """Compile all pieces that the cache lacks and keep them; return how many these are.

    `report`: called with the number of pieces compiled so far, and that of all. Raises OutputError if what is compiled
    cannot be kept. Raises RuntimeError if one cannot be compiled; the message has what the process printed.
    """
    if cache_folder() is None:
        return 0
    names = _missing(None)
    _compile(names, report)
    keep(COMPLETE.format(fingerprint()), b"")
    return len(names)


def _missing(needed: Collection[str] | None) -> list[str]:
    """Return the names of pieces that the cache lacks, in the order of their declaration."""
    import_module(ENGINE)
    asked = [piece for piece in own_pieces() if needed is None or piece.name in needed]
    return [piece.name for piece in asked if not holds(piece.file)]


def _compile(names: list[str], report: Callable[[int, int], None] | None) -> None:
    """Compile pieces in as many processes as there are cores for.

    One takes them from the front and one from the back: neighbours have kernels in common, which each process compiles
    for itself.
    """
    from bilayer_core.processes import usable_cores

    left = deque(names)
    done: queue.SimpleQueue[str | Exception] = queue.SimpleQueue()
    workers = [_Worker(take, done) for take in (left.popleft, left.pop)[: min(usable_cores(), len(names))]]
    try:
        for worker in workers:
            worker.start()
        for count in range(len(names)):
            if report is not None:
                report(count, len(names))
            if isinstance(found := done.get(), Exception):
                raise found
        for worker in workers:
            worker.join()
    finally:
        for worker in workers:
            worker.end()
    if names and report is not None:
        report(len(names), len(names))


def own_pieces() -> list[Piece]:
    """Return the pieces of this package that are declared."""
    return [piece for piece in PIECES.values() if piece.function.__module__.startswith(f"{PACKAGE}.")]


class _Worker(threading.Thread):
    """A process that compiles what is left, and the thread that hands it name by name."""

    def __init__(self, take: Callable[[], str], done: queue.SimpleQueue[str | Exception]):
        super().__init__(daemon=True)
        self._take, self._done = take, done
        self._process: subprocess.Popen | None = None
        self._ended = False

    def run(self) -> None:
        """Let the process compile until nothing is left or something fails; `done` takes each name, or the failure."""
        path = os.pathsep.join([str(PACKAGES), *filter(None, [os.environ.get("PYTHONPATH")])])
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", WORKER],  # -P: not what has the package's name in the present folder
            env=os.environ | {"PYTHONPATH": path},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is for the process that started it, and ends both
        )
        if self._ended:
            self._process.terminate()
        with suppress(BrokenPipeError), self._process as process:  # one that was ended reads no more
            while (name := self._next()) is not None:
                try:
                    print(name, file=process.stdin, flush=True)
                    answer = process.stdout.readline().strip()
                except OSError:
                    answer = ""
                if answer != name:
                    self._done.put(self._failure(process))
                    return
                self._done.put(name)
            process.stdin.close()

    def end(self) -> None:
        """End the process, whatever it is at."""
        self._ended = True
        if self._process is not None:
            self._process.terminate()

    def _next(self) -> str | None:
        try:
            return self._take()
        except IndexError:
            return None

    @staticmethod
    def _failure(process: subprocess.Popen) -> Exception:
        printed = process.stderr.read()
        if process.wait() == OutputError.exit_code:
            return OutputError(printed.strip())
        return RuntimeError(f"kernels cannot be compiled:\n{printed}")


def main() -> None:
    """Compile all pieces, and say so: what `make install` runs."""
    begin = time.perf_counter()
    if library.is_in_use():
        raise SystemExit(f"{library.LIBRARY} holds all kernels: there is nothing to compile")
    if cache_folder() is None:
        raise SystemExit("kernels are not kept on this machine: there is nothing to compile ahead of time")
    if not is_complete():
        bar = sys.stderr.isatty()
        print("compiling kernels, once for this version on this machine ...", flush=True)
        count = compile_all(
            (lambda done, total: print(f"\r{done} of {total}", end="", file=sys.stderr)) if bar else None
        )
        print(f"{count} pieces compiled in {time.perf_counter() - begin:.0f} s: {cache_folder()}")


if __name__ == "__main__":
    main()
