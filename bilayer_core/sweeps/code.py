"""Functions of sweep files: where they are found, and how they become functions again in the process that runs."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from bilayer_core.errors import InputError
from bilayer_core.scene.limits import LARGEST_FILE, read_text
from bilayer_core.sweeps.job import Code


def find_code(function: str, directory: Path, source: str) -> Code:
    """The function that ``FILE.py:NAME`` or ``package.module:NAME`` names.

    Parameters
    ----------
    function : str
    directory : Path
        To which names of files are relative.
    source : str
        What begins messages: file and key path.

    Raises
    ------
    InputError
        If there is none.
    """
    place, _, name = function.rpartition(":")
    if not place.endswith(".py"):
        code = Code(name, module=place)
    else:
        path = directory / place
        try:
            code = Code(name, file=str(path), text=read_text(path, LARGEST_FILE))
        except ValueError as error:
            raise InputError(f"{source}: found {function!r}; {path} {error}") from None
    try:
        load(code)
    except Exception as error:  # whatever the file does when it is read
        raise InputError(f"{source}: found {function!r}; {_problem(error)}") from None
    return code


def load(code: Any) -> Callable[..., Any]:
    """The function; a function that came as such is itself."""
    if not isinstance(code, Code):
        return code
    module = importlib.import_module(code.module) if code.module else _module_of(code.file, code.text)
    function = getattr(module, code.name, None)
    if not callable(function):
        raise InputError(f"{code.module or code.file} has no function {code.name}")
    return function


@lru_cache(maxsize=32)
def _module_of(file: str, text: str) -> ModuleType:
    module = ModuleType(Path(file).stem)
    module.__file__ = file
    exec(compile(text, file, "exec"), module.__dict__)
    return module


def _problem(error: Exception) -> str:
    return str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
