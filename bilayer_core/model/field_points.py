"""Fields whose diffusivity depends on their value: the arrays of `model.records.varied_fields`."""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.records.parts import Drives
from bilayer_core.model.records.varied_fields import VariedFields
from bilayer_core.model.strands import Collected
from bilayer_core.scene.config import SceneConfig

TOLERANCE = 1e-5
"""Of a step of the field: root mean square over the thickness, by the range of the channel. Fields forget their errors:
after a minute of the crawling film modes are 4e-6 of the range from those of steps of 1e-9."""


def build_varied_fields(scene: SceneConfig, found: Collected, drives: Drives) -> VariedFields:
    """Return the fields that have diffusivities which vary; absent if there is none."""
    numbers = [index for index, (_, _, varied) in enumerate(found.fields) if varied is not None]
    if not numbers:
        return VariedFields.absent()
    number = np.full(len(found.fields), -1, dtype=np.int64)
    number[numbers] = np.arange(len(numbers))
    amplitude = np.ones(len(drives.mode_rising))
    varied = [found.fields[index][2] for index in numbers]
    for index, field in zip(numbers, varied, strict=True):
        amplitude[drives.field_first[index] : drives.field_first[index + 1]] = field.amplitude
    curves = [curve for field in varied for curve in field.curves]
    first_curve = list(accumulate((len(field.curves) for field in varied), initial=0))
    channels = list(scene.stimuli.values())
    ranges = [channels[found.fields[index][0]] for index in numbers]
    return VariedFields.zeros(
        UNALLOCATED,
        number=number,
        point=_places(field.weight for field in varied),
        entry=_places(field.value for field in varied)[:-1],
        square=_places(field.exchange for field in varied)[:-1],
        tolerance=np.array([TOLERANCE * (channel.maximum - channel.minimum) for channel in ranges]),
        amplitude=amplitude,
        **{name: np.concatenate([getattr(of, name).ravel() for of in varied]) for name in PER_POINT},
        curve=np.concatenate([of.curve + first for of, first in zip(varied, first_curve[:-1], strict=True)]),
        curve_first=_places(at for at, _ in curves),
        curve_at=np.concatenate([at for at, _ in curves]),
        curve_value=np.concatenate([value for _, value in curves]),
    )


PER_POINT = ("value", "slope", "weight", "exchange")


def _places(arrays) -> np.ndarray:
    """Return where each array begins among all of them, and where the last one ends."""
    return np.array(list(accumulate((of.size for of in arrays), initial=0)), dtype=np.int64)
