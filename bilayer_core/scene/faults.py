"""Faults of a scene: how checks report them, and how they are told to the user.

One line a fault: file, key path (items of lists by their names), the value found, what is allowed.
"""

from __future__ import annotations

import difflib
import json
import types
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from bilayer_core.printable import shortened

ROUNDING = 1e-9
"""Relative difference of typed numbers that is not taken for a fault."""

LONGEST_VALUE, LONGEST_LIST = 60, 600
"""Characters of a found value and of a list of names that are shown."""
MOST_FAULTS = 100
"""That are told; one mistake may be in every item of a long list."""

Location = tuple[str | int, ...]
Fault = tuple[Location, Any, str]
"""Where (keys and indices), the value found, and what is allowed (a text that goes on after "found ...;")."""

_DEMANDS = {
    "missing": "is missing",
    "string_type": "must be text",
    "string_too_long": "must be a name of at most 100 characters",
    "string_pattern_mismatch": "must be a name: letters, digits and single underscores, a letter first",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "dict_type": "must be a mapping of keys to values",
    "model_type": "must be a mapping of keys to values",
    "model_attributes_type": "must be a mapping of keys to values",
}
"""What pydantic's own kinds of error demand; the kinds with a number or a choice in them are in `_demand`."""


def refuse(demand: str, note: str = "") -> PydanticCustomError:
    """Return the exception by which a validator says what is allowed for a value; `note` is about the value found."""
    return PydanticCustomError("fault", "{demand}", {"demand": demand, "note": note})


def refuse_all(title: str, faults: Sequence[Fault]) -> None:
    """Raise pydantic's ValidationError with every fault in its place, if there is any."""
    if faults:
        details = [InitErrorDetails(type=refuse(demand), loc=where, input=found) for where, found, demand in faults]
        raise ValidationError.from_exception_data(title, details)


def one_of(what: str, found: object, allowed: Iterable[str]) -> str:
    """Return the demand that a name be one of those allowed, with the nearest one as a suggestion."""
    names = [str(name) for name in allowed]
    return f"must be one of the {what} ({listed(names) or 'there are none'}){suggestion(found, names)}"


def listed(names: Iterable[str]) -> str:
    """Return the names in a row, cut off where they get long."""
    return shortened(", ".join(names), LONGEST_LIST)


def suggestion(found: object, allowed: Iterable[str]) -> str:
    """Return the name nearest to the one found, as a question; empty if none is near."""
    near = difflib.get_close_matches(str(found), list(allowed), n=1)
    return f", did you mean {near[0]}?" if near else ""


def tell(error: ValidationError, schema: type[BaseModel], data: Any, source: str) -> str:
    """Return all faults of `error` as lines of text.

    `error`: what validation of `data` against `schema` raised. `data`: the raw content of the scene, for the names of
    list items. `source`: file, or another origin, to begin each line with.
    """
    faults = error.errors(include_url=False)
    lines = [f"{source}: {_line(fault, schema, data)}" for fault in faults[:MOST_FAULTS]]
    if len(faults) > MOST_FAULTS:
        lines.append(f"{source}: and {len(faults) - MOST_FAULTS} more faults")
    return "\n".join(lines)


def _line(fault: ErrorDetails, schema: type[BaseModel], data: Any) -> str:
    path = key_path(fault["loc"], data)
    if fault["type"] == "missing":
        return f"{path}: is missing; {_expected(schema, fault['loc'])}"
    if fault["type"] == "extra_forbidden":
        keys = _keys(_annotation_at(schema, fault["loc"][:-1]))
        return f"{path}: unknown key{suggestion(fault['loc'][-1], keys)}; allowed are {', '.join(keys)}"
    note = fault.get("ctx", {}).get("note")
    if fault["type"] == "union_tag_not_found":
        key = fault["ctx"]["discriminator"].strip("'")
        members = filter(_is_model, get_args(_bare(_annotation_at(schema, fault["loc"]))))
        tags = ", ".join(f"'{tag}'" for member in members for tag in _own_tags(member, key))
        return f"{path}: found {_shown(fault['input'])}; the key '{key}' is missing, which is one of {tags}"
    return f"{path}: found {_shown(fault['input'])}{f', {note}' if note else ''}; {_demand(fault)}"


def _demand(fault: ErrorDetails) -> str:
    kind, context = fault["type"], fault.get("ctx", {})
    if kind == "fault":
        return context["demand"]
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind == "union_tag_invalid":
        return f"`{context['discriminator'].strip(chr(39))}` must be one of {context['expected_tags']}" + suggestion(
            context["tag"], [tag.strip(" '") for tag in context["expected_tags"].split(",")]
        )
    if kind == "too_short":
        return f"must have at least {context['min_length']} entries, has {context['actual_length']}"
    if kind == "too_long":
        return f"must have at most {context['max_length']} entries, has {context['actual_length']}"
    return _DEMANDS.get(kind, fault["msg"])


def key_path(location: Location, data: Any) -> str:
    """Return the key path as a user writes it, such as ``rods.arm.layers.active.thickness`` or ``gravity[2]``.

    pydantic puts the chosen type of a union into its location, given or by default; that is not a key of the file and
    is left out.
    """
    path, here = "", data
    for place, part in enumerate(location):
        if part == "[key]":
            continue
        if isinstance(part, int):
            if isinstance(here, dict):  # which stands for a list of one
                continue
            item = here[part] if isinstance(here, list | tuple) and part < len(here) else None
            name = item.get("name") if isinstance(item, dict) else None
            path += f".{shortened(name)}" if isinstance(name, str) else f"[{part}]"
            here = item
        elif (
            isinstance(here, dict)
            and part not in here
            and place < len(location) - 1
            and (part in here.values() or "type" not in here)
        ):
            continue
        else:
            path += f".{shortened(part)}"
            here = here.get(part) if isinstance(here, dict) else None
    return path.removeprefix(".") or "scene"


def _shown(value: Any) -> str:
    text = json.dumps(value, default=str, ensure_ascii=False) if not isinstance(value, BaseModel) else str(value)
    return shortened(text, LONGEST_VALUE)


# What the schema expects at a place, from the annotations of its classes


def _bare(annotation: Any) -> Any:
    """Return an annotation without ``Annotated`` and without ``| None``."""
    while True:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
            continue
        members = get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else ()
        rest = [member for member in members if member is not type(None)]
        if len(rest) != 1:
            return annotation
        annotation = rest[0]


def _field(model: type[BaseModel], key: str | int) -> Any:
    for name, field in model.model_fields.items():
        if key == (field.alias or name):
            return Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
    return Any


def _annotation_at(schema: Any, location: Location) -> Any:
    for part in location:
        bare = _bare(schema)
        if _is_model(bare):
            schema = _field(bare, part)
        elif get_origin(bare) in (Union, types.UnionType):
            tagged = [member for member in get_args(bare) if part in _tags(member)]
            schema = tagged[0] if tagged else _field(_only_model(bare), part)
        elif get_origin(bare) is dict:
            schema = get_args(bare)[1]
        elif get_origin(bare) in (list, tuple):
            schema = get_args(bare)[0]
    return schema


def _tags(member: Any) -> tuple[Any, ...]:
    """Return the values by which a member of a discriminated union is chosen."""
    if not _is_model(member):
        return ()
    choices = [field.annotation for field in member.model_fields.values() if get_origin(field.annotation) is Literal]
    return tuple(tag for choice in choices for tag in get_args(choice))


def _own_tags(member: Any, key: str) -> tuple[Any, ...]:
    """Return the values of one key by which a member of a discriminated union is chosen."""
    return get_args(member.model_fields[key].annotation)


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _only_model(annotation: Any) -> Any:
    """Return the class of a value's annotation; where plain values are allowed as well, the class among them."""
    return annotation if _is_model(annotation) else next(filter(_is_model, get_args(annotation)), BaseModel)


def _keys(annotation: Any) -> list[str]:
    model = _only_model(_bare(annotation))
    return [field.alias or name for name, field in model.model_fields.items()]


def _expected(schema: type[BaseModel], location: Location) -> str:
    """Return the text that says what to write for a missing key."""
    annotation = _annotation_at(schema, location)
    for extra in get_args(annotation)[1:] if get_origin(annotation) is Annotated else ():
        describe = getattr(getattr(extra, "func", None), "describe", None)
        if describe:
            return f"must be {describe()}"
    bare = _bare(annotation)
    if get_origin(bare) is Literal:
        return f"must be {' or '.join(repr(value) for value in get_args(bare))}"
    if get_origin(bare) in (list, tuple):
        return "must be a list"
    if bare is str:
        return "must be text"
    return "must be a mapping of keys to values"


def repeated(named: list[tuple[Location, str]], among: str) -> Iterator[Fault]:
    """Yield a fault for each name that occurs twice."""
    seen: set[str] = set()
    for where, name in named:
        if name in seen:
            yield where, name, f"must be a name of its own among the {among}"
        seen.add(name)


def faults_of_rounding(rounding: float, largest: float, what: str) -> list[Fault]:
    """Return a fault if a shape has no room for the radius of its edges, otherwise an empty list."""
    if rounding <= (1.0 + ROUNDING) * largest:
        return []
    return [(("rounding",), rounding, f"must be at most {what} ({largest:g} m)")]
