"""Output files: refused before a simulation starts rather than after it, and written as a whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bilayer_core.errors import InputError, OutputError
from bilayer_core.log.file.private_directory import private_directory


def check_output_path(path: str | Path, force: bool = False, suffix: str = "") -> Path:
    """Return the path of a file after checking that it can be written now.

    Its directory must exist and be writable, and the file must not exist yet.

    Parameters
    ----------
    path : str or Path
    force : bool
        Allow a file that exists; it will be replaced.
    suffix : str
        How the name of a file must end; devices and pipes may be called anything.

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
    if path.suffix.lower() != suffix and suffix and not _is_special(path):
        raise InputError(f"{path}: must end in {suffix}")
    if path.exists():
        if not force:
            raise InputError(f"{path}: exists already; choose another name, or replace it with --force")
        if not os.access(path, os.W_OK):
            raise InputError(f"{path}: cannot be written: no permission")
    elif not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written: no permission to write in {path.parent.resolve()}")
    return path


@contextmanager
def draft_of(path: str | Path, force: bool) -> Iterator[Path]:
    """Yield the path of a draft with the name of `path`, in a private directory; it becomes `path` at the block's end.

    If the block raises, also where a signal ends the program, the draft is removed and what `path` held stays. Devices,
    pipes, and files in directories that cannot be written to, are their own drafts.

    `path`: as `check_output_path` has returned it. `force`: replace what is there; without it, a file that another
    program has made meanwhile is kept. Raises OutputError if an OSError says that the file cannot be written.
    """
    path = Path(path)
    target = path.resolve()  # a link stays one
    try:
        if _is_special(path) or not os.access(target.parent, os.W_OK | os.X_OK):
            yield target
            return
        with private_directory(target.parent) as directory:
            draft = directory / target.name
            yield draft
            move(draft, target, force)
    except FileExistsError as error:
        raise OutputError(f"{path}: cannot be written: another program has made it meanwhile") from error
    except OSError as error:
        raise unwritable(path, error) from error


def move(draft: Path, target: Path, force: bool) -> None:
    """Give a draft its name; FileExistsError if there is such a file and `force` does not say to replace it."""
    if not force:
        target.touch(exist_ok=False)
    os.replace(draft, target)


def unwritable(path: str | Path, error: OSError) -> OutputError:
    """Return an OSError as one that names the file."""
    reason = error.strerror or (os.strerror(error.errno) if error.errno else error)
    return OutputError(f"{path}: cannot be written: {reason}")


def write_text(path: str | Path, text: str, force: bool) -> None:
    """Write a text file as a whole or not at all; parameters and errors are those of `draft_of`."""
    with draft_of(path, force) as draft:
        draft.write_text(text, encoding="utf-8")


def _is_special(path: Path) -> bool:
    """Return whether the path is that of a device or a pipe."""
    return path.exists() and not path.is_file()
