"""Fields whose diffusivity depends on their value: the arrays of `model.records.varied_fields`."""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.records.varied_fields import VariedFields
from bilayer_core.model.strands import Collected
from bilayer_core.scene.config import SceneConfig

TOLERANCE = 5e-6
"""Of a step of the field: root mean square over the thickness, by the range of the channel. Fields forget their errors:
in waves of a tenfold diffusivity modes stay within 6e-6 of the range from those of steps of 1e-10, of a hundredfold one
within 1.3e-4."""


def build_varied_fields(scene: SceneConfig, found: Collected) -> VariedFields:
    """Return the fields that have diffusivities which vary; absent if there is none."""
    numbers = [index for index, (_, _, varied) in enumerate(found.fields) if varied is not None]
    if not numbers:
        return VariedFields.absent()
    number = np.full(len(found.fields), -1, dtype=np.int64)
    number[numbers] = np.arange(len(numbers))
    varied = [found.fields[index][2] for index in numbers]
    curves = [curve for field in varied for curve in field.curves]
    first_curve = list(accumulate((len(field.curves) for field in varied), initial=0))
    channels = list(scene.stimuli.values())
    seen = [channels[found.fields[index][0]] for index in numbers]
    ranges = np.array([channel.maximum - channel.minimum for channel in seen])
    amplitude = _rows(field.amplitude[None] for field in varied)
    return VariedFields.zeros(
        UNALLOCATED,
        number=number,
        point=_places(field.weight for field in varied),
        tolerance=TOLERANCE * ranges * np.linalg.norm(amplitude, axis=1),
        amplitude=amplitude,
        rate=_rows(field.rate[None] for field in varied),
        value=_rows(field.value for field in varied),
        slope=_rows(field.slope for field in varied),
        weight=np.concatenate([field.weight for field in varied]),
        curve=np.concatenate([of.curve + first for of, first in zip(varied, first_curve[:-1], strict=True)]),
        curve_first=_places(at for at, _ in curves),
        curve_at=np.concatenate([at for at, _ in curves]),
        curve_lack=np.concatenate([value.max() - value for _, value in curves]),
    )


def _rows(matrices) -> np.ndarray:
    """Return rows of all matrices, as long as the longest and zero beyond their own."""
    parts = list(matrices)
    width = max(part.shape[1] for part in parts)
    return np.vstack([np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part in parts])


def _places(arrays) -> np.ndarray:
    """Return where each array begins among all of them, and where the last one ends."""
    return np.array(list(accumulate((of.size for of in arrays), initial=0)), dtype=np.int64)
