"""Base class of all parts of a scene, and types of values that they share."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import cache, cached_property
from inspect import Parameter, Signature
from keyword import iskeyword
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from bilayer_core.errors import SceneError
from bilayer_core.names import LONGEST_NAME, NAME
from bilayer_core.printable import shortened
from bilayer_core.scene.faults import Fault, refuse, refuse_all, tell
from bilayer_core.scene.units import (
    AngularSpeed,
    Length,
    Number,
    Speed,
)

Derived = TypeVar("Derived")
LONGEST_REPR = 1500
"""Characters: what a screen shows."""
UNIT_LENGTH_TOLERANCE = 1e-14
"""A direction this near to length 1 is kept as it is, so that a dumped scene is read back bit for bit."""


def unit_vector(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the vector at length 1; raise a fault if its length is zero."""
    length = math.hypot(*vector)
    if length == 0.0:
        raise refuse("must be a direction, with a length above 0")
    if abs(length - 1.0) <= UNIT_LENGTH_TOLERANCE:
        return vector
    return tuple(component / length for component in vector)


Name = Annotated[str, Field(max_length=LONGEST_NAME, pattern=f"^{NAME}$")]
"""See `bilayer_core.names`."""
Point = tuple[Length, Length, Length]
Velocity = tuple[Speed, Speed, Speed]
AngularVelocity = tuple[AngularSpeed, AngularSpeed, AngularSpeed]
Direction = Annotated[tuple[Number, Number, Number], AfterValidator(unit_vector)]
"""Unit vector; a file may give any length."""


class _Kept(dict[Any, tuple[tuple, Any]]):
    """Objects derived from a part. Any two compare equal, so that parts with equal values are equal."""

    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Kept)

    def __ne__(self, other: object) -> bool:
        return not self == other


def _bare(part: Derived) -> Derived:
    """Return a part after removing the values derived from it."""
    values, fields = vars(part), type(part).model_fields
    if len(values) > len(fields):
        for name in values.keys() - fields.keys():
            del values[name]
    return part


class _Made(type(BaseModel)):  # type: ignore[misc]
    """The class of parts: what a program makes by calling one is checked, and told, as the content of a file is."""

    if not TYPE_CHECKING:  # checkers take the signature of the class

        @property
        def __signature__(cls) -> Signature:
            """Signature that editors show: the keys and their defaults."""
            required = {name: Parameter.empty for name, field in cls.model_fields.items() if field.is_required()}
            defaults = {name: field.default for name, field in cls.model_fields.items()} | required | dict(_tags(cls))
            keys = {name: cls.model_fields[name].alias or name for name in defaults}
            named = {name: name if iskeyword(key) else key for name, key in keys.items()}
            return Signature(Parameter(named[k], Parameter.KEYWORD_ONLY, default=of) for k, of in defaults.items())

        @__signature__.setter
        def __signature__(cls, value: object) -> None:
            """Refuse that of pydantic, which writes out every validator."""

        def __call__(cls, **values: Any) -> Any:
            """Return the part. A key with one allowed value, such as the `shape` of a path, need not be given.

            Raises
            ------
            SceneError
                One line for each fault, as `load_scene`.
            """
            fields = cls.model_fields
            content = {fields[name].alias or name: value for name, value in _tags(cls)}
            content |= {(fields[key].alias or key) if key in fields else key: value for key, value in values.items()}
            try:
                return super().__call__(**content)
            except ValidationError as error:
                own = f" {shortened(values['name'])}" if isinstance(values.get("name"), str) else ""
                raise SceneError(
                    tell(error, cls, _plain(content), f"{cls.__name__.removesuffix('Config')}{own}")
                ) from None


@cache
def _tags(of: type[BaseModel]) -> list[tuple[str, Any]]:
    """Return the names of fields that have to be given and allow one value, with that value."""
    choices = {name: get_args(f.annotation) for name, f in of.model_fields.items() if f.is_required()}
    literal = {name for name in choices if get_origin(of.model_fields[name].annotation) is Literal}
    return [(name, values[0]) for name, values in choices.items() if name in literal and len(values) == 1]


def _plain(value: Any) -> Any:
    """Return a value with its parts as mappings, in which faults are found by names."""
    if isinstance(value, BaseModel):
        return value.model_dump(by_alias=True)
    if isinstance(value, Mapping):
        return {key: _plain(held) for key, held in value.items()}
    return [_plain(held) for held in value] if isinstance(value, list | tuple) else value


class Part(BaseModel, metaclass=_Made):
    """Unknown keys are faults, and nothing changes after validation."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(type(self).__name__, list(self._faults()))
        return self

    def _faults(self) -> Iterable[Fault]:
        """Return the faults of values that are right by themselves, and do not go with each other."""
        return ()

    @cached_property
    def _kept(self) -> _Kept:
        return _Kept()

    def keep(self, what: Hashable, others: tuple, make: Callable[[], Derived]) -> Derived:
        """Return an object derived from this part and others that do not change.

        It is no part of what is compared, written or copied.

        Parameters
        ----------
        what : hashable
            Name of the object.
        others : tuple
            The other parts.
        make : callable
            Makes the object when it is first needed.

        Returns
        -------
        object
            That of `make`.
        """
        key = what, *map(id, others)
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = others, make()  # the others stay alive, so that no other has their ids
        return found[1]

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values, and without the values derived from the old ones.

        Parameters
        ----------
        update : mapping, optional
            New values by the names of attributes; they are not validated.
        deep : bool
            Copy the values of attributes as well.

        Returns
        -------
        Part
            Of the same class.
        """
        return _bare(super().model_copy(update=update, deep=deep))

    def __copy__(self) -> Self:
        return _bare(super().__copy__())

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        return _bare(super().__deepcopy__(memo))

    def __getstate__(self) -> dict[Any, Any]:
        state = super().__getstate__()
        fields = type(self).model_fields
        return state | {"__dict__": {name: value for name, value in state["__dict__"].items() if name in fields}}

    def __repr__(self) -> str:
        return shortened(super().__repr__(), LONGEST_REPR)

    __str__ = __repr__
