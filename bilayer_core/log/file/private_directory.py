"""Directories of one process: drafts of outputs beside their targets, and files that nobody needs afterwards.

A directory has mode 0700 and a name that cannot be guessed, so no other user can put a link or a file into it. Its
process holds a lock in it. A process that was killed leaves its directory behind, and the next process that makes one
in the same place removes it. A directory counts as left behind

- if its lock is free, its content has been begun, and it was made on this machine; or
- if nothing in it has changed for a day: on a network drive, locks of other machines may not be visible.

Directories of other users, and those without the lock file, are never touched: whoever may rename what is beside a
draft could otherwise have any directory removed.
"""

from __future__ import annotations

import os
import re
import shutil
import socket
import tempfile
import time as clock
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bilayer_core.log.file.lock import try_lock

PREFIX = ".bilayer-draft-"
LOCK, CONTENT = "bilayer-draft.lock", "content"
OLD = 86400.0
"""Time without a change after which a directory is removed although its lock says nothing [s]."""
_NAME = re.compile(re.escape(PREFIX) + r"([0-9a-f]{8})-[a-z0-9_]{8}")


@contextmanager
def private_directory(parent: str | Path | None = None) -> Iterator[Path]:
    """Make an empty directory that only this user can enter, and remove it with its content when the block ends.

    `parent`: by default the directory of the system for temporary files. Raises OSError if it cannot be made.
    """
    parent = tempfile.gettempdir() if parent is None else parent
    _remove_leftovers(parent)
    directory = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{_machine()}-", dir=parent))
    try:
        with (directory / LOCK).open("xb") as file:
            try_lock(file)
            content = directory / CONTENT
            content.mkdir()  # from now on, a free lock means that the process has ended
            yield content
    finally:
        shutil.rmtree(directory, ignore_errors=True)


def _machine() -> str:
    """Return eight digits that stand for the name of this machine."""
    return f"{zlib.crc32(socket.gethostname().encode()):08x}"


def _remove_leftovers(parent: str | Path) -> None:
    """Remove what killed processes of this user left in a directory."""
    with suppress(OSError), os.scandir(parent) as entries:
        for entry in entries:
            found = _NAME.fullmatch(entry.name)
            if found and entry.is_dir(follow_symlinks=False):
                with suppress(OSError):  # of another user, or removed meanwhile
                    _remove_if_left(Path(entry.path), found[1] == _machine())


def _remove_if_left(directory: Path, made_here: bool) -> None:
    lock = os.open(directory / LOCK, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    with os.fdopen(lock, "r+b") as file:
        if os.fstat(lock).st_uid != directory.lstat().st_uid or not _is_own(directory):
            return
        locked = try_lock(file)
        if locked is False:
            return
        ended = locked and made_here and (directory / CONTENT).is_dir()
        newest = max(path.lstat().st_mtime for path in (directory, *directory.rglob("*")))
        if ended or clock.time() - newest > OLD:
            shutil.rmtree(directory, ignore_errors=True)


def _is_own(directory: Path) -> bool:
    """Return whether a directory is of this user; on systems without user numbers it is."""
    return not hasattr(os, "geteuid") or directory.lstat().st_uid == os.geteuid()
