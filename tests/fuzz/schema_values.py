"""Values that the schema of scenes allows, drawn at random: what valid but rarely used keys are made of."""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from hypothesis import strategies as st
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, PydanticUndefined

from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.part import unit_vector
from bilayer_core.scene.units import Count, Quantity, parse_quantity

FILES = ("table.csv", "points.csv", "empty.csv", "text.csv", "missing.csv", "../table.csv", "")
"""Names for the key `file`; the first four are there (`fuzz.worker`)."""
FACTORS = (1.0, 0.5, 2.0, 5.0, 0.1, 10.0, 50.0, -1.0, 0.0)
"""Times the example of a quantity: numbers of its usual size."""
UNUSUAL = (0.0, 1.0, -1.0, 0.3, 1e-9, 1e-5, 1e-3, 30.0, 1e3, 1e6, 1e12, -1e3, 1e-29, 9e29)
COUNTS = (0, 1, 2, 3, 4, 5, 7, 8, 12, 20, 64)
INCREASING = ("at", "times", "interval", "limits")
"""Keys of lists that must increase."""
ALIKE = (("at", "value"), ("times", "values"), ("times", "displacements", "rotations"), ("points", "normals"))
"""Keys of lists of one length."""
REFERENCES = {
    "stimulus": "stimuli",
    "stimuli": "stimuli",
    "material": "materials",
    "rod": "rods",
    "body": "bodies",
    "bodies": "bodies",
    "clamp_start": "bodies",
    "clamp_end": "bodies",
}
"""Keys that hold names, and where the parts of these names stand."""
MOST_NESTED = 7
Path = tuple[str | int, ...]


def names_in(scene: Any, section: str) -> list[str]:
    """Names of the parts of a section of a scene, however odd the scene is."""
    parts = scene.get(section) if isinstance(scene, dict) else None
    if isinstance(parts, dict):
        return [name for name in parts if isinstance(name, str)]
    found = [part.get("name") for part in parts if isinstance(part, dict)] if isinstance(parts, list) else []
    return [name for name in found if isinstance(name, str)]


class Drawer:
    """Draws values for keys of one scene.

    Parameters
    ----------
    draw : callable
        Of `hypothesis`, which takes a strategy.
    scene : mapping
        Whose names the values refer to.
    """

    def __init__(self, draw: Any, scene: Any):
        self.draw, self.scene = draw, scene

    def one(self, choices: Any) -> Any:
        """One of several values."""
        return self.draw(st.sampled_from(list(choices)))

    def chance(self, part: int) -> bool:
        """True once in so many times."""
        return self.draw(st.integers(0, part - 1)) == part - 1

    def field(self, field: FieldInfo, key: str, depth: int = 0) -> Any:
        """A value for a field of a class."""
        return self.value(field.annotation, field.metadata, key, depth)

    def model(self, model: type[BaseModel], depth: int = 0) -> dict[str, Any]:
        """Keys that must be given, and a few that need not."""
        found = {}
        for name, field in model.model_fields.items():
            if depth < MOST_NESTED and (field.is_required() or self.chance(4)):
                key = field.alias or name
                found[key] = self.field(field, key, depth + 1)
        return _consistent(found)

    def value(self, annotation: Any, metadata: Any, key: str, depth: int) -> Any:
        """A value for an annotation with its metadata."""
        if get_origin(annotation) is Annotated:
            annotation, *more = get_args(annotation)
            return self.value(annotation, [*metadata, *more], key, depth)
        flat = [part for item in metadata for part in (item.metadata if isinstance(item, FieldInfo) else [item])]
        for item in flat:
            validator = getattr(item, "func", None)
            if isinstance(validator, Quantity):
                return self.number(validator)
            if isinstance(validator, Count):
                fitting = [count for count in COUNTS if validator.at_least <= count <= validator.at_most]
                return self.one(fitting or [validator.at_least])
            if validator is unit_vector:
                return [self.one((0.0, 0.0, 1.0, -1.0, 0.5)) for _ in range(2)] + [self.one((1.0, 0.0, -0.3))]
            written = getattr(item, "json_schema_input_type", PydanticUndefined)
            if written is not PydanticUndefined:
                return self.value(written, (), key, depth)
        sizes = ("min_length", "max_length")
        lengths = {
            name: getattr(item, name) for item in flat for name in sizes if getattr(item, name, None) is not None
        }
        return self._bare(annotation, lengths, key, depth)

    def number(self, quantity: Quantity) -> float | str:
        """A number that a quantity allows, as a rule of its usual size."""
        usual = parse_quantity(quantity.example, quantity.unit) if quantity.example else 1.0
        if self.chance(12):
            return quantity.example or 1.0
        choices = UNUSUAL if self.chance(6) else [factor * usual for factor in FACTORS]
        return self.one([number for number in choices if _allows(quantity, number)] or [quantity.example])

    def _bare(self, annotation: Any, lengths: dict[str, int], key: str, depth: int) -> Any:
        origin, parts = get_origin(annotation), get_args(annotation)
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            return self.model(annotation, depth)
        if isinstance(annotation, TypeVar) or annotation in (float, Any):
            return self.one(UNUSUAL)
        if annotation is bool:
            return self.one((True, False))
        if annotation is int:
            return self.one(COUNTS)
        if annotation is str:
            return self._text(key)
        if annotation is type(None):
            return None
        if origin is Literal:
            return self.one(parts)
        if origin in (Union, types.UnionType):
            given = [part for part in parts if part is not type(None)]
            return (
                self.value(self.one(given), (), key, depth)
                if not self.chance(12)
                else self.value(self.one(parts), (), key, depth)
            )
        if origin is tuple:
            found = [self.value(part, (), key, depth) for part in parts]
            return _sorted(found) if key in INCREASING else found
        if origin is list:
            count = self.one((1, 2, 2, 3, 4))
            count = max(lengths.get("min_length", 0), min(count, lengths.get("max_length", count)))
            found = [self.value(parts[0], (), key, depth) for _ in range(count)]
            return _sorted(found) if key in INCREASING else found
        if origin is dict:
            count = self.one((1, 1, 2))
            return {self._text(key): self.value(parts[1], (), key, depth) for _ in range(count)}
        raise TypeError(f"no values for {annotation!r}; teach {__name__}")

    def _text(self, key: str) -> str:
        known = names_in(self.scene, REFERENCES[key]) if key in REFERENCES else []
        if known and not self.chance(12):
            name = self.one(known)
            return f"{name}_0" if key == "rod" and self.chance(4) else name
        if key == "file":
            return self.one(FILES)
        if key.endswith("_column"):
            return self.one(("time", "value", "other"))
        return self.one(("extra", "other", "arm_1", "a"))


def models_at(annotation: Any, data: Any, path: Path = ()) -> Iterator[tuple[Path, type[BaseModel]]]:
    """Key paths of the mappings of a scene, each with the class that reads it."""
    if get_origin(annotation) is Annotated:
        annotation, *metadata = get_args(annotation)
        written = [getattr(item, "json_schema_input_type", PydanticUndefined) for item in metadata]
        known = [one for one in written if one is not PydanticUndefined]
        yield from models_at(known[0] if known and annotation is not float else annotation, data, path)
        return
    origin, parts = get_origin(annotation), get_args(annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if isinstance(data, dict):
            yield path, annotation
            for name, field in annotation.model_fields.items():
                key = field.alias or name
                if key in data:
                    whole = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
                    yield from models_at(whole, data[key], (*path, key))
    elif origin in (Union, types.UnionType):
        members = [part for part in parts if not isinstance(data, list) or get_origin(part) is list]
        for member in members if isinstance(data, dict | list) else ():
            if _tagged(member, data):
                yield from models_at(member, data, path)
                return
    elif origin is list and isinstance(data, list):
        for index, item in enumerate(data):
            yield from models_at(parts[0], item, (*path, index))
    elif origin is dict and isinstance(data, dict):
        for key, item in data.items():
            yield from models_at(parts[1], item, (*path, key))


def models_of(scene: Any) -> list[tuple[Path, type[BaseModel]]]:
    """Those of a whole scene."""
    return list(models_at(SceneConfig, scene))


def _tagged(member: Any, data: Any) -> bool:
    """Whether the keys `type` and `shape` say that a mapping is of this class; those without a tag take any."""
    if not (isinstance(member, type) and issubclass(member, BaseModel)):
        return get_origin(member) in (list, dict, Annotated, Union, types.UnionType)
    for key in ("type", "shape"):
        field = member.model_fields.get(key)
        if field is not None and get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1:
            return isinstance(data, dict) and data.get(key, field.default) in get_args(field.annotation)
    return True


def _allows(quantity: Quantity, number: float) -> bool:
    try:
        quantity(number)
    except PydanticCustomError:
        return False
    return True


def _sorted(values: list) -> list:
    return sorted(set(values)) if all(isinstance(value, float) for value in values) else values


def _consistent(found: dict[str, Any]) -> dict[str, Any]:
    """Lists that belong together at one length, and motions that begin at the start."""
    for keys in ALIKE:
        lists = [key for key in keys if isinstance(found.get(key), list)]
        if len(lists) > 1:
            length = min(len(found[key]) for key in lists)
            found |= {key: found[key][:length] for key in lists}
    for key in ("displacements", "rotations"):
        if found.get(key):
            found[key][0] = [0.0, 0.0, 0.0]
    return found
