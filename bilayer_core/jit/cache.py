"""Where compiled code is kept: a folder named by the content of everything that can be compiled into it.

numba looks at the file of the function that it compiled, not at those of the functions that this calls. So the folder's
name is a fingerprint of every source that holds kernels, of numba, llvmlite, numpy and Python, of numba's settings, and
of the processor: after an edit or an update the folder is another, and nothing of yesterday's code runs.

The folders are in ``NUMBA_CACHE_DIR`` or else in the user's cache directory; those that no process has used for
`DAYS_KEPT` days are deleted. A folder that other users could put files into is neither read nor written.
``BILAYER_JIT_CACHE=0`` keeps nothing.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from platformdirs import user_cache_path

from bilayer_core.errors import OutputError
from bilayer_core.jit.private_folder import exposure, make_private

PACKAGE = Path(__file__).resolve().parents[1]
FOLDERS = ("jit", "kinematics", "contact", "scene", "model", "forces", "engine")
"""Of the package: all that hold kernels (a test looks for others)."""
CACHE_DIR = "NUMBA_CACHE_DIR"
DAYS_KEPT = 30
DAY = 86400.0
USED = "used"
"""Name of an empty file in each folder, touched by who uses it."""
_lock = threading.RLock()
_log = logging.getLogger(__name__)


@cache
def fingerprint() -> str:
    """Return a hash of everything that compiled code depends on."""
    digest = hashlib.blake2b(digest_size=12)
    settings = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_") and item[0] != CACHE_DIR)
    settings.append(("BILAYER_JIT_PUBLIC", os.environ.get("BILAYER_JIT_PUBLIC", "0")))
    target = llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten()
    versions = sys.version, numba.__version__, llvmlite.__version__, np.__version__
    digest.update(repr((versions, target, settings)).encode())
    for folder in FOLDERS:
        for path in sorted((PACKAGE / folder).rglob("*.py")):
            digest.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


@cache
def cache_folder() -> Path | None:
    """Return the folder for what this process compiles; None if nothing is kept, with a warning that says why."""
    if os.environ.get("BILAYER_JIT_CACHE", "1") == "0":
        return None
    root = Path(os.environ.get(CACHE_DIR) or user_cache_path("bilayer_core", appauthor=False))
    try:
        folder = make_private(root / f"kernels-{fingerprint()}")
        if reason := exposure(folder, PACKAGE):
            _log.warning(
                "every process compiles its kernels again, since their cache is not safe to read: %s, and who writes "
                "there can run programs as you; set %s to a folder that only you can write to",
                reason,
                CACHE_DIR,
            )
            return None
        (folder / USED).touch()
    except OSError as error:
        _log.warning(
            "compiled kernels cannot be kept (%s), so every start compiles them again: "
            "set NUMBA_CACHE_DIR to a directory that can be written to",
            error,
        )
        return None
    _delete_unused(folder.parent)
    return folder


def _delete_unused(root: Path) -> None:
    """Delete folders of other fingerprints that nobody has used for long."""
    oldest = time.time() - DAYS_KEPT * DAY
    for other in root.glob("kernels-*"):
        try:
            unused = (other / USED).stat().st_mtime < oldest
        except OSError:  # in use by another version, or of another user
            continue
        if unused:
            shutil.rmtree(other, ignore_errors=True)


@contextmanager
def cached() -> Iterator[None]:
    """Let numba keep in the folder what is decorated meanwhile; its own setting is restored.

    Raises
    ------
    OutputError
        If what is compiled meanwhile cannot be kept.
    """
    folder = cache_folder()
    if folder is None:
        yield
        return
    with _lock:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(folder)
        try:
            yield
        except OSError as error:
            raise OutputError(
                f"{folder}: compiled kernels cannot be kept: {error.strerror or error}; set {CACHE_DIR} to a directory "
                "with room for them, or BILAYER_JIT_CACHE=0 to keep none"
            ) from error
        finally:
            numba.config.CACHE_DIR = before
