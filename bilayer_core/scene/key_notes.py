"""Notes of the classes of a scene on their keys: the strings below the fields, read from the source.

They are read when somebody asks for them, not when a scene is loaded.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator
from functools import cache
from typing import Any, get_args

from pydantic import BaseModel

from bilayer_core.scene.config import SceneConfig


@cache
def notes(model: type[BaseModel]) -> dict[str, str]:
    """Return the description of each field of a class that has one, including fields of its base classes."""
    found: dict[str, str] = {}
    for ancestor in reversed(model.__mro__):
        if issubclass(ancestor, BaseModel) and ancestor is not BaseModel:
            found |= dict(_own_notes(ancestor))
    return found


def _own_notes(model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    """Return the name of each field, and the string that stands below it."""
    body = ast.parse(textwrap.dedent(inspect.getsource(model))).body[0].body
    for field, text in zip(body, body[1:], strict=False):
        is_field = isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if is_field and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            yield field.target.id, " ".join(text.value.value.split())


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the classes in an annotation, in its order; for a class with parameters, the class without them."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation.__pydantic_generic_metadata__["origin"] or annotation]
    return [model for part in get_args(annotation) for model in models_in(part)]


def scene_models() -> list[type[BaseModel]]:
    """Return all classes of a scene, each one before those that it refers to for the first time."""
    found: dict[type[BaseModel], None] = {}

    def visit(model: type[BaseModel]) -> None:
        if model in found:
            return
        found[model] = None
        for field in model.model_fields.values():
            for part in models_in(field.annotation):
                visit(part)

    visit(SceneConfig)
    return list(found)


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of scene files, with the descriptions of all keys."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **SceneConfig.model_json_schema(by_alias=True),
    }
    for model in scene_models():
        for described in _definitions(schema, model):
            for name, field in model.model_fields.items():
                own = described["properties"][field.alias or name]
                allowed = own.get("description", "")
                told = [notes(model).get(name), allowed and f"{allowed[0].upper()}{allowed[1:]}."]
                if any(told):
                    own["description"] = " ".join(filter(None, told))
    return schema


def _definitions(schema: dict[str, Any], model: type[BaseModel]) -> list[dict[str, Any]]:
    """Return where a JSON Schema describes a class; several places for a class with parameters."""
    if model is SceneConfig:
        return [schema]
    name = model.__name__
    return [found for key, found in schema["$defs"].items() if key == name or key.startswith(f"{name}_")]
