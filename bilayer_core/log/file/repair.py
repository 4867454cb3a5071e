"""A log that strict readers open, of one that was cut off or is damaged: every chunk that is whole is kept.

Records are found by walking from one to the next. Where that leads to something else, the next whole chunk is looked
for by its bytes, and what lies between is named as lost. Each chunk is held against its checksum, and what it holds is
written anew by the library's own writer, with an index.
"""

from __future__ import annotations

import io
import re
import shutil
import struct
import zlib
from dataclasses import dataclass, field
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from bilayer_core.errors import InputError
from bilayer_core.log.file.log_opening import open_log
from bilayer_core.log.file.log_records import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    DATA_END,
    FOOTER,
    HEAD,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    METADATA,
    SCHEMA,
    DamagedChunk,
    Definitions,
    Place,
    content,
    parse,
    read_metadata,
    records_of,
    unpacked,
    walk,
)
from bilayer_core.log.file.log_summary import read_summary
from bilayer_core.log.file.mcap_log import CHUNK_SIZE
from bilayer_core.log.file.output_paths import check_output_path, draft_of, unwritable
from bilayer_core.log.messages.cdr import NANOSECONDS
from bilayer_core.log.run.log_reader import REPAIRED

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer

SUFFIX = ".mcap"
_KNOWN = range(HEADER, DATA_END + 1)
_TAKEN = {CHUNK: "chunk", ATTACHMENT: "attachment", METADATA: "metadata record"}
_TAKEN |= dict.fromkeys((SCHEMA, CHANNEL, MESSAGE), "record")
"""What is taken into the new log, by opcode."""
_COMPRESSION = re.compile(rb"\x03\x00\x00\x00lz4|\x04\x00\x00\x00zstd")
"""In the head of a chunk."""
_BEFORE_COMPRESSION = HEAD.size + 3 * 8 + 4
"""Of a chunk: opcode and length, first and last time, size and checksum [bytes]."""
_WINDOW = 1 << 20
"""In which the next chunk is looked for [bytes]."""


@dataclass
class Repaired:
    """Result of a repair."""

    whole: bool = False  # Nothing was wrong: the file was copied as it is
    chunks: int = 0
    messages: int = 0
    """`chunks`, `messages`: that were kept."""
    attachments: int = 0
    metadata: int = 0
    """`attachments`, `metadata`: likewise."""
    last_time: float | None = None  # Of the last message that was kept [s]
    lost: list[str] = field(default_factory=list)  # What was not, and where it was

    @property
    def kept(self) -> str:
        """Number of messages, chunks, attachments and metadata records that were kept, in words."""
        last = "" if self.last_time is None else f", the last at t = {self.last_time:g} s"
        others = f"{_count(self.attachments, 'attachment')}, {_count(self.metadata, 'metadata record')}"
        return f"{_count(self.messages, 'message')} in {_count(self.chunks, 'chunk')}{last}; {others}"

    def __str__(self) -> str:
        if self.whole:
            return f"the log is whole: copied as it is ({self.kept})"
        return "\n".join([f"kept {self.kept}", *(f"lost {what}" for what in self.lost or ["nothing but the index"])])


def repair(path: str | Path, new: str | Path, force: bool = False) -> Repaired:
    """Write what can be read of a log as one that is whole; a log that is whole is copied.

    `force`: replace `new` if it is there. Raises InputError if `path` is no MCAP file, or `new` is there or cannot be
    written. Raises OutputError if writing fails; nothing is left then.
    """
    path, new = Path(path), Path(new)
    if new.exists() and path.exists() and new.samefile(path):
        raise InputError(f"{new}: is the log that is to be repaired; choose another name")
    with open_log(path):  # says what is wrong with the name, or that it is no log, before anything is written
        check_output_path(new, force, SUFFIX)
    with draft_of(new, force) as draft:
        with open_log(path) as file, io.BufferedWriter(_NewLog(draft, new)) as output:
            found = _Repair(file, output).run()
        if found.whole:
            shutil.copyfile(path, draft)
    return found


class _NewLog(io.FileIO):
    """The file that is written; its errors are told apart from those of the log that is read meanwhile."""

    def __init__(self, draft: Path, path: Path):
        super().__init__(draft, "w")
        self._path = path

    def write(self, data: Buffer) -> int:
        """Write bytes and return how many were; OutputError if that fails."""
        try:
            return super().write(data)
        except OSError as error:
            raise unwritable(self._path, error) from error


class _Repair:
    """One pass through a file."""

    def __init__(self, file: BinaryIO, output: BinaryIO):
        from mcap.writer import CompressionType, Writer

        self._file, self._size = file, file.seek(0, 2)
        self._writer = Writer(output, chunk_size=16 * CHUNK_SIZE, compression=CompressionType.LZ4)  # as they were
        self._register_schema = cache(self._writer.register_schema)
        self._found = Repaired()
        self._last = self._unknown = 0
        self._definitions = Definitions()
        self._new: dict[int, int] = {}

    def run(self) -> Repaired:
        """Take all records; returns what was kept and lost."""
        self._writer.start(*self._profile_and_library())
        try:
            summary = read_summary(self._file)
        except DamagedChunk:
            summary = None
        if summary is not None:  # it describes channels, for chunks that are damaged
            self._definitions = summary.definitions
        ended, last, begin = False, 0, len(MAGIC)
        while not ended and begin < self._size:
            place = next(walk(self._file, begin), None)
            if place is None or place.opcode not in _KNOWN or self._is_damaged_index(place):
                begin = self._resume(last, begin)
                continue
            self._take(place)
            ended, last, begin = place.opcode in (DATA_END, FOOTER), place.begin, place.end
        for number in self._definitions.channels:
            self._new_number(number)
        found = self._found
        if self._unknown:
            found.lost.append(f"{_count(self._unknown, 'message')} of channels that nothing describes")
        if found.messages:
            found.last_time = self._last / NANOSECONDS
        if not (found.messages or found.attachments or found.metadata):
            raise InputError(f"{self._file.name}: nothing in it can be kept: {'; '.join(found.lost) or 'it is empty'}")
        found.whole = bool(ended and not found.lost and summary and summary.is_index and _sound(self._file, self._size))
        if not found.whole:
            self._writer.add_metadata(REPAIRED, {"kept": found.kept, "lost": "; ".join(found.lost)})
        self._writer.finish()
        return found

    def _profile_and_library(self) -> tuple[str, str]:
        """Return the profile and the library that the header names."""
        from mcap.records import Header

        first = next(walk(self._file), None)
        try:
            header = parse(Header, content(self._file, first)) if first and first.opcode == HEADER else Header("", "")
        except DamagedChunk as error:
            self._found.lost.append(f"the header: {error}")
            return "ros2", ""
        return header.profile or "ros2", header.library

    def _is_damaged_index(self, place: Place) -> bool:
        """Return whether an index of messages differs in length from its entries: no checksum protects it."""
        if place.opcode != MESSAGE_INDEX:
            return False
        self._file.seek(place.offset + 2)
        return place.length != 6 + int.from_bytes(self._file.read(4), "little")

    def _resume(self, last: int, damage: int) -> int:
        """Return where to go on after what is no record: at the next chunk that is whole, or at the end of the file.

        It is looked for from the last record on, as the length of that may be what is damaged.
        """
        for start in range(last + 1, self._size, _WINDOW):
            self._file.seek(start)
            for found in _COMPRESSION.finditer(self._file.read(_WINDOW + 8)):
                begin = start + found.start() - _BEFORE_COMPRESSION
                if begin > last and self._is_chunk(begin):
                    first = damage if begin > damage else last
                    self._found.lost.append(f"{_bytes(begin - first)} from byte {first} on, which make no record")
                    return begin
        lost = f"the last {_bytes(self._size - damage)}, from byte {damage} on, which hold no whole chunk"
        self._found.lost.append(lost)
        return self._size

    def _is_chunk(self, begin: int) -> bool:
        place = next(walk(self._file, begin), None)
        try:
            return place is not None and place.opcode == CHUNK and bool(unpacked(content(self._file, place)))
        except DamagedChunk:
            return False

    def _take(self, place: Place) -> None:
        """Write what a record holds, or name it as lost."""
        from mcap.records import Attachment

        if place.opcode not in _TAKEN:
            return
        try:
            data = content(self._file, place)
            if place.opcode == CHUNK:
                self._take_records(unpacked(data))
                self._writer.flush()
                self._found.chunks += 1
            elif place.opcode == ATTACHMENT:
                if zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "little") and any(data[-4:]):
                    raise DamagedChunk("its checksum is another one")
                of = parse(Attachment, data)
                self._writer.add_attachment(of.create_time, of.log_time, of.name, of.media_type, of.data)
                self._found.attachments += 1
            elif place.opcode == METADATA:
                self._writer.add_metadata(*read_metadata(data))
                self._found.metadata += 1
            else:  # outside of chunks
                self._take_records(HEAD.pack(place.opcode, place.length) + data)
        except DamagedChunk as error:
            held = self._held(place) if place.opcode == CHUNK else ""
            self._found.lost.append(f"the {_TAKEN[place.opcode]} at byte {place.begin}{held}: {error}")

    def _held(self, chunk: Place) -> str:
        """Return the time span of a chunk, and the number of messages in the indexes behind it, in words."""
        self._file.seek(chunk.offset)
        begin, end = struct.unpack("<QQ", self._file.read(16).ljust(16, b"\0"))
        behind = takewhile(lambda place: place.opcode == MESSAGE_INDEX, walk(self._file, chunk.end))
        count = sum(place.length // 16 for place in behind)  # an entry has 16 bytes, what is before them 6
        messages = f", {_count(count, 'message')}" if count else ""
        return f" (t = {begin / NANOSECONDS:g} to {end / NANOSECONDS:g} s{messages})"

    def _take_records(self, inside: bytes) -> None:
        """Write the records of a chunk."""
        for opcode, start, end in records_of(inside):
            if opcode == MESSAGE:
                number, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(inside, start)
                new = self._new.get(number) or self._new_number(number)
                if new is None:
                    self._unknown += 1
                    continue
                data = inside[start + MESSAGE_HEAD.size : end]
                self._writer.add_message(new, log_time, data, publish_time, sequence)
                self._found.messages += 1
                self._last = max(self._last, log_time)
            elif opcode in (SCHEMA, CHANNEL):
                # Registered when a message comes: those in chunks, which have checksums, before those outside.
                self._definitions.take(opcode, inside[start:end])

    def _new_number(self, number: int) -> int | None:
        """Return the number of a channel in the new file."""
        channel = self._definitions.channels.get(number)
        if channel is None or channel.schema_id and channel.schema_id not in self._definitions.schemas:
            return None
        if number not in self._new:
            of = self._definitions.schemas.get(channel.schema_id)
            schema = self._register_schema(of.name, of.encoding, of.data) if of else 0
            encoding = channel.message_encoding
            self._new[number] = self._writer.register_channel(channel.topic, encoding, schema, channel.metadata)
        return self._new[number]


def _sound(file: BinaryIO, size: int) -> bool:
    """Return whether the index of a finished file is as it was written, by the checksum, if any, in its footer."""
    footer = struct.Struct("<QQI")
    file.seek(size - len(MAGIC) - footer.size)
    summary_start, _, checksum = footer.unpack(file.read(footer.size))
    file.seek(summary_start)
    return not checksum or zlib.crc32(file.read(size - len(MAGIC) - 4 - summary_start)) == checksum


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _bytes(number: int) -> str:
    return f"{number / 1e6:.3g} MB" if number >= 100_000 else f"{number} bytes"
