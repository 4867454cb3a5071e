"""Gains of eigenstrains that change while a simulator keeps its arrays.

The gains of laws are an array that kernels read (`Drives.law_gain`), with one law for each point of a profile. Nothing
else of a model depends on them, as long as no more rods may meet.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from bilayer_core.jit.record import Record
from bilayer_core.model.model import Model

Array = np.ndarray
OTHER = ("scene", "law_gain")
"""What may differ."""


def alike_but_gains(model: Model, other: Model) -> bool:
    """Return whether two models have the same arrays but for the gains of laws, of which they have as many."""
    return len(model.drives.law_gain) == len(other.drives.law_gain) and _alike(model, other)


def put_gains(model: Model, gains: Array) -> None:
    """Write gains into a model in place, and so into whatever was built from it."""
    held = model.drives.law_gain
    held.flags.writeable = True
    held[:] = gains
    held.flags.writeable = False


def _alike(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if type(one) is not type(other):
        return False
    if isinstance(one, Record):
        names = one.names if one.exists else ()
        return one.exists == other.exists and all(
            _alike(getattr(one, name), getattr(other, name)) for name in names if name not in OTHER
        )
    if is_dataclass(one):
        names = [part.name for part in fields(one)]
        return all(_alike(getattr(one, name), getattr(other, name)) for name in names if name not in OTHER)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    return True
