"""A `Description` as text for the metadata of a log, and back."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from pydantic import ValidationError

from bilayer_core.errors import InputError
from bilayer_core.log.file.json_text import read_json
from bilayer_core.log.messages.description_schema import DescriptionPart, ShapePart, StrandPart
from bilayer_core.observed.frame import BodyInfo, Description, JointInfo, ObstacleInfo, ShapeInfo, Strand
from bilayer_core.printable import shortened

LONGEST_VALUE = 60
"""Characters of a found value that are shown."""


def _plain(value):
    """Return a slice or an array, for which JSON has no notation, as a list."""
    if isinstance(value, slice):
        return [value.start, value.stop]
    return np.asarray(value).tolist()


def _shape(part: ShapePart) -> ShapeInfo:
    return ShapeInfo(**dict(part))


def _strand(part: StrandPart) -> Strand:
    none = np.zeros(len(part.width))
    return Strand(
        **dict(part)
        | {
            "nodes": slice(*part.nodes),
            "edges": slice(*part.edges),
            "offset": none if part.offset is None else part.offset,
            "curvature": none if part.curvature is None else part.curvature,
            "layers": tuple(map(_strand, part.layers)),
        }
    )


def to_text(description: Description) -> dict[str, str]:
    """Return one JSON value for each attribute but the scene's text, which a log holds as an attachment."""
    attributes = asdict(description)
    del attributes["scene_text"]
    return {name: json.dumps(value, default=_plain) for name, value in attributes.items()}


def from_text(attributes: Mapping[str, str], scene_text: str) -> Description:
    """Return the description of which `attributes` is `to_text`.

    Raises InputError with the key, if it has other types, sizes or names than a scene could have.
    """
    known = {name: text for name, text in attributes.items() if name in DescriptionPart.model_fields}
    return _described({name: read_json(text, f"description: {name}") for name, text in known.items()}, scene_text)


def _described(values: Mapping[str, Any], scene_text: str) -> Description:
    try:
        part = DescriptionPart.model_validate(values)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        key = ".".join(str(step) for step in ("description", *fault["loc"]))
        missing = fault["type"] in ("missing", "value_error")
        found = "" if missing else f", found {shortened(reprlib.repr(fault['input']), LONGEST_VALUE)}"
        raise InputError(f"{shortened(key)}: {fault['msg'].removeprefix('Value error, ')}{found}") from None
    return Description(
        scene_text=scene_text,
        **dict(part)
        | {
            "strands": tuple(map(_strand, part.strands)),
            "bodies": tuple(
                BodyInfo(**dict(body) | {"shape": body.shape and _shape(body.shape)}) for body in part.bodies
            ),
            "obstacles": tuple(ObstacleInfo(obstacle.name, _shape(obstacle.shape)) for obstacle in part.obstacles),
            "joints": tuple(JointInfo(joint.name, joint.body, _shape(joint.shape)) for joint in part.joints),
            "channel_units": ("",) * len(part.channels) if part.channel_units is None else part.channel_units,
        },
    )


def to_json(description: Description) -> str:
    """Return all of it as one JSON object, the scene's text included."""
    values = {name: json.loads(text) for name, text in to_text(description).items()}
    return json.dumps({**values, "scene_text": description.scene_text}, ensure_ascii=False)


def from_json(text: str) -> Description:
    """Return the description from its text as written by `to_json`.

    Raises InputError with the key, if the text is not a description, or is one of another version.
    """
    values = read_json(text, "the description of a run")
    if not (isinstance(values, dict) and isinstance(values.get("scene_text"), str)):
        raise InputError("the description of a run: must be a mapping with the scene as text under scene_text")
    return _described({name: value for name, value in values.items() if name != "scene_text"}, values["scene_text"])
