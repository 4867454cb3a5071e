"""Parameters of a fit: numbers of a scene by their key paths, each with bounds and a start value.

The fit itself moves numbers u from 0 to 1, the part of the way from the lower to the upper bound: in proportion, or
for a positive parameter whose bounds are more than a decade apart in its logarithm.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.errors import InputError, SceneError
from bilayer_core.printable import shortened
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_scene, scene_content
from bilayer_core.scene.overrides import Override, read_overrides

Array = np.ndarray
Bounds = Sequence[float | str]
"""Lower and upper bound, and perhaps a start value: numbers in SI units, or texts with a unit."""
Parameters = Sequence[str] | Mapping[str, Bounds]
"""``PATH=LO:HI`` or ``PATH=LO:HI:START`` texts, or bounds by paths."""
DECADE = 10.0
"""Positive parameters whose bounds are further apart than this factor are varied by their logarithm."""
FORM = "must be PATH=LO:HI or PATH=LO:HI:START, such as materials.film.youngs_modulus=50MPa:200MPa"
_WITH_UNIT = re.compile(r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>\S.*?)?\s*")


@dataclass(frozen=True)
class Parameter:
    """A number of a scene that is fitted.

    Attributes
    ----------
    path : str
        Its key path, as ``--set`` takes it.
    low, high : float
        Its bounds, in SI units.
    start : float
        Where the fit starts, between them.
    logarithmic : bool
        Whether it is varied by its logarithm.
    unit : str
        Unit in which it is shown, as its bounds were given; empty for SI.
    factor : float
        SI units in that unit.
    """

    path: str
    low: float
    high: float
    start: float
    logarithmic: bool
    unit: str = ""
    factor: float = 1.0

    @property
    def extent(self) -> float:
        """From bound to bound, in the parameter or in its logarithm."""
        return math.log(self.high / self.low) if self.logarithmic else self.high - self.low

    def value(self, part: float) -> float:
        """Return the parameter at a part of the way from `low` to `high`.

        Parameters
        ----------
        part : float
            From 0 to 1.

        Returns
        -------
        float
            In SI units.
        """
        if part in (0.0, 1.0):
            return self.high if part else self.low
        return self.low * math.exp(part * self.extent) if self.logarithmic else self.low + part * self.extent

    def part(self, value: float) -> float:
        """Return the part of the way from `low` to `high` at which a value is.

        Parameters
        ----------
        value : float
            In SI units.

        Returns
        -------
        float
            From 0 to 1.
        """
        return (math.log(value / self.low) if self.logarithmic else value - self.low) / self.extent

    def relative(self, part: float) -> float:
        """Return the change of the parameter over the whole way between its bounds, relative to its value.

        Parameters
        ----------
        part : float
            Part of the way at which the value and the slope are taken, from 0 to 1.

        Returns
        -------
        float
            Divided by the value; where that is 0, the change itself in SI units.
        """
        slope = self.extent * (self.value(part) if self.logarithmic else 1.0)
        return slope / (abs(self.value(part)) or 1.0)

    def shown(self, value: float, digits: int = 5) -> str:
        """Return a value in the unit of the bounds, as text.

        Parameters
        ----------
        value : float
            In SI units.
        digits : int
            Significant digits.

        Returns
        -------
        str
            With the unit.
        """
        return f"{value / self.factor:.{digits}g}{f' {self.unit}' if self.unit else ''}"


def told(parameters: Sequence[Parameter], parts: Array) -> str:
    """Return the values of parameters in a row, for messages."""
    return ", ".join(f"{p.path} = {p.shown(p.value(u))}" for p, u in zip(parameters, parts.tolist(), strict=True))


def read_parameters(scene: SceneConfig, asked: Parameters) -> list[Parameter]:
    """Return the parameters of a scene as users give them.

    Raises
    ------
    InputError
        If there is none, one is given twice or is no number that can be varied, or its bounds or its start are none.
    SceneError
        If there is no such key, with what there is instead, or the scene does not allow a bound.
    """
    content = scene_content(scene)
    pairs = _pairs(asked)
    if not pairs:
        raise InputError(f"parameter: none is given; each {FORM}")
    found: dict[str, Parameter] = {}
    for path, bounds in pairs:
        parameter = _read(content, path, bounds)
        if parameter.path in found:
            raise InputError(f"parameter {parameter.path}: is given twice")
        found[parameter.path] = parameter
    return list(found.values())


def _pairs(asked: Parameters) -> list[tuple[str, list[Any]]]:
    if isinstance(asked, Mapping):
        for path, bounds in asked.items():
            if isinstance(bounds, str) or not isinstance(bounds, Sequence | np.ndarray) or len(bounds) not in (2, 3):
                raise InputError(f"parameter {path}: must have (lower, upper) or (lower, upper, start), has {bounds!r}")
        return [(str(path), list(bounds)) for path, bounds in asked.items()]
    if isinstance(asked, str) or not all(isinstance(text, str) for text in asked):
        raise InputError('parameters: must be texts, ["PATH=LO:HI", ...], or bounds by path, {"PATH": (LO, HI)}')
    pairs = []
    for text in asked:
        path, _, rest = text.partition("=")
        bounds = rest.split(":")
        if len(bounds) not in (2, 3) or not all(bound.strip() for bound in bounds):
            raise InputError(f"parameter {shortened(text)}: {FORM}")
        pairs.append((path, bounds))
    return pairs


def _read(content: dict[str, Any], path: str, bounds: list[Any]) -> Parameter:
    try:
        changes = [_change(path, bound) for bound in bounds]
        held = _at(content, changes[0])
    except SceneError as error:
        raise SceneError(str(error).replace("override", "parameter", 1)) from error
    path = ".".join(changes[0].keys)
    if isinstance(held, bool | int) or isinstance(held, str | list | dict):
        kind = "a whole number" if type(held) is int else "no single number"
        shown = shortened(str(held), 40)
        raise InputError(f"parameter {path}: is {kind} in this scene ({shown}), which cannot be varied")
    low, high, *rest = [_in_scene(content, path, change) for change in changes]
    if low >= high:
        raise InputError(f"parameter {path}: the lower bound {bounds[0]} must be below the upper one, {bounds[1]}")
    logarithmic = low > 0.0 and high > DECADE * low
    unit, factor = _unit(bounds, [low, high])
    parameter = Parameter(path, low, high, low, logarithmic, unit, factor)
    if rest and not low < rest[0] < high:
        raise InputError(f"parameter {path}: the start {bounds[2]} must be between {bounds[0]} and {bounds[1]}")
    inside = held is not None and low < held < high
    start = rest[0] if rest else held if inside else parameter.value(0.5)
    return Parameter(path, low, high, float(start), logarithmic, unit, factor)


def _change(path: str, bound: Any) -> Override:
    if isinstance(bound, str):
        return read_overrides([f"{path}={bound.strip()}"])[0]
    return read_overrides({path: bound})[0]


def _at(content: dict[str, Any], change: Override) -> Any:
    """Return the value at a path in a scene, or raise SceneError if there is no such path."""
    holder, place = change.find(content)
    return holder[place]


def _in_scene(content: dict[str, Any], path: str, change: Override) -> float:
    """Return a bound as the scene has it, in SI units."""
    changed = copy.deepcopy(content)
    change.apply(changed)
    try:
        scene = load_scene(changed)
    except SceneError as error:
        raise SceneError(f"parameter {change.text}: {str(error).removeprefix('scene: ')}") from error
    value = _at(scene_content(scene), change)
    if isinstance(value, bool) or not isinstance(value, float) or not math.isfinite(value):
        raise InputError(f"parameter {change.text}: the scene takes no number there that can be varied")
    return value


def _unit(bounds: list[Any], values: list[float]) -> tuple[str, float]:
    """Return the unit in which both bounds were given, and its size in SI units."""
    read = [_WITH_UNIT.fullmatch(bound) if isinstance(bound, str) else None for bound in bounds[:2]]
    units = {match["unit"] or "" if match else "" for match in read}
    if len(units) != 1 or units == {""}:
        return "", 1.0
    factors = [v / float(m["number"]) for m, v in zip(read, values, strict=True) if m and float(m["number"]) != 0.0]
    return units.pop(), float(f"{factors[-1]:.12g}")
