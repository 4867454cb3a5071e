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
"""Texts ``PATH=LO:HI``, ``PATH=LO:HI:POINTS`` or ``PATH=V,V,…:PIECES``, or by paths what is between the colons."""
FORM = (
    "must be PATH=LO:HI, PATH=LO:HI:POINTS, PATH=V,V,… or PATH=V,V,…:PIECES, such as "
    "rods.strip.layers.active.eigenstrain.gain=-2%:2%:40"
)
MOST = 500
"""Points or pieces of a profile: equations are solved in a time that goes as the cube of their number."""
BETWEEN = 1e-3
"""From the end of a piece to the start of the next, of their length."""


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
        Values to begin with, shape (n_point,), (n_piece,) or (1,).
    palette : tuple of float
        The only values that are allowed, of a number or of pieces, which have two points each; empty for any.
    """

    path: str
    low: float
    high: float
    at: tuple[float, ...]
    start: Array
    palette: tuple[float, ...] = ()

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
        return {self.path: {"at": list(self.at), "value": self.in_scene(values).tolist()}}

    def in_scene(self, values: Array) -> Array:
        """Return the numbers of the scene for some values: a piece has one at either end.

        Parameters
        ----------
        values : ndarray
            As many as `start`.

        Returns
        -------
        ndarray
            As many as `names`.
        """
        return np.repeat(values, len(self.names) // len(self.start))


def read_varied(scene: SceneConfig, asked: Vary) -> tuple[SceneConfig, list[Varied]]:
    """Return what is to vary, and the scene with the profiles for it.

    Raises
    ------
    InputError, SceneError
        If nothing is to vary, there is no such number, or the bounds or the number of points are none.
    """
    given = _given(asked)
    if not given:
        raise InputError(f"vary: nothing is given; each {FORM}")
    found: list[Varied] = []
    places: dict[tuple[int, Any], str] = {}
    original = scene_content(scene)
    for path, ends, points in given:
        content = scene_content(scene)
        try:
            holder, place = read_overrides({path: 0.0})[0].find(original)
        except SceneError as error:
            raise SceneError(f"vary {path}: {str(error).partition(': ')[2]}") from error
        if (id(holder), place) in places:
            raise InputError(f"vary {path}: is given twice, as {places[id(holder), place]} before")
        places[id(holder), place] = path
        held, profile = holder[place], None
        if isinstance(held, dict) and held.keys() == {"at", "value"}:
            profile = held
            content = scene_content(load_content(content, {path: held["value"][0]}))
        low, high, palette = _bounds(load_content(content, ()), path, ends)
        if points is None and (profile is None or palette):
            at: list[float] = []
            start = np.array([held if profile is None else profile["value"][0]])
        else:
            at = profile["at"] if profile is not None and points is None else _places(scene, path, points, palette)
            start = np.full(len(at), held) if profile is None else np.interp(at, profile["at"], profile["value"])
            start = start[::2] if palette else start
        start = np.clip(start.astype(float), low, high)
        found.append(Varied(path, low, high, tuple(at), start, palette))
        try:
            scene = load_content(scene_content(scene), found[-1].changes(start))
        except SceneError as error:
            along = f"cannot vary along the rod, leave out :{points}: " if at and profile is None else ""
            raise SceneError(f"vary {path}: {along}{str(error).partition(': ')[2]}") from error
    return scene, found


def _bounds(scene: SceneConfig, path: str, ends: Sequence[Any]) -> tuple[float, float, tuple[float, ...]]:
    """Return the bounds of a number and its palette, which is empty if `ends` are two bounds."""
    if not isinstance(ends[0], list | tuple | np.ndarray):
        (bounds,) = read_parameters(scene, {path: (ends[0], ends[1])})
        return bounds.low, bounds.high, ()
    content, values = scene_content(scene), []
    for value in ends[0]:
        changes = read_overrides([f"{path}={value}"])
        holder, place = changes[0].find(scene_content(load_content(content, [f"{path}={value}"])))
        values.append(holder[place])
    palette = tuple(sorted(set(values)))
    if len(palette) < 2:
        raise InputError(f"vary {path}: a palette must have two values or more")
    (bounds,) = read_parameters(scene, {path: (palette[0], palette[-1])})
    return bounds.low, bounds.high, palette


def _places(scene: SceneConfig, path: str, points: Any, palette: Sequence[float]) -> list[float]:
    """Return so many places along the rod that a path names, or with a palette the ends of so many pieces."""
    try:
        count = int(str(points))
    except ValueError:
        count = 0
    if not 2 <= count <= MOST:
        raise InputError(f"vary {path}: {points} points are not allowed; it must be a whole number from 2 to {MOST}")
    keys = path.split(".")
    rods = {key: rod for k, rod in enumerate(scene.rods) for key in (rod.name, str(k))}
    if keys[0] != "rods" or keys[1] not in rods:
        raise InputError(f"vary {path}: points need a number of a rod, which may vary along it")
    length = rods[keys[1]].path.length
    if not palette:
        return np.linspace(0.0, length, count).tolist()
    ends = np.repeat(np.linspace(0.0, length, count + 1), 2)[1:-1]
    ends[1:-1] += np.tile([-0.5, 0.5], count - 1) * BETWEEN * length / count
    return ends.tolist()


def _given(asked: Vary) -> list[tuple[str, Sequence[Any], Any]]:
    """Return paths, bounds or a palette, and the number of points or None."""
    if isinstance(asked, Mapping):
        given: list[tuple[str, list[Any]]] = [(str(path), list(bounds)) for path, bounds in asked.items()]
    elif isinstance(asked, str) or not all(isinstance(text, str) for text in asked):
        raise InputError('vary: must be texts, ["PATH=LO:HI", ...], or bounds by path, {"PATH": (LO, HI)}')
    else:
        texts = [(path.strip(), bounds.split(":")) for path, _, bounds in (text.partition("=") for text in asked)]
        given = [(path, [b.split(",") if "," in b else b for b in bounds]) for path, bounds in texts]
    found: list[tuple[str, Sequence[Any], Any]] = []
    for path, bounds in given:
        count = 1 if bounds and isinstance(bounds[0], list | tuple | np.ndarray) else 2
        if len(bounds) not in (count, count + 1):
            raise InputError(f"vary {shortened(path)}: {FORM}")
        found.append((path, bounds[:count], bounds[count] if len(bounds) > count else None))
    return found
