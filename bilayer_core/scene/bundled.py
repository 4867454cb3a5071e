"""Where bundled scenes, templates and sweeps are: one lookup for a checkout, a wheel, and installs by links."""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import bilayer_core
from bilayer_core.errors import SceneError
from bilayer_core.scene.faults import suggestion

_SHARED = Path("share") / bilayer_core.DISTRIBUTION / "config"
"""Below the prefix that the package is installed to."""
SUFFIX = ".yaml"
SUFFIXES = (SUFFIX, ".yml")
"""Of files; a text that ends so is no name of something bundled."""


def _candidates() -> Iterator[Path]:
    """Yield the directories below which scenes and templates may be, the likeliest first."""
    # A checkout, an editable install, a colcon symlink install: the package is a link into the checkout.
    beside = Path(os.path.realpath(bilayer_core.__file__)).parents[1]
    yield beside / "config"
    # A wheel; with ``pip install --target`` it is beside the package.
    for prefix in (sysconfig.get_path("data"), sys.prefix, beside):
        yield Path(prefix) / _SHARED
    yield from _recorded()
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(prefix) / _SHARED


def _recorded() -> Iterator[Path]:
    """Yield where the installer says that it put them (``pip install --user``, ``--prefix``)."""
    from importlib.metadata import PackageNotFoundError, files

    try:
        recorded = files(bilayer_core.DISTRIBUTION) or []
    except PackageNotFoundError:
        return
    parents = (Path(file.locate()).resolve().parents[1] for file in recorded if file.suffix == ".yaml")
    yield from dict.fromkeys(parent for parent in parents if parent.parts[-len(_SHARED.parts) :] == _SHARED.parts)


def bundled_directory(kind: str) -> Path:
    """Return the directory of the bundled ``scenes``, ``templates`` or ``sweeps``.

    Raises SceneError if it is not found; the message lists the places searched.
    """
    looked = []
    for directory in (candidate / kind for candidate in _candidates()):
        if directory in looked:
            continue
        if _files(directory):
            return directory
        looked.append(directory)
    places = "".join(f"\n  {directory}" for directory in looked)
    raise SceneError(f"the bundled {kind} are not installed; looked in:{places}")


def _files(directory: Path) -> list[str]:
    """Return the names of the scene files in a directory, in alphabetical order; none if there is no such directory."""
    try:
        return sorted(name for name in os.listdir(directory) if name.endswith(SUFFIX))
    except OSError:
        return []


def _bundled(kind: str) -> dict[str, Path]:
    directory = bundled_directory(kind)
    return {name.removesuffix(SUFFIX): directory / name for name in _files(directory)}


def bundled_scenes() -> dict[str, Path]:
    """Return the file of each bundled scene by its name, in alphabetical order."""
    return _bundled("scenes")


def bundled_templates() -> dict[str, Path]:
    """Return the file of each template of a new scene by its name, in alphabetical order."""
    return _bundled("templates")


def bundled_sweeps() -> dict[str, Path]:
    """Return the file of each bundled sweep by its name, in alphabetical order."""
    return _bundled("sweeps")


def bundled_scene(name: str) -> Path:
    """Return the file of a bundled scene.

    Raises SceneError if there is no such scene; the message suggests the nearest name and lists all.
    """
    return _of_name(name, "scene")


def bundled_sweep(name: str) -> Path:
    """Return the file of a bundled sweep.

    Raises SceneError if there is no such sweep; the message suggests the nearest name and lists all.
    """
    return _of_name(name, "sweep")


def _of_name(name: str, word: str) -> Path:
    directory = bundled_directory(f"{word}s")
    files = _files(directory)
    if name + SUFFIX in files:
        return directory / (name + SUFFIX)
    names = [file.removesuffix(SUFFIX) for file in files]
    raise SceneError(
        f"{name}: neither a {word} file nor a bundled {word}{suggestion(name, names)}; "
        f"bundled are {', '.join(names)} (in {directory})"
    )


def is_file_name(given: str | Path) -> bool:
    """Return whether a name is meant as a file, not as something bundled."""
    path = Path(given)
    return isinstance(given, Path) or path.suffix in SUFFIXES or len(path.parts) > 1 or path.is_file()
