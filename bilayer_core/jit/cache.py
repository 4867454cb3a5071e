"""Where machine code is kept: a folder of object files, each named by its piece and by the digest of the piece.

So an edit compiles the pieces that it changes, an update of numba all, and nothing of yesterday's code runs.

The folder is in ``NUMBA_CACHE_DIR`` or else in the user's cache directory; files that no process has used for
`DAYS_KEPT` days are deleted. A folder that other users could put files into is neither read nor written.
``BILAYER_JIT_CACHE=0`` keeps nothing.
"""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
import time
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

from bilayer_core.errors import OutputError
from bilayer_core.jit.digest import CACHE_DIR, settings
from bilayer_core.jit.private_folder import exposure, make_private

PACKAGE = Path(__file__).resolve().parents[1]
FOLDERS = ("jit", "kinematics", "contact", "scene", "model", "forces", "engine")
"""Of the package: all that hold kernels (a test looks for others)."""
KERNELS = "kernels"
"""Name of the folder."""
DAYS_KEPT = 30
DAY = 86400.0
_log = logging.getLogger(__name__)


@cache
def sources() -> dict[str, str]:
    """Return a hash of every source that can be compiled in, by its path in the package."""
    paths = sorted(path for folder in FOLDERS for path in (PACKAGE / folder).rglob("*.py"))
    return {path.relative_to(PACKAGE).as_posix(): hash_of(path.read_bytes()) for path in paths}


def hash_of(content: bytes) -> str:
    """Return a hash of some bytes."""
    return hashlib.blake2b(content, digest_size=12).hexdigest()


@cache
def fingerprint() -> str:
    """Return a hash of everything that machine code depends on: sources, versions, settings and the target."""
    return hash_of(settings() + repr(sources()).encode())


@cache
def cache_folder() -> Path | None:
    """Return the folder for what this process compiles; None if nothing is kept, with a warning that says why."""
    if os.environ.get("BILAYER_JIT_CACHE", "1") == "0":
        return None
    root = Path(os.environ.get(CACHE_DIR) or user_cache_path("bilayer_core", appauthor=False))
    try:
        folder = make_private(root / KERNELS)
        if reason := exposure(folder, PACKAGE):
            _log.warning(
                "every process compiles its kernels again, since their cache is not safe to read: %s, and who writes "
                "there can run programs as you; set %s to a folder that only you can write to",
                reason,
                CACHE_DIR,
            )
            return None
        _probe(folder)
    except OSError as error:
        _log.warning(
            "compiled kernels cannot be kept (%s), so every start compiles them again: "
            "set NUMBA_CACHE_DIR to a directory that can be written to",
            error,
        )
        return None
    _delete_unused(folder)
    return folder


def _probe(folder: Path) -> None:
    """Raise OSError if files cannot be made there."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def _delete_unused(folder: Path) -> None:
    """Delete files that nobody has used for long."""
    oldest = time.time() - DAYS_KEPT * DAY
    for path in folder.iterdir():
        try:
            if path.stat().st_mtime < oldest:
                path.unlink()
        except OSError:  # another process was faster
            continue


def kept(name: str) -> bytes | None:
    """Return the content of a file in the folder, and note that it is in use; None if it is not there."""
    folder = cache_folder()
    if folder is None:
        return None
    path = folder / name
    try:
        content = path.read_bytes()
        if time.time() - path.stat().st_mtime > DAY:
            path.touch()
    except OSError:
        return None
    return content


def holds(name: str) -> bool:
    """Return whether a file is in the folder."""
    folder = cache_folder()
    return folder is not None and (folder / name).exists()


def keep(name: str, content: bytes) -> None:
    """Put a file into the folder, whole or not at all. Raises OutputError if it cannot be kept."""
    folder = cache_folder()
    if folder is None:
        return
    try:
        handle, draft = tempfile.mkstemp(dir=folder, suffix=".draft")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            os.replace(draft, folder / name)
        except BaseException:
            os.unlink(draft)
            raise
    except OSError as error:
        raise OutputError(
            f"{folder}: compiled kernels cannot be kept: {error.strerror or error}; set {CACHE_DIR} to a directory "
            "with room for them, or BILAYER_JIT_CACHE=0 to keep none"
        ) from error


def forget(name: str) -> None:
    """Delete a file that is damaged."""
    folder = cache_folder()
    if folder is not None:
        (folder / name).unlink(missing_ok=True)
