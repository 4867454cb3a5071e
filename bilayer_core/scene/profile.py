"""Values that may vary along the path of a rod: a number, or points between which they are linear."""

from __future__ import annotations

from typing import Annotated, Any, Generic, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter

from bilayer_core.scene.faults import Fault
from bilayer_core.scene.part import Part
from bilayer_core.scene.units import NonNegativeLength, Quantity

Value = TypeVar("Value")


class Profile(Part, Generic[Value]):
    """Values at lengths along the path, linear between them and constant outside."""

    at: list[NonNegativeLength] = Field(min_length=1)
    """Along the path, increasing."""
    value: list[Value] = Field(min_length=1)
    """As many as there are places."""

    def __hash__(self) -> int:
        return hash((*self.at, *self.value))

    @classmethod
    def model_parametrized_name(cls, params: tuple[Any, ...]) -> str:
        """Return the title in the JSON Schema."""
        return f"Profile of {_quantity(params[0]).what}"

    def _faults(self) -> list[Fault]:
        faults: list[Fault] = [
            (("at", index), after, f"must be further than the place before it ({before:g} m)")
            for index, (before, after) in enumerate(zip(self.at, self.at[1:], strict=False), start=1)
            if after <= before
        ]
        if len(self.at) != len(self.value):
            faults.append((("value",), f"{len(self.value)} entries", f"must be as many as `at`, {len(self.at)}"))
        return faults


def _quantity(annotation: Any) -> Quantity:
    """Return the validator in an annotation from `scene.units`."""
    return annotation.__metadata__[0].func


class _Varying:
    """Validator of a number or a profile; a profile's faults stand at its own keys."""

    def __init__(self, quantity: Any):
        self._number = TypeAdapter(quantity)
        self._profile = TypeAdapter(Profile[quantity])
        self._quantity = _quantity(quantity)

    def describe(self) -> str:
        """Return a description of the allowed values."""
        return f"{self._quantity.describe()}, or a profile {{at: [...], value: [...]}} along the path"

    def __call__(self, value: Any) -> Any:
        """Return the number or the profile, in SI units."""
        return (self._profile if isinstance(value, dict | Profile) else self._number).validate_python(value)


def varying(quantity: Any) -> Any:
    """Return the annotation of a quantity, itself an annotation from `scene.units`, that may vary along the path."""
    either = quantity | Profile[quantity]
    return Annotated[float | Profile[quantity], BeforeValidator(_Varying(quantity), json_schema_input_type=either)]


def values_at(number_or_profile: float | Profile, along: np.ndarray) -> np.ndarray:
    """Return the values at lengths `along` the path [m], of the same shape."""
    if isinstance(number_or_profile, Profile):
        return np.interp(along, number_or_profile.at, number_or_profile.value)
    values = np.empty(along.shape)
    values.fill(number_or_profile)  # a third of the time of `np.full`
    return values


def means_between(number_or_profile: float | Profile, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the exact means over the spans of a path from `begin` to `end` [m], of the same shape."""
    if not isinstance(number_or_profile, Profile):
        return values_at(number_or_profile, begin)
    at, value = np.array(number_or_profile.at), np.array(number_or_profile.value)
    areas = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(at))])

    def area(along: np.ndarray) -> np.ndarray:
        k = np.clip(np.searchsorted(at, along, side="right") - 1, 0, len(at) - 1)
        inside = np.minimum(np.maximum(along, at[0]), at[-1])
        return (
            areas[k]
            + 0.5 * (value[k] + np.interp(along, at, value)) * (inside - at[k])
            + (np.minimum(along - at[0], 0.0) * value[0] + np.maximum(along - at[-1], 0.0) * value[-1])
        )

    return (area(end) - area(begin)) / (end - begin)


def scaled(number_or_profile: float | Profile, by: float) -> float | Profile:
    """Return a multiple of a number or a profile."""
    if isinstance(number_or_profile, Profile):
        return number_or_profile.model_copy(update={"value": [by * value for value in number_or_profile.value]})
    return by * number_or_profile


def extremes(number_or_profile: float | Profile) -> tuple[float, float]:
    """Return the smallest and largest value."""
    values = number_or_profile.value if isinstance(number_or_profile, Profile) else [number_or_profile]
    return min(values), max(values)
