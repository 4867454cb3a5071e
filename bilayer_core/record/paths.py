"""Output files, refused before a simulation starts rather than after it."""

from __future__ import annotations

import os
from pathlib import Path

from bilayer_core.errors import InputError


def check_output_path(path: str | Path, force: bool = False) -> Path:
    """The path of a file that can be written now: its directory exists and is writable, and it is not there yet.

    Parameters
    ----------
    path : str or Path
    force : bool
        Allow a file that exists; it will be replaced.

    Raises
    ------
    InputError
        Names the path, what is wrong with it, and the remedy.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written: there is no directory {path.parent}")
    if path.is_dir():
        raise InputError(f"{path}: cannot be written: it is a directory")
    if path.exists():
        if not force:
            raise InputError(f"{path}: exists already; choose another name, or replace it with --force")
        if not os.access(path, os.W_OK):
            raise InputError(f"{path}: cannot be written: no permission")
    elif not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written: no permission to write in {path.parent.resolve()}")
    return path
