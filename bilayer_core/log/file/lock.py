"""One writer for each file: it holds a lock, which ends with its process, however that ends."""

from __future__ import annotations

import logging
import os
import stat
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

from bilayer_core.errors import InputError

try:
    import fcntl
except ImportError:  # Windows: nothing is locked, and a second writer is not noticed
    fcntl = None

_log = logging.getLogger(__name__)


def open_alone(path: Path, force: bool) -> BinaryIO:
    """Open a file for writing that no other program writes; it is empty then.

    `force`: replace what is there. Raises InputError if another program is writing the file, which stays as it is.
    Raises OSError if it cannot be opened, or is there without `force`.
    """
    with ExitStack() as refused:
        file = refused.enter_context(open(path, "wb" if force else "xb", opener=_without_emptying))
        _lock(file, path)
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            file.truncate(0)
        refused.pop_all()
    return file


def refuse_file_in_use(path: Path) -> None:
    """Raise InputError if another program is writing a file; one that is not there or cannot be opened is passed."""
    if not path.is_file():
        return
    try:
        file = path.open("r+b")
    except OSError:
        return
    with file:
        _lock(file, path)


def _without_emptying(path: str, flags: int) -> int:
    return os.open(path, flags & ~os.O_TRUNC, 0o666)


def _lock(file: BinaryIO, path: Path) -> None:
    """Lock a file until it is closed."""
    locked = try_lock(file)
    if locked is False:
        raise InputError(f"{path}: another program is writing it; wait for its end, or choose another name")
    if locked is None and fcntl is not None:
        _log.warning("%s: cannot be locked, so a second writer would not be noticed", path)


def try_lock(file: BinaryIO) -> bool | None:
    """Lock an open file until it is closed, without waiting.

    Returns whether this process has the lock now; None if the file system or the operating system has no locks.
    """
    if fcntl is None:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True
