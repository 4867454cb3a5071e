"""Logs and saved states with random damage: of their bytes, and of their records with valid checksums."""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{name}: &{name} [{', '.join(['*' + last] * 9)}]\n" for last, name in zip("abcdefghi", "bcdefghij", strict=True)
)
NOT_UTF8 = "not UTF-8 "
"""What stands for bytes that are no text, until the file is written."""
NUMBERS = (
    0,
    -1,
    1,
    3,
    2**31,
    2**63,
    2**64,
    10**400,
    -0.0,
    0.5,
    1e-300,
    1e300,
    float("nan"),
    float("inf"),
    -float("inf"),
)
TEXTS = (
    "",
    " ",
    "x",
    "../x",
    "a/b",
    "arm",
    "\x1b]0;x\x07",
    "\u202egnp",
    "x" * 5000,
    "\n",
    "\0",
    "é",
    "1",
    "nan",
    NOT_UTF8,
)
JSON = (
    "",
    "null",
    "[]",
    "{}",
    "NaN",
    "-Infinity",
    "1e999",
    "1" * 5000,
    "[" * 100_000,
    '{"a":' * 100_000,
    '"\\ud800"',
    "[0,",
)
VALUES: tuple[Any, ...] = (*NUMBERS, *TEXTS, None, True, [], {}, [[]], [None], {"x": 1}, [1, 2, 3], [1e400])
CUTS = (0, 1, 4, 5, 8, 30)


@dataclass
class Records:
    """What a log holds, to be changed and written anew."""

    profile: str = "ros2"
    library: str = "tests"
    attachments: list[list[Any]] = field(default_factory=list)
    """Name, media type, data."""
    metadata: list[list[Any]] = field(default_factory=list)
    """Name, values."""
    schemas: dict[int, list[Any]] = field(default_factory=dict)
    """Name, encoding, text."""
    channels: dict[int, list[Any]] = field(default_factory=dict)
    """Topic, encoding, schema, metadata."""
    messages: list[list[Any]] = field(default_factory=list)
    """Channel, time [ns], data."""
    options: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path) -> Records:
        """Return the records of a log."""
        found = cls()
        with path.open("rb") as file:
            reader = make_reader(file)
            found.attachments = [[item.name, item.media_type, item.data] for item in reader.iter_attachments()]
            found.metadata = [[item.name, dict(item.metadata)] for item in reader.iter_metadata()]
            summary = reader.get_summary()
            found.schemas = {n: [item.name, item.encoding, item.data] for n, item in summary.schemas.items()}
            for n, item in summary.channels.items():
                found.channels[n] = [item.topic, item.message_encoding, item.schema_id, dict(item.metadata)]
            for _, channel, message in reader.iter_messages(log_time_order=False):
                found.messages.append([channel.id, message.log_time, message.data])
        return found

    def write(self, path: Path) -> None:
        """Write them as a log."""
        stream = io.BytesIO()
        writer = Writer(stream, **{"compression": CompressionType.LZ4} | self.options)
        writer.start(self.profile, self.library)
        for name, media_type, data in self.attachments:
            writer.add_attachment(0, 0, name, media_type, data)
        for name, values in self.metadata:
            writer.add_metadata(name, values)
        schemas = {number: writer.register_schema(*schema) for number, schema in self.schemas.items()}
        numbers = {}
        for number, (topic, encoding, schema, metadata) in self.channels.items():
            numbers[number] = writer.register_channel(topic, encoding, schemas.get(schema, schema), metadata)
        for channel, time, data in self.messages:
            writer.add_message(numbers[channel], time, data, time)
        writer.finish()
        path.write_bytes(stream.getvalue().replace(NOT_UTF8.encode(), b"\xff\xfe\x80" * 3 + b"\xc3"))


def mutated_json(pick: random.Random, text: str) -> str:
    """A JSON text with one value in it changed."""
    if pick.random() < 0.2:
        return pick.choice(JSON)
    value = json.loads(text)
    owner, key = [value], 0
    while isinstance(owner[key], dict | list) and owner[key] and pick.random() < 0.85:
        owner = owner[key]
        key = pick.choice(list(owner)) if isinstance(owner, dict) else pick.randrange(len(owner))
    top = isinstance(owner, list) and owner == [value]
    if pick.random() < 0.2 and not top:
        del owner[key]
    elif pick.random() < 0.1 and isinstance(owner, list):
        owner.append(owner[key])
    elif top:
        value = pick.choice(VALUES)
    else:
        owner[key] = pick.choice(VALUES)
    return json.dumps(value)


def mutated_text(pick: random.Random, text: str) -> str:
    """Another text, number or JSON."""
    try:
        return pick.choice((mutated_json(pick, text), pick.choice(TEXTS), str(pick.choice(NUMBERS))))
    except ValueError:
        return pick.choice((pick.choice(TEXTS), str(pick.choice(NUMBERS)), pick.choice(JSON)))


def mutated_bytes(pick: random.Random, data: bytes) -> bytes:
    """Bytes of which some are others, gone or added."""
    data = bytearray(data)
    for _ in range(pick.choice((1, 1, 1, 3, 30))):
        place = pick.randrange(len(data) + 1)
        match pick.randrange(6):
            case 0:
                del data[place:]
            case 1:
                del data[place : place + pick.choice((1, 8, 1000))]
            case 2:
                data[place:place] = pick.randbytes(pick.choice((1, 8, 1000)))
            case 3:
                data[place : place + 8] = struct.pack("<Q", pick.choice((0, 1, 2**31, 2**32, 2**63, 2**64 - 1)))
            case 4:
                data[place : place + 64] = bytes(64)
            case _:
                if place < len(data):
                    data[place] ^= 1 << pick.randrange(8)
    return bytes(data)


def _change_metadata(pick: random.Random, records: Records) -> None:
    number = pick.randrange(len(records.metadata))
    record = records.metadata[number]
    match pick.randrange(8):
        case 0:
            del records.metadata[number]
        case 1:
            record[0] = pick.choice(TEXTS)
        case 2 if record[1]:
            del record[1][pick.choice(list(record[1]))]
        case 3:
            record[1][pick.choice(TEXTS)] = pick.choice(TEXTS)
        case _ if record[1]:
            key = pick.choice(list(record[1]))
            record[1][key] = mutated_text(pick, record[1][key])


def _change_description(pick: random.Random, records: Records) -> None:
    values = next(values for name, values in records.metadata if name == "description")
    key = pick.choice(list(values))
    values[key] = mutated_json(pick, values[key])


def _change_settings(pick: random.Random, records: Records) -> None:
    values = next(values for name, values in records.metadata if name == "settings")
    values[pick.choice(list(values))] = pick.choice((*TEXTS, *map(str, NUMBERS)))


def _change_scene(pick: random.Random, records: Records) -> None:
    attachment = records.attachments[0]
    lines = attachment[2].decode().splitlines()
    place = pick.randrange(len(lines))
    match pick.randrange(7):
        case 0:
            attachment[2] = pick.choice((b"", b"\xff\xfe", BOMB.encode(), b"[" * 100_000, b"7", b"a: 1\na: 2"))
        case 1:
            attachment[0] = pick.choice(TEXTS)
        case 2:
            del lines[place]
        case 3:
            lines[place:place] = [pick.choice(("x: 1", "- x", "\x1b[31m: 1", "rods: []", "duration: 1e300"))]
        case 4:
            records.attachments.clear()
        case _:
            key = lines[place].partition(":")[0]
            lines[place] = f"{key}: {pick.choice(VALUES)!r}"
    if records.attachments and pick.random() < 0.9 and lines and attachment[2] and attachment[0] == "scene.yaml":
        attachment[2] = "\n".join(lines).encode(errors="replace")


def _change_types(pick: random.Random, records: Records) -> None:
    channel = records.channels[pick.choice(list(records.channels))]
    match pick.randrange(6):
        case 0:
            channel[0] = pick.choice(TEXTS)
        case 1:
            channel[1] = pick.choice(("", "json", *TEXTS))
        case 2:
            channel[2] = pick.choice(list(records.schemas))
        case 3:
            channel[3] = {pick.choice(TEXTS): pick.choice(TEXTS)}
        case 4:
            channel[0] = pick.choice(list(records.channels.values()))[0]
        case _:
            schema = pick.choice(list(records.schemas.values()))
            place = pick.randrange(2)
            schema[place] = pick.choice(TEXTS)


def _change_bodies(pick: random.Random, records: Records) -> None:
    number = pick.choice(list(records.channels))
    bodies = [message for message in records.messages if message[0] == number] or records.messages
    kind = pick.randrange(6)
    for message in bodies if pick.random() < 0.5 else [pick.choice(bodies)]:
        data = message[2]
        match kind:
            case 0:
                message[2] = data[: pick.choice(CUTS)]
            case 1:
                message[2] = data[: -pick.choice(CUTS[1:])]
            case 2:
                message[2] = data + pick.randbytes(pick.choice(CUTS[1:]))
            case 3:
                message[2] = pick.randbytes(len(data))
            case 4:
                place = pick.randrange(max(1, len(data) // 8)) * 8 + 4
                message[2] = (
                    data[:place]
                    + struct.pack("<d", float(pick.choice((*NUMBERS[:7], *NUMBERS[8:]))))
                    + data[place + 8 :]
                )
            case _:
                message[2] = mutated_bytes(pick, data)


def _change_times(pick: random.Random, records: Records) -> None:
    match pick.randrange(4):
        case 0:
            for message in records.messages:
                message[1] = pick.choice((0, 2**63, 2**64 - 1, message[1]))
        case 1:
            records.messages.reverse()
        case 2:
            pick.choice(records.messages)[1] = pick.choice((0, 2**64 - 1, 10**12))
        case _:
            pick.shuffle(records.messages)


def _change_form(pick: random.Random, records: Records) -> None:
    records.options = {"compression": pick.choice(list(CompressionType)), "chunk_size": pick.choice((1, 1000, 10**6))}
    match pick.randrange(4):
        case 0:
            records.profile, records.library = pick.choice(TEXTS), pick.choice(TEXTS)
        case 1:
            records.options |= {"use_chunking": False, "index_types": IndexType.NONE}
        case 2:
            gone = pick.choice(list(records.channels))
            records.messages = [message for message in records.messages if message[0] != gone]
        case _:
            records.messages *= 2


CHANGES: tuple[Callable[[random.Random, Records], None], ...] = (
    *(_change_description,) * 3,
    *(_change_bodies,) * 3,
    _change_metadata,
    _change_settings,
    _change_scene,
    _change_types,
    _change_times,
    _change_form,
)


def write_mutated_log(pick: random.Random, whole: Path, path: Path) -> None:
    """Write a log with damage: a third of them of their bytes, the others of their records."""
    if pick.random() < 0.33:
        path.write_bytes(mutated_bytes(pick, whole.read_bytes()))
        return
    records = Records.of(whole)
    for _ in range(pick.choice((1, 1, 2))):
        pick.choice(CHANGES)(pick, records)
    records.write(path)


def write_mutated_state(pick: random.Random, whole: Path, path: Path) -> None:
    """Write a saved state with damage: of its bytes, of its header, or of what its members hold."""
    if pick.random() < 0.3:
        path.write_bytes(mutated_bytes(pick, whole.read_bytes()))
        return
    with np.load(whole) as content:
        members: dict[str, Any] = dict(content)
    state, layout = members["state"], str(members["layout"])
    match pick.randrange(8):
        case 0:
            members["state"] = state.astype(pick.choice((">f8", "f4", "i8", "c16", "U8", "S8", "?", object)))
        case 1:
            members["state"] = pick.choice((state[:-1], np.append(state, 0.0), state[None], state[:0], state[0]))
        case 2:
            state[pick.randrange(state.size)] = pick.choice((np.nan, np.inf, -np.inf, 1e300, -1.0, 1e9))
        case 3 | 4:
            members["layout"] = np.array(mutated_text(pick, layout))
        case 5:
            members["layout"] = pick.choice((np.array(7), np.array([layout]), np.array(None), np.array(b"x"), state))
        case 6:
            del members[pick.choice(("state", "layout"))]
        case _:
            _write_with_header(pick, path, members)
            return
    with path.open("wb") as file:
        pick.choice((np.savez, np.savez_compressed))(file, **members)


def _write_with_header(pick: random.Random, path: Path, members: dict[str, Any]) -> None:
    """Write a state whose header declares something else than what it has."""
    header = pick.choice(
        (
            "{'descr': '<f8', 'fortran_order': False, 'shape': (1099511627776,), }",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
            "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
            "{'descr': [('x', '<f8'), ('y', '<i4')], 'fortran_order': True, 'shape': (3,), }",
            "{'descr': '<U0', 'fortran_order': False, 'shape': (), }",
            "{'descr': 7, 'fortran_order': 1, 'shape': 2}",
            "[" * 5000,
            "",
        )
    ).encode()
    version = pick.choice((b"\x01\x00", b"\x02\x00", b"\x03\x00", b"\x09\x00"))
    length = struct.pack("<H" if version[0] == 1 else "<I", len(header) + 1)
    body = b"\x93NUMPY" + version + length + header + b"\n" + members["state"].tobytes()
    with zipfile.ZipFile(path, "w", compression=pick.choice((zipfile.ZIP_STORED, zipfile.ZIP_LZMA))) as file:
        for name in ("layout", "state"):
            stream = io.BytesIO()
            np.save(stream, members[name])
            file.writestr(f"{name}.npy", body if name == "state" else stream.getvalue())
