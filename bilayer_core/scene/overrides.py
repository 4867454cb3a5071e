"""Changes to single values of a scene, as ``--set PATH=VALUE`` gives them."""

from __future__ import annotations

from typing import Any

from bilayer_core.errors import SceneError
from bilayer_core.scene.faults import listed, shortened, suggestion
from bilayer_core.scene.text import read_yaml


def apply_override(data: dict, text: str) -> None:
    """Change one value of a complete scene, in place.

    Parameters
    ----------
    data : dict
        Content of the scene, values that the file leaves out included.
    text : str
        ``PATH=VALUE``, for example ``rods.arm.stations=100`` or ``gravity.2=-9.81``; items of a list are addressed by
        their name or their index, and VALUE is YAML.

    Raises
    ------
    SceneError
        If the path does not exist; says what there is instead.
    """
    path, equals, value = text.partition("=")
    keys, origin = path.strip().split("."), f"override {shortened(text)}"
    if not equals or not all(keys):
        raise SceneError(f"{origin}: must be PATH=VALUE, such as rods.arm.stations=100")
    here: Any = data
    for depth, key in enumerate(keys):
        place = _place(here, key)
        if place is None:
            raise SceneError(f"{origin}: {_absent(here, key, '.'.join(keys[:depth]))}")
        if depth == len(keys) - 1:
            here[place] = read_yaml(value, origin)
        else:
            here = here[place]


def _place(here: Any, key: str) -> str | int | None:
    """Key or index of an item that is there, else None."""
    if isinstance(here, dict):
        return key if key in here else None
    if not isinstance(here, list):
        return None
    for index, item in enumerate(here):
        if isinstance(item, dict) and item.get("name") == key:
            return index
    return next((index for index in range(len(here)) if str(index) == key), None)


def _absent(here: Any, key: str, parent: str) -> str:
    of_parent = f" of {parent}" if parent else ""
    if isinstance(here, dict):
        names = list(here)
    elif isinstance(here, list):
        names = [str(item["name"] if isinstance(item, dict) and "name" in item else i) for i, item in enumerate(here)]
    elif here is None:
        return f"{parent} is not given in this scene; set it as a whole, {parent}={{{shortened(key)}: ...}}"
    else:
        return f"{parent} is a single value and has no {shortened(key)}"
    return f"there is no {shortened(key)}{of_parent}{suggestion(key, names)}; there are {listed(names) or 'none'}"
