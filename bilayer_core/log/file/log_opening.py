"""Log files as such: how they are opened, what shows that they are none, and whether they were finished."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from bilayer_core.errors import InputError
from bilayer_core.log.file.log_records import MAGIC, METADATA, DamagedChunk, content, read_metadata, walk

CONVERT = (
    "convert the bag with `ros2 bag convert -i BAG -o OUT.yaml`, where OUT.yaml says "
    "`output_bags: [{uri: NEW, storage_id: mcap, all: true}]`"
)
_OTHER_BAGS = {b"SQLite f": "is a bag stored with sqlite3", b"\x28\xb5\x2f\xfd": "is compressed as a whole"}
"""First bytes of files of bags that are not read, and what they are."""


@contextmanager
def open_log(path: Path) -> Iterator[BinaryIO]:
    """Yield the open file. If it is not a log, or is damaged, raise an InputError."""
    try:
        with path.open("rb") as file, damage_told(path):
            if (begin := file.read(len(MAGIC))) != MAGIC:
                for magic, what in _OTHER_BAGS.items():
                    if begin.startswith(magic):
                        raise InputError(f"{path}: {what}, which is not read; {CONVERT}")
                raise InputError(f"{path}: is not an MCAP log: it does not begin as one")
            yield file
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def metadata_records(path: Path, wanted: Collection[str]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the name and the content of each metadata record of some names, in the order of the file.

    Raises InputError if it cannot be read, or is no MCAP file, or is damaged.
    """
    with open_log(path) as file:
        for place in walk(file):
            if place.opcode == METADATA:
                name, values = read_metadata(content(file, place), wanted)
                if name in wanted:
                    yield name, values


@contextmanager
def damage_told(path: Path) -> Iterator[None]:
    """Turn an MCAP reader's error about a file that is no log, or is damaged, into an InputError."""
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    try:
        yield
    except DamagedChunk as error:
        raise InputError(
            f"{path}: is damaged: {error}; `bilayer repair` makes a log of what can still be read"
        ) from error
    except (McapError, ZstdError, struct.error, ValueError, KeyError, RuntimeError) as error:  # RuntimeError: lz4's
        # mcap says nothing of a record whose parts are longer than itself.
        reason = f"it does not say what {error} is" if isinstance(error, KeyError) else str(error)
        reason = reason or "a record in it ends too early"
        raise InputError(f"{path}: is not an MCAP log, or is damaged: {reason}") from error


def is_finished(file: BinaryIO) -> bool:
    """Return whether a file ends as it begins; a file that was cut off, or is still being written, does not.

    The file is at its beginning afterwards.
    """
    size = file.seek(0, 2)
    file.seek(max(size - len(MAGIC), 0))
    last = file.read()
    file.seek(0)
    first = file.read(len(MAGIC))
    file.seek(0)
    return size >= 2 * len(MAGIC) and first == last
