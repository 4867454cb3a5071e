"""Numbers by which is differentiated: paths in the scene, lists of them, and gains, which need no new model."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from pydantic import ValidationError

from bilayer_core.errors import InputError, SceneError
from bilayer_core.model.model import Model
from bilayer_core.scene.config import SceneConfig, Stimulus
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.scene.overrides import read_overrides
from bilayer_core.simulation.gains import alike_but_gains
from bilayer_core.simulation.gradients.nearby import Nearby

Array = np.ndarray
STEP = 1e-3
"""h of a parameter, over its size, and the largest displacement over it, of the longest rod."""
SMALL = 1e-6
"""h of a one-sided difference likewise: what it leaves out is as small as rounding."""
GAIN = re.compile(r".*\.eigenstrain(\.\d+)?\.gain(\.value\.\d+)?")
"""Paths of gains."""


@dataclass(frozen=True)
class Parameter:
    """A number by which an equilibrium is differentiated.

    Attributes
    ----------
    name : str
    value : float
    scale : float
        What its steps are parts of.
    at : callable
        Returns the model nearby at a value.
    laws : ndarray
        The laws whose gain it is, if nothing is built for it.
    """

    name: str
    value: float
    scale: float
    at: Callable[[float], Nearby]
    laws: Array = field(default_factory=lambda: np.zeros(0, dtype=np.int64))


def numbers_of(scene: SceneConfig, name: str) -> Iterator[tuple[str, float]]:
    """Yield the path and the value of a number of the scene, or of each in a list of numbers.

    Raises
    ------
    InputError, SceneError
        If there is no such path, or it has no numbers.
    """
    try:
        change = read_overrides({name: 0.0})[0]
        holder, place = change.find(scene_content(scene))
    except SceneError as error:
        told = str(error).partition(": ")[2]
        channel = f"; channels of stimuli are {', '.join(scene.stimuli)}" if scene.stimuli else ""
        raise SceneError(f"gradient: {name}: {told}{channel}") from error
    held = holder[place]
    of_list = isinstance(held, list) and bool(held) and all(isinstance(v, float | int) for v in held)
    for end, value in ((f".{k}", v) for k, v in enumerate(held)) if of_list else (("", held),):
        if isinstance(value, bool) or not isinstance(value, float):
            kind = "a whole number" if type(value) is int else "no number"
            raise InputError(f"gradient: {name} is {kind} in this scene, by which nothing can be differentiated")
        yield name + end, value


def scene_with(scene: SceneConfig, changes: Mapping[str, float]) -> SceneConfig:
    """Return a scene with other numbers; of a schedule that changes alone only the channel is validated anew."""
    path = next(iter(changes))
    name = next((name for name in scene.stimuli if path.startswith(f"stimuli.{name}.schedule.")), None)
    if name is not None and len(changes) == 1:
        content = {"stimuli": {name: scene.stimuli[name].model_dump(mode="json", by_alias=True)}}
        read_overrides(changes)[0].apply(content)
        with suppress(ValidationError):
            changed = Stimulus.model_validate(content["stimuli"][name])
            return scene.model_copy(update={"stimuli": scene.stimuli | {name: changed}})
    try:
        return load_content(scene_content(scene), changes)
    except SceneError as error:
        told = " and ".join(f"{path} cannot be varied about its value, to {changes[path]:.9g}" for path in changes)
        raise SceneError(f"gradient: {told}: {error}") from error


def scale_of(value: float) -> float:
    """Return what steps of a number of the scene are parts of."""
    return abs(value) or 1.0


def laws_of(model: Model, model_of: Callable[[SceneConfig], Model], numbers: Sequence[tuple[str, float]]) -> dict:
    """Return which laws each gain among some numbers is that of, shape (n,), by its path, where nothing else of the
    model depends on it.
    """
    gains = [(path, value) for path, value in numbers if GAIN.fullmatch(path)]
    if not gains:
        return {}
    changed = {path: value + STEP * (1.0 + k / len(gains)) * scale_of(value) for k, (path, value) in enumerate(gains)}
    other = model_of(load_content(scene_content(model.scene), changed))
    if not alike_but_gains(model, other):
        return {}
    laws = {path: np.flatnonzero(other.drives.law_gain == value) for path, value in changed.items()}
    moved = np.flatnonzero(other.drives.law_gain != model.drives.law_gain)
    told = np.sort(np.concatenate(list(laws.values())))
    return laws if np.array_equal(told, moved) and all(of.size for of in laws.values()) else {}
