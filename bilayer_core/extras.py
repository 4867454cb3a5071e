"""Libraries that only some commands need, and the extra of this package that installs each of them.

Extras are read from the metadata of the installed package, so that setup.py alone says what they contain.
"""

from __future__ import annotations

import re
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from bilayer_core import DISTRIBUTION
from bilayer_core.errors import InputError

_OTHER_NAMES = {
    "PIL": "pillow",
    "elastica": "pyelastica",
    "rclpy": "ros-rclpy",
    "rerun": "rerun-sdk",
    "rerun_cli": "rerun-sdk",
    "vtkmodules": "vtk",
}
"""Modules whose distribution has another name."""
_OF_EXTRA = re.compile(r"""([\w.-]+).*\bextra\s*==\s*["']([\w.-]+)["']""")
_FOR_DEVELOPERS = "test"


def require(what: str, *modules: str) -> None:
    """Raise InputError, with the command that installs them, if a library is missing.

    `what`: the command, option or function that needs the libraries, for the message. `*modules`: names by which the
    libraries are imported.
    """
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise missing_library(what, missing[0], *modules)


def of_notebook(name: str) -> Any:
    """Return a function of `bilayer_core.view.notebook`, which runs have as methods and their parts may not import."""
    return getattr(import_module("bilayer_core.view.notebook"), name)


def missing_library(what: str, module: str, *together: str) -> InputError:
    """Return the error that says which library is missing and how to install it with those needed together with it."""
    names = sorted({_distribution_of(name) for name in (module, *together)})
    wanted = f"'{DISTRIBUTION}[{extra}]'" if (extra := _extra_with(names)) else " ".join(names)
    return InputError(f"{what}: {_distribution_of(module)} is not installed; install it with: pip install {wanted}")


def is_optional(module: str) -> bool:
    """Return whether an extra installs this module."""
    return bool(_extra_with([_distribution_of(module)]))


def _distribution_of(module: str) -> str:
    top = module.partition(".")[0]
    return _OTHER_NAMES.get(top, top.replace("_", "-").lower())


def _extra_with(names: list[str]) -> str:
    """Return the smallest extra that installs these distributions; empty if none does."""
    extras = [(len(content), extra) for extra, content in _extras().items() if content.issuperset(names)]
    return min(extras, default=(0, ""))[1]


def _extras() -> dict[str, set[str]]:
    """Return the distributions of each extra; none for a checkout that is not installed."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        found = [_OF_EXTRA.match(requirement) for requirement in requires(DISTRIBUTION) or ()]
    except PackageNotFoundError:
        return {}
    extras: dict[str, set[str]] = {}
    for match in filter(None, found):
        if match[2] != _FOR_DEVELOPERS:
            extras.setdefault(match[2], set()).add(match[1].lower().replace("_", "-"))
    return extras
