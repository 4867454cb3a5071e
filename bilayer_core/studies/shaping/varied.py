"""Numbers and profiles of a scene that a design varies, each between two bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.errors import InputError, SceneError
from bilayer_core.printable import shortened
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.scene.overrides import read_overrides
from bilayer_core.studies.fitting.parameters import read_parameters

Array = np.ndarray
Vary = Sequence[str] | Mapping[str, Sequence[float | str]]
"""``PATH=LO:HI`` or ``PATH=LO:HI:POINTS`` texts, or (lower, upper) or (lower, upper, points) by paths."""
FORM = "must be PATH=LO:HI or PATH=LO:HI:POINTS, such as rods.strip.layers.active.eigenstrain.gain=-2%:2%:40"


@dataclass(frozen=True)
class Varied:
    """A number, or the values of a profile at points along a rod.

    Attributes
    ----------
    path : str
    low, high : float
        Bounds, in SI units.
    at : tuple of float
        Where the points are along the path of the rod [m]; empty for a number.
    start : ndarray
        Values to begin with, shape (n_point,) or (1,).
    """

    path: str
    low: float
    high: float
    at: tuple[float, ...]
    start: Array

    @property
    def names(self) -> list[str]:
        """Paths of its numbers."""
        return [f"{self.path}.value.{k}" for k in range(len(self.at))] if self.at else [self.path]

    def changes(self, values: Array) -> dict[str, Any]:
        """Return the override that gives a scene some values.

        Parameters
        ----------
        values : ndarray
            As many as `start`.

        Returns
        -------
        dict
            As `load_scene` takes it.
        """
        if not self.at:
            return {self.path: float(values[0])}
        return {self.path: {"at": list(self.at), "value": values.tolist()}}


def read_varied(scene: SceneConfig, asked: Vary) -> tuple[SceneConfig, list[Varied]]:
    """Return what is to vary, and the scene with the profiles for it.

    Raises
    ------
    InputError, SceneError
        If nothing is to vary, there is no such number, or the bounds or the number of points are none.
    """
    triples = _triples(asked)
    if not triples:
        raise InputError(f"vary: nothing is given; each {FORM}")
    found = []
    for path, low, high, points in triples:
        content = scene_content(scene)
        try:
            holder, place = read_overrides({path: 0.0})[0].find(content)
        except SceneError as error:
            raise SceneError(f"vary {path}: {str(error).partition(': ')[2]}") from error
        held, profile = holder[place], None
        if isinstance(held, dict) and held.keys() == {"at", "value"}:
            profile = held
            content = scene_content(load_content(content, {path: held["value"][0]}))
        (bounds,) = read_parameters(load_content(content, ()), {path: (low, high)})
        if points is None and profile is None:
            at: list[float] = []
            start = np.array([held])
        else:
            at = profile["at"] if profile is not None and points is None else _places(scene, path, points)
            start = np.full(len(at), held) if profile is None else np.interp(at, profile["at"], profile["value"])
        start = np.clip(start.astype(float), bounds.low, bounds.high)
        found.append(Varied(path, bounds.low, bounds.high, tuple(at), start))
        scene = load_content(scene_content(scene), found[-1].changes(start))
    return scene, found


def _places(scene: SceneConfig, path: str, points: Any) -> list[float]:
    """Return so many places along the layer or the rod that a path names."""
    try:
        count = int(str(points))
    except ValueError:
        count = 0
    if count < 2:
        raise InputError(f"vary {path}: {points} points are not allowed; it must be a whole number from 2 up")
    keys = path.split(".")
    rods = {key: rod for k, rod in enumerate(scene.rods) for key in (rod.name, str(k))}
    if keys[0] != "rods" or keys[1] not in rods:
        raise InputError(f"vary {path}: points need a number of a rod, which may vary along it")
    return np.linspace(0.0, rods[keys[1]].path.length, count).tolist()


def _triples(asked: Vary) -> list[tuple[str, Any, Any, Any]]:
    if isinstance(asked, Mapping):
        given = [(str(path), list(bounds)) for path, bounds in asked.items()]
    elif isinstance(asked, str) or not all(isinstance(text, str) for text in asked):
        raise InputError('vary: must be texts, ["PATH=LO:HI", ...], or bounds by path, {"PATH": (LO, HI)}')
    else:
        given = [(path.strip(), bounds.split(":")) for path, _, bounds in (text.partition("=") for text in asked)]
    for path, bounds in given:
        if len(bounds) not in (2, 3):
            raise InputError(f"vary {shortened(path)}: {FORM}")
    return [(path, bounds[0], bounds[1], bounds[2] if len(bounds) == 3 else None) for path, bounds in given]
