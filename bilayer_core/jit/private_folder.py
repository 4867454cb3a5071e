"""Exposure of a folder: whether other users can put files into it.

The cache holds machine code. Whoever can write to its folder can therefore run programs as the user who reads it.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS_ENTER = stat.S_IXGRP | stat.S_IXOTH


def make_private(folder: Path) -> Path:
    """Make a folder, and those above it that are missing, for this user alone; return its path without links.

    Raises OSError if it cannot be made.
    """
    for path in (*reversed(folder.parents), folder):
        path.mkdir(mode=0o700, exist_ok=True)
    return folder.resolve(strict=True)


def exposure(folder: Path, trusted: Path) -> str:
    """Return how other users could put files into a folder; empty if they cannot.

    The folder, all that is in it and the folders above it must belong to this user or to root. Nobody else may have
    permission to write to the folder or to the one above it; that one may be like ``/tmp``, where nobody can rename the
    files of others. Further up, the user's private group may write as well.

    Parameters
    ----------
    folder : Path
        Absolute and without links.
    trusted : Path
        A file or folder that this process runs code from. Folders above both are not looked at: whoever can replace
        `folder` there can replace that code.

    Returns
    -------
    str
        The first path that is at fault, and why. Always empty on Windows, whose files have no such permissions.
    """
    if not hasattr(os, "geteuid"):
        return ""
    for path in (folder, *folder.parents):
        if path in trusted.parents:
            break
        found = os.lstat(path)
        if not _is_own(found):
            return f"{path} belongs to {_name_of(found.st_uid)}"
        if _other_writers(path, found, folder):
            return f"other users can write to {path}"
    return _exposure_inside(folder)


def _other_writers(path: Path, found: os.stat_result, folder: Path) -> int:
    writers = found.st_mode & OTHERS_WRITE
    if path != folder and found.st_mode & stat.S_ISVTX:
        return 0
    if path not in (folder, folder.parent) and writers & stat.S_IWGRP and _is_private_group(found.st_gid):
        writers &= ~stat.S_IWGRP
    return writers


def _exposure_inside(folder: Path) -> str:
    writers = OTHERS_WRITE if os.lstat(folder).st_mode & OTHERS_ENTER else 0
    for path, found in _inside(folder):
        if not _is_own(found):
            return f"{path} belongs to {_name_of(found.st_uid)}"
        if found.st_mode & writers and not stat.S_ISLNK(found.st_mode):
            return f"other users can write to {path}"
    return ""


def _inside(folder: Path) -> Iterator[tuple[str, os.stat_result]]:
    """Yield the path and status of all that is in a folder, at any depth."""
    with os.scandir(folder) as entries:
        for entry in entries:
            try:
                found = entry.stat(follow_symlinks=False)
            except FileNotFoundError:  # a draft that another process has renamed
                continue
            yield entry.path, found
            if stat.S_ISDIR(found.st_mode):
                yield from _inside(Path(entry.path))


def _is_own(found: os.stat_result) -> bool:
    return found.st_uid in (0, os.geteuid())


def _name_of(user: int) -> str:
    import pwd  # which Windows has not

    try:
        return f"the user {pwd.getpwuid(user).pw_name}"
    except KeyError:
        return f"the user with the number {user}"


def _is_private_group(group: int) -> bool:
    """Return whether a group has this user's name and no other member, as Linux distributions make it for each user."""
    import grp
    import pwd

    try:
        user, found = pwd.getpwuid(os.geteuid()).pw_name, grp.getgrgid(group)
    except KeyError:
        return False
    return found.gr_name == user and set(found.gr_mem) <= {user}
