"""Numbers by which is differentiated: paths in the scene, lists of them, and gains, which need no new model."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
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
SAME = 1e-9
"""By which shares of gains differ, over their size, where they are the same."""
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
    share : ndarray
        How many times the gain of each law is this number, if nothing is built for it.
    """

    name: str
    value: float
    scale: float
    at: Callable[[float], Nearby]
    share: Array = field(default_factory=lambda: np.zeros(0))


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


def shares_of(
    model: Model,
    model_of: Callable[[SceneConfig], Model],
    numbers: Sequence[tuple[str, float]],
    besides: Collection[str] = (),
) -> dict[str, Array]:
    """Return how many times the gain of each law is that of each gain among some numbers, shape (n_law,), by its path,
    where nothing else of the model depends on it, `besides` arrays with some names. Copies may have factors.
    """
    gains = [(path, value) for path, value in numbers if GAIN.fullmatch(path)]
    if not gains:
        return {}
    value, scale = np.array([(value, scale_of(value)) for _, value in gains]).T
    parts, share = np.arange(len(gains)) / len(gains), np.ones(1)
    for changes in (1.0 + parts, 2.0 - parts):  # in other proportions, which tells factors apart
        changed = value + STEP * changes * scale
        content = {path: number for (path, _), number in zip(gains, changed.tolist(), strict=True)}
        other = model_of(load_content(scene_content(model.scene), content))
        if not alike_but_gains(model, other, besides):
            return {}
        moved = other.drives.law_gain != model.drives.law_gain
        before, share = share, other.drives.law_gain[:, None] / changed
        alike = moved[:, None] & (np.abs(share - before) < SAME * np.abs(share))
        if (alike.sum(axis=1) == moved).all() and alike.any(axis=0).all():
            return {path: share[:, k] * alike[:, k] for k, (path, _) in enumerate(gains)}
    return {}
