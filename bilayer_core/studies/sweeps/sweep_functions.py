"""Functions of sweep files: where they are found, and how they become functions again in the process that runs.

Finding a function reads the file that it is in; only `load` runs that file.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from bilayer_core.errors import InputError
from bilayer_core.scene.limits import LARGEST_FILE, read_text
from bilayer_core.studies.sweeps.job import Code


def find_code(function: str, directory: Path, source: str) -> Code:
    """Return the code that ``FILE.py:NAME`` names, without running it.

    Parameters
    ----------
    function : str
    directory : Path
        That of the sweep file, which the file must be in.
    source : str
        What begins messages: file and key path.

    Raises
    ------
    InputError
        If there is no such file, or it is elsewhere.
    """
    file, _, name = function.rpartition(":")
    path = directory / file
    try:
        if not file.endswith(".py"):
            raise ValueError("is no .py file; must be FILE.py:NAME (that file can import a function of a package)")
        if Path(file).is_absolute() or ".." in Path(file).parts or not _is_inside(path, directory):
            raise ValueError(
                "is outside the folder of the sweep file; must be in it or below it, without `..` and without a link "
                "that leads out"
            )
        return Code(name, str(path), read_text(path, LARGEST_FILE))
    except ValueError as error:
        raise InputError(f"{source}: found {function!r}; {file} {error}") from None


def _is_inside(path: Path, directory: Path) -> bool:
    try:
        return path.resolve().is_relative_to(directory.resolve())
    except (OSError, RuntimeError):  # links that lead to each other
        return False


def refuse_broken(code: Code, function: str, source: str) -> None:
    """Run the file of a function, and raise InputError if that fails or there is no such function."""
    try:
        load(code)
    except Exception as error:  # whatever the file does
        told = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        raise InputError(f"{source}: found {function!r}; {told}") from None


def load(code: Any) -> Callable[..., Any]:
    """Return a function, after running its file; one that came as such is itself."""
    if not isinstance(code, Code):
        return code
    function = getattr(_module_of(code.file, code.text), code.name, None)
    if not callable(function):
        raise InputError(f"{code.file} has no function {code.name}")
    return function


@lru_cache(maxsize=32)
def _module_of(file: str, text: str) -> ModuleType:
    module = ModuleType(Path(file).stem)
    module.__file__ = file
    exec(compile(text, file, "exec"), module.__dict__)
    return module
