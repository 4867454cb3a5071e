"""A `Description` as text for the metadata of a log, and back."""

from __future__ import annotations

import json
from dataclasses import asdict, fields

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.observed.frame import BodyInfo, Description, JointInfo, ObstacleInfo, ShapeInfo, Strand

LATER = ("joints", "channel_units")
"""What older logs do not have."""


def _plain(value):
    """What JSON has no notation for, as lists."""
    if isinstance(value, slice):
        return [value.start, value.stop]
    return np.asarray(value).tolist()


def _shape(values: dict) -> ShapeInfo:
    """A shape from its attributes, in which JSON has made lists of tuples."""
    return ShapeInfo(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})


def _strand(values: dict) -> Strand:
    """A strand from its attributes; older logs have neither offset nor curvature nor layers nor closed ones."""
    none = np.zeros(len(values["width"]))
    return Strand(
        **{name: values[name] for name in ("name", "rod", "layer")},
        **{name: slice(*values[name]) for name in ("nodes", "edges")},
        **{name: np.array(values[name]) for name in ("width", "thickness")},
        **{name: np.array(values.get(name, none)) for name in ("offset", "curvature")},
        layers=tuple(map(_strand, values.get("layers", ()))),
        closed=values.get("closed", False),
    )


def to_text(description: Description) -> dict[str, str]:
    """One JSON value for each attribute but the scene's text, which a log holds as an attachment."""
    attributes = asdict(description)
    del attributes["scene_text"]
    return {name: json.dumps(value, default=_plain) for name, value in attributes.items()}


def from_text(attributes: dict[str, str], scene_text: str) -> Description:
    """The description of which `attributes` is `to_text`."""
    names = [item.name for item in fields(Description) if item.name != "scene_text"]
    values = {name: json.loads(attributes[name]) for name in names if name in attributes or name not in LATER}
    values["strands"] = tuple(map(_strand, values["strands"]))
    values["bodies"] = tuple(
        BodyInfo(**body | {"shape": _shape(body["shape"]) if body["shape"] else None}) for body in values["bodies"]
    )
    values["obstacles"] = tuple(ObstacleInfo(part["name"], _shape(part["shape"])) for part in values["obstacles"])
    joints = values.get("joints", ())
    values["joints"] = tuple(JointInfo(part["name"], part["body"], _shape(part["shape"])) for part in joints)
    values["channels"] = tuple(values["channels"])
    values["channel_ranges"] = tuple((lower, upper) for lower, upper in values["channel_ranges"])
    values["channel_units"] = tuple(values.get("channel_units", [""] * len(values["channels"])))
    values["state_layout"] = tuple((name, tuple(shape)) for name, shape in values["state_layout"])
    return Description(scene_text=scene_text, **values)


def to_json(description: Description) -> str:
    """All of it as one JSON object, the scene's text included."""
    values = {name: json.loads(text) for name, text in to_text(description).items()}
    return json.dumps({**values, "scene_text": description.scene_text}, ensure_ascii=False)


def from_json(text: str) -> Description:
    """The description of which `text` is `to_json`.

    Raises
    ------
    InputError
        If it is none, or that of another version.
    """
    try:
        values = json.loads(text)
        scene = values.pop("scene_text")
        return from_text({name: json.dumps(value) for name, value in values.items()}, scene)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError("what describes the run is not understood: it is of another version, or damaged") from error
