"""What all parts of a scene are made of."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from bilayer_core.scene.faults import refuse, shortened
from bilayer_core.scene.units import (
    Length,
    Number,
)

LONGEST_REPR = 1500
"""Characters: what a screen shows."""
UNIT_LENGTH_TOLERANCE = 1e-14
"""A direction this near to length 1 is kept as it is, so that a dumped scene is read back bit for bit."""


def unit_vector(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """The vector at length 1, or a fault if it has none."""
    length = math.hypot(*vector)
    if length == 0.0:
        raise refuse("must be a direction, with a length above 0")
    if abs(length - 1.0) <= UNIT_LENGTH_TOLERANCE:
        return vector
    return tuple(component / length for component in vector)


Name = Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*$")]
"""Fit for key paths, for ROS topics and for file names."""
Point = tuple[Length, Length, Length]
Direction = Annotated[tuple[Number, Number, Number], AfterValidator(unit_vector)]
"""Unit vector; a file may give any length."""


class Part(BaseModel):
    """Unknown keys are faults, and nothing changes after validation."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __repr__(self) -> str:
        return shortened(super().__repr__(), LONGEST_REPR)

    __str__ = __repr__
