"""Compile all pieces ahead of time, in two processes where there are two cores.

`make install` does so, and so does the first simulation after an update.
"""

from __future__ import annotations

import logging
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from .cache import cache_folder
from .piece import PIECES

COMPLETE = "complete"
"""Name of an empty file in the folder in which all pieces are."""
MOST_PROCESSES = 2
_log = logging.getLogger(__name__)
PACKAGES = Path(__file__).resolve().parents[2]
PACKAGE = "bilayer_core"
WORKER = f"{PACKAGE}.jit.worker"
ENGINE = f"{PACKAGE}.engine"
"""Module that imports all that declare pieces."""
LONGEST = {
    "near_pairs",
    "minimise_potential",
    "make_step",
    "add_bending",
    "assemble_bodies",
    "adapt",
    "take_rod_contacts",
}
"""Pieces that take longest to compile, and so come first."""


def is_complete() -> bool:
    """Whether all pieces are in the cache, or nothing is kept at all."""
    folder = cache_folder()
    return folder is None or (folder / COMPLETE).exists()


def ensure_compiled(report: Callable[[int, int], None] | None = None) -> None:
    """Compile all pieces if that was not done since the sources changed; ``BILAYER_JIT_AHEAD=0``: those needed, when
    they are.

    Parameters
    ----------
    report : callable, optional
        As for `compile_all`; without one, the log says what happens.
    """
    if os.environ.get("BILAYER_JIT_AHEAD", "1") == "0" or is_complete():
        return
    if report is None:
        _log.warning("compiling all kernels, once for this version on this machine: about a minute")
    compile_all(report)


def compile_all(report: Callable[[int, int], None] | None = None) -> None:
    """Compile all pieces and keep them.

    Parameters
    ----------
    report : callable, optional
        Called with the number of pieces compiled so far, and that of all.

    Raises
    ------
    RuntimeError
        If one cannot be compiled; the message has what the process printed.
    """
    folder = cache_folder()
    if folder is None:
        return
    import_module(ENGINE)
    own = [name for name, piece in PIECES.items() if piece.function.__module__.startswith(f"{PACKAGE}.")]
    names = sorted(own, key=lambda name: name not in LONGEST)
    left: queue.SimpleQueue[str] = queue.SimpleQueue()
    for name in names:
        left.put(name)
    done, printed = queue.SimpleQueue(), []
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = [
        threading.Thread(target=_feed, args=(left, done, printed), daemon=True)
        for _ in range(min(MOST_PROCESSES, cores))
    ]
    for worker in workers:
        worker.start()
    for count in range(len(names)):
        if report is not None:
            report(count, len(names))
        if done.get() is None:
            raise RuntimeError("kernels cannot be compiled:\n" + "\n".join(printed))
    for worker in workers:
        worker.join()
    if report is not None:
        report(len(names), len(names))
    (folder / COMPLETE).touch()


def _feed(left: queue.SimpleQueue, done: queue.SimpleQueue, printed: list[str]) -> None:
    """Have one process compile what is left, name by name."""
    path = os.pathsep.join([str(PACKAGES), *filter(None, [os.environ.get("PYTHONPATH")])])
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", WORKER],  # -P: not what has the package's name in the present folder
        env=os.environ | {"PYTHONPATH": path},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        while True:
            try:
                name = left.get_nowait()
            except queue.Empty:
                process.stdin.close()
                return
            process.stdin.write(name + "\n")
            process.stdin.flush()
            if process.stdout.readline().strip() != name:
                printed.append(process.stderr.read())
                done.put(None)
                return
            done.put(name)


def main() -> None:
    """Compile all pieces, and say so: what `make install` runs."""
    begin = time.perf_counter()
    if cache_folder() is None:
        raise SystemExit("kernels are not kept on this machine: there is nothing to compile ahead of time")
    if not is_complete():
        bar = sys.stderr.isatty()
        print("compiling kernels, once for this version on this machine ...", flush=True)
        compile_all((lambda done, total: print(f"\r{done} of {total}", end="", file=sys.stderr)) if bar else None)
        print(f"{len(PIECES)} pieces compiled in {time.perf_counter() - begin:.0f} s: {cache_folder()}")


if __name__ == "__main__":
    main()
