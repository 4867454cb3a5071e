"""Content of a run's log before its first message: scene, description, versions and settings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from bilayer_core import DISTRIBUTION
from bilayer_core.errors import InputError
from bilayer_core.log.file.log_opening import metadata_records, open_log
from bilayer_core.log.file.log_records import (
    ATTACHMENT,
    METADATA,
    DamagedChunk,
    Place,
    content,
    parse,
    read_metadata,
    walk,
)
from bilayer_core.log.messages.description_text import from_text
from bilayer_core.observed.frame import Description
from bilayer_core.printable import shortened

SCENE_ATTACHMENT = "scene.yaml"
LARGEST_SCENE = 5_000_000
"""Text of a scene in a log, whose tables of values are written out in it [bytes]."""
_HEAD = ("description", "versions", "settings")
"""Metadata that every log has before its first chunk."""

_READ = (*_HEAD, "machine")
_OWN = {"description": "state_layout", "versions": DISTRIBUTION}
"""A key of the metadata records by which a log is known."""


@dataclass(frozen=True)
class Head:
    """Content of a log before its first message."""

    description: Description
    versions: dict[str, str]
    settings: dict[str, str]
    machine: dict[str, str]  # empty in older logs


def is_log(path: Path) -> bool:
    """Return whether a file is a log of a run, whole or not, by any of the metadata that only these have.

    Raises InputError if it cannot be read, or is no MCAP file.
    """
    return any(_OWN[name] in values for name, values in metadata_records(path, _OWN))


def read_head(path: Path) -> Head:
    """Return the scene, description, versions and settings: all that comes before the first chunk.

    Raises InputError if the file is no log, with what can be done with a bag of ``ros2 bag record``, or is damaged.
    """
    if path.is_dir() or not is_log(path):
        raise InputError(
            f"{path}: is no log of a run, so it does not hold the scene, the solver settings and all that acted; "
            "`bilayer run --log` and the node's parameter `log` write logs. A bag of `ros2 bag record` can be read by "
            "info, view, plot, export, compare and render"
        )
    metadata: dict[str, dict[str, str]] = {}
    scene = None
    with open_log(path) as file:
        for place in walk(file):
            if place.opcode == ATTACHMENT and scene is None:
                scene = _scene(file, place)
            elif place.opcode == METADATA:
                name, values = read_metadata(content(file, place), _READ)
                metadata |= {name: values} if name in _READ else {}
            if scene is not None and "description" in metadata:
                break
    missing = [name for name in _HEAD if name not in metadata] + ([] if scene is not None else ["scene"])
    if missing:
        what = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        raise InputError(f"{path}: is an MCAP file, but no log of bilayer_sim_ros, or is damaged: {what}")
    versions = metadata["versions"]
    try:
        description = from_text(metadata["description"], scene)
    except InputError as error:
        writer = shortened(versions.get(DISTRIBUTION, "unknown"))
        raise InputError(
            f"{path}: describes its run in another way than this version reads, or is damaged: {error} (it was written "
            f"by {DISTRIBUTION} {writer}); run its scene again"
        ) from None
    return Head(description, versions, metadata["settings"], metadata.get("machine", {}))


def _scene(file: BinaryIO, place: Place) -> str | None:
    """Return the text of the scene, if this attachment is it."""
    from mcap.records import Attachment

    if place.length > LARGEST_SCENE:
        return None
    attachment = parse(Attachment, content(file, place))
    try:
        return attachment.data.decode() if attachment.name == SCENE_ATTACHMENT else None
    except UnicodeDecodeError as error:
        raise DamagedChunk(f"the scene at byte {place.begin} is not UTF-8 text") from error
