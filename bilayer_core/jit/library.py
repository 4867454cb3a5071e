"""The engine ahead of time: a shared library with all pieces, which wheels of a platform carry (`build_library`).

Its slots hold the addresses of its pieces from the start. With it is a text: hashes of the sources, the target and the
versions of what compiled them. Where one of these does not fit, pieces are compiled as in a checkout, and the log says
why.
"""

from __future__ import annotations

import ctypes
import json
import logging
import os
import platform
from functools import cache
from pathlib import Path
from typing import Any

from bilayer_core.jit.cache import PACKAGE, sources
from bilayer_core.jit.called import slot_of
from bilayer_core.jit.digest import CACHE_DIR, CalledByName
from bilayer_core.jit.target import BASELINE, compilers, reaches_baseline, target

LIBRARY = Path(__file__).with_name("engine.so")
FACTS = LIBRARY.with_suffix(".json")
"""The text beside it."""
_log = logging.getLogger(__name__)


def facts() -> dict[str, Any]:
    """Return what the text of a library that is compiled now says."""
    versions = compilers() | {"python": platform.python_version()}
    return {"target": target()[0], "versions": versions, "sources": sources()}


@cache
def recorded() -> dict[str, Any] | None:
    """Return the text of the library that is in use; None if there is none, or it does not fit."""
    try:
        found = json.loads(FACTS.read_text(encoding="utf-8"))
    except OSError:  # a checkout
        return None
    if reason := _misfit(found):
        _log.warning("kernels are compiled, since the library that was installed does not fit: %s", reason)
        return None
    return found


def _misfit(found: dict[str, Any]) -> str:
    """Return why a library cannot be used; empty if it can."""
    if not reaches_baseline():
        return f"this processor, {target()[0]}, is below {BASELINE}"
    settings = sorted(name for name in os.environ if name.startswith("NUMBA_") and name != CACHE_DIR)
    if os.environ.get("BILAYER_JIT_PUBLIC", "0") != "0":
        settings.append("BILAYER_JIT_PUBLIC")
    if settings:
        return f"{settings[0]} is set"
    if target()[0] != found["target"]:
        return f"it is for {found['target']}, and code for {target()[0]} is wanted"
    then, now = found["sources"], sources()
    for name in sorted(then.keys() | now.keys()):
        if then.get(name) != now.get(name):
            return f"{PACKAGE / name} is not as it was when the library was compiled"
    return ""


@cache
def _library() -> ctypes.CDLL | None:
    if recorded() is None:
        return None
    try:
        return ctypes.CDLL(str(LIBRARY))
    except OSError as error:
        _log.warning("kernels are compiled, since the library that was installed cannot be loaded: %s", error)
        recorded.cache_clear()
        return None


def is_in_use() -> bool:
    """Return whether all pieces come from the library."""
    return _library() is not None


def slot_of_piece(piece: CalledByName) -> ctypes.c_int64 | None:
    """Return the word of the library that holds the address of a piece of this package; None if there is none."""
    if not piece.function.__module__.startswith(f"{PACKAGE.name}.") or not is_in_use():
        return None
    return ctypes.c_int64.in_dll(_library(), slot_of(piece.name))


def origin() -> dict[str, str]:
    """Return what last digits depend on: the target, the compiler of the engine, and the library of functions."""
    found = (recorded() if is_in_use() else None) or facts()
    compiler = ", ".join(f"{name} {found['versions'][name]}" for name in compilers())
    return {
        "target": found["target"],
        "compiler": compiler,
        "libm": " ".join(filter(None, platform.libc_ver())) or platform.release(),
    }
