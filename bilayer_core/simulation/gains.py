"""Gains of eigenstrains that change while a simulator keeps its arrays.

The gains of laws are an array that kernels read (`Drives.law_gain`), with one law for each point of a profile. On how
far they may bend rods depends how finely contact is looked for between stations. Nothing else of a model depends on
them, as long as no more rods may meet.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from bilayer_core.jit.record import Record
from bilayer_core.model.model import Model

Array = np.ndarray
GAINS = {"scene", "law_gain"}
SPACING = {"sharpest", "coarsest"}
"""How finely contact is looked for."""


def alike_but_gains(model: Model, other: Model, besides: Collection[str] = ()) -> bool:
    """Return whether two models have the same arrays but for the gains of laws, of which they have as many, and
    `besides` those with some names.
    """
    return len(model.drives.law_gain) == len(other.drives.law_gain) and _alike(model, other, {*GAINS, *besides})


def put_gains(model: Model, gains: Array) -> None:
    """Write gains into a model in place, and so into whatever was built from it."""
    held = model.drives.law_gain
    held.flags.writeable = True
    held[:] = gains
    held.flags.writeable = False


def _alike(one: Any, other: Any, differing: Collection[str]) -> bool:
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if type(one) is not type(other):
        return False
    names: Iterable[str] = ()
    if isinstance(one, Record):
        names = one.names if one.exists else ()
        if one.exists != other.exists:
            return False
    elif is_dataclass(one):
        names = [part.name for part in fields(one)]
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(_alike(*pair, differing) for pair in zip(one, other, strict=True))
    return all(_alike(getattr(one, name), getattr(other, name), differing) for name in names if name not in differing)
