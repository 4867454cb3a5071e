"""Changes to single values of a scene, as ``--set PATH=VALUE`` and programs give them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.errors import SceneError
from bilayer_core.printable import shortened
from bilayer_core.scene.faults import listed, suggestion
from bilayer_core.scene.text import read_yaml

Overrides = Sequence[str] | Mapping[str, Any]
"""``PATH=VALUE`` texts, or values by their paths."""


@dataclass(frozen=True)
class Override:
    """A change of one value of a scene."""

    keys: tuple[str, ...]  # To the value; items of a list are addressed by their name or their index
    value: Any  # As YAML has it
    text: str  # What the user gave, for messages

    @property
    def origin(self) -> str:
        """Beginning of a message about the override."""
        return f"override {shortened(self.text)}"

    def find(self, data: dict[str, Any]) -> tuple[Any, Any]:
        """Return the mapping or list that holds the value in a complete scene, and its key or index there.

        Raises SceneError if the path does not exist; the message says what there is instead.
        """
        here: Any = data
        place: Any = None
        for depth, key in enumerate(self.keys):
            here = here if place is None else here[place]
            place = _place(here, key)
            if place is None:
                raise SceneError(f"{self.origin}: {_absent(here, key, '.'.join(self.keys[:depth]))}")
        return here, place

    def apply(self, data: dict[str, Any]) -> None:
        """Change the value in a complete scene, what its file leaves out included, in place.

        Raises SceneError if the path does not exist; the message says what there is instead.
        """
        holder, place = self.find(data)
        holder[place] = deepcopy(self.value)  # later changes may be of parts of it


def read_overrides(overrides: Overrides) -> list[Override]:
    """Return the changes that users give as texts or as a mapping of paths to values.

    A text is ``PATH=VALUE`` with a YAML value, such as ``rods.arm.stations=100`` or ``gravity.2=-9.81``. Raises
    SceneError if a text is not of this form.
    """
    if isinstance(overrides, Mapping):
        return [_override(str(path), value, f"{path}={value}") for path, value in overrides.items()]
    if isinstance(overrides, str) or not all(isinstance(text, str) for text in overrides):
        raise SceneError('overrides: must be texts, ["PATH=VALUE", ...], or values by path, {"PATH": VALUE, ...}')
    found = []
    for text in overrides:
        path, equals, value = text.partition("=")
        if not equals:
            raise SceneError(f"override {shortened(text)}: must be PATH=VALUE, such as rods.arm.stations=100")
        found.append(_override(path, read_yaml(value, f"override {shortened(text)}"), text))
    return found


def _override(path: str, value: Any, text: str) -> Override:
    keys = tuple(path.strip().split("."))
    if not all(keys):
        raise SceneError(f"override {shortened(text)}: must be PATH=VALUE, such as rods.arm.stations=100")
    return Override(keys, value.tolist() if isinstance(value, np.generic | np.ndarray) else value, text)


def _place(here: Any, key: str) -> str | int | None:
    """Return the key or index of an item that is there, else None."""
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
