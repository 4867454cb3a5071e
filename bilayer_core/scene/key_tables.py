"""Every key of a scene as a page of tables in Markdown, made from the classes that are the schema."""

from __future__ import annotations

import types
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.key_notes import models_in, notes, scene_models
from bilayer_core.scene.part import unit_vector
from bilayer_core.scene.units import Count, Quantity

INTRODUCTION = """\
# Every key of a scene file

Made by `bilayer schema --markdown` from the classes that read scene files.

- Plain numbers are in the unit of the column *unit*. Texts with a unit are converted: `1 mm`, `100 MPa`, `50 %`.
- A key with the default **required** must be given wherever its mapping is. Unknown keys are refused.
- A *name* has letters, digits and single underscores, a letter first.
- `NAME` and `N` in a path stand for the name or the number of an item, in `--set` as well:
  `--set rods.arm.stations=100`.
- Where one of several mappings may stand, `type` or `shape` must say which one it is, unless it is the default."""
TAGS = ("type", "shape")
HEADER = ("key", "type", "unit", "default", "allowed", "description")


@dataclass(frozen=True)
class Kind:
    """Values that may stand for a key: their type, unit and range, as text."""

    type: str
    unit: str = ""
    allowed: str = ""


def page() -> str:
    """Return the page, with a section for each class."""
    places = _places()
    sections = [INTRODUCTION, _contents(places)]
    for model in scene_models():
        lines = [f"## {_title(model)}", "", _about(model), ""]
        if model is not SceneConfig:
            lines += [f"Stands at {', '.join(f'`{place}`' for place in places[model])}{_choice(model)}.", ""]
        rows = [HEADER, ("---",) * len(HEADER), *_rows(model)]
        lines += ["| " + " | ".join(text.replace("|", r"\|") for text in row) + " |" for row in rows]
        sections.append("\n".join(lines))
    return "\n\n".join(sections) + "\n"


def _contents(places: dict[type[BaseModel], list[str]]) -> str:
    """List the sections by the paths at which they stand; alternatives at one path share a line."""
    sections: dict[str, list[str]] = {}
    for model, paths in places.items():
        sections.setdefault(paths[0], []).append(_link(model))
    lines = {f"`{path}`" if path else "the whole": ", ".join(links) for path, links in sections.items()}
    return "\n".join(f"- {path}: {links}" for path, links in lines.items())


def _about(model: type[BaseModel]) -> str:
    """Return the docstring of a class as Markdown."""
    return "\n\n".join(" ".join(part.split()) for part in (model.__doc__ or "").split("\n\n")).replace("``", "`")


def _title(model: type[BaseModel]) -> str:
    return "Scene" if model is SceneConfig else model.__name__


def _link(model: type[BaseModel]) -> str:
    return f"[{_title(model)}](#{_title(model).lower()})"


def _tag(model: type[BaseModel]) -> tuple[str, Any] | None:
    """Return the key and value that distinguish this mapping from its alternatives."""
    for name in TAGS:
        field = model.model_fields.get(name)
        values = get_args(field.annotation) if field is not None and get_origin(field.annotation) is Literal else ()
        if len(values) == 1:
            return name, values[0]
    return None


def _choice(model: type[BaseModel]) -> str:
    tag = _tag(model)
    if not tag:
        return ""
    return f", with `{tag[0]}: {tag[1]}`{'' if model.model_fields[tag[0]].is_required() else ', the default'}"


def _places() -> dict[type[BaseModel], list[str]]:
    """Return the key paths at which each class may stand; a class inside itself is not followed."""
    places: dict[type[BaseModel], list[str]] = {}

    def visit(model: type[BaseModel], path: str, around: tuple[type[BaseModel], ...]) -> None:
        here = places.setdefault(model, [])
        if path not in here:
            here.append(path)
        if model in around:
            return
        for name, field in model.model_fields.items():
            key = f"{path}.{field.alias or name}".lstrip(".")
            for part in models_in(field.annotation):
                visit(part, key + _item(field.annotation, part), (*around, model))

    visit(SceneConfig, "", ())
    return {model: sorted(paths, key=lambda path: path.count(".")) for model, paths in places.items()}


def _item(annotation: Any, model: type[BaseModel]) -> str:
    """Return how an item of a list or a mapping is addressed."""
    origin = get_origin(annotation)
    if origin is dict or (origin is list and "name" in model.model_fields):
        return ".NAME"
    return ".N" if origin is list else ""


def _rows(model: type[BaseModel]) -> Iterator[tuple[str, ...]]:
    tag, _ = _tag(model) or ("", None)
    for name, field in model.model_fields.items():
        if name != tag:
            kind = _kind_of_field(field)
            yield (f"`{field.alias or name}`", kind.type, kind.unit, _default(field), kind.allowed, notes(model)[name])


def _default(field: FieldInfo) -> str:
    value = field.default
    if value is PydanticUndefined:
        return "**required**"
    if isinstance(value, BaseModel):
        return "its defaults"
    if value is None or value == [] or value == {}:
        return "none"
    if value == "":
        return "empty"
    return f"`{_written(value)}`"


def _written(value: Any) -> str:
    """Return a value as a scene file has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_written, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _kind_of_field(field: FieldInfo) -> Kind:
    kind = _kind(field.annotation, field.metadata)
    if field.discriminator:
        return replace(kind, allowed=f"chosen by `{field.discriminator}`")
    return kind


def _kind(annotation: Any, metadata: list[Any] | tuple[Any, ...] = ()) -> Kind:
    """Return the kind of values that an annotation with its metadata accepts."""
    if get_origin(annotation) is Annotated:
        annotation, *more = get_args(annotation)
        return _kind(annotation, [*metadata, *more])
    flat = [part for item in metadata for part in (item.metadata if isinstance(item, FieldInfo) else [item])]
    for item in flat:
        validator = getattr(item, "func", None)
        if isinstance(validator, Quantity):
            return _kind_of_quantity(validator)
        if isinstance(validator, Count):
            return Kind("whole number", allowed=f"≥ {validator.at_least}")
        if validator is unit_vector:
            return Kind("list of 3 numbers", "1", "a direction of any length above 0")
        written = getattr(item, "json_schema_input_type", PydanticUndefined)
        if written is not PydanticUndefined:
            return _kind(written)
    limits = {key: value for item in flat for key, value in _lengths(item)}
    pattern = any(getattr(item, "pattern", None) for item in flat)
    if annotation is str:
        return Kind("name" if pattern else "text")
    kind = _kind_of_bare(annotation)
    return replace(kind, allowed=_count(limits)) if limits else kind


def _kind_of_quantity(quantity: Quantity) -> Kind:
    limits = ((">", quantity.above), ("≥", quantity.at_least), ("≤", quantity.at_most))
    allowed = ", ".join(f"{sign} {_written(limit)}" for sign, limit in limits if limit is not None)
    return Kind("number", quantity.unit or "the channel's", allowed)


def _lengths(item: Any) -> Iterator[tuple[str, int]]:
    for key in ("min_length", "max_length"):
        value = getattr(item, key, None)
        if value is not None:
            yield key, value


def _count(limits: dict[str, int]) -> str:
    least, most = limits.get("min_length", 0), limits.get("max_length")
    return f"{least} or more items" if most is None else f"{least} to {most} items"


def _kind_of_bare(annotation: Any) -> Kind:
    """Return the kind of values that an annotation without metadata accepts."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return Kind(_link(*models_in(annotation)))
    if isinstance(annotation, TypeVar):
        return Kind("number", "the key's")
    if annotation is bool:
        return Kind("true or false")
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        return _kind_of_union([part for part in parts if part is not type(None)])
    if origin is Literal:
        chosen = "constant" if len(parts) == 1 else "choice"
        return Kind(chosen, allowed=", ".join(f"`{part}`" for part in parts))
    if origin is tuple:
        kinds = [_kind(part) for part in parts]
        limits = list(dict.fromkeys(kind.allowed for kind in kinds))
        return Kind(f"list of {len(parts)} {kinds[0].type}s", kinds[0].unit, "; ".join(limits) if any(limits) else "")
    if origin is list:
        kind = _kind(parts[0])
        of_many = kind.type if kind.type.startswith("[") else kind.type.replace("list", "lists", 1)
        single = of_many == "whole number" or (" " not in of_many and not of_many.startswith("["))
        of_many = f"{of_many}s" if single else of_many
        return replace(kind, type=f"list of {of_many}")
    if origin is dict:
        return replace(_kind(parts[1]), type=f"{_kind(parts[1]).type} by name")
    raise TypeError(f"no text for {annotation!r}; teach {__name__}")


def _kind_of_union(members: list[Any]) -> Kind:
    kinds = [_kind(member) for member in members]
    if len(kinds) == 1:
        return kinds[0]
    return replace(kinds[0], type=" or ".join(kind.type for kind in kinds))
