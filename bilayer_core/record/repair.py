"""A log that strict readers open, of one that was cut off or is damaged: every chunk that is whole is kept.

Chunks are found by walking from record to record. Where that ends in nonsense before the end of the file, the next
chunk is looked for by its bytes; what lies between is told as lost. Each chunk is held against its checksum, and
what it holds is written anew by the library's own writer, with an index.
"""

from __future__ import annotations

import shutil
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from bilayer_core.errors import InputError
from bilayer_core.record.cdr import NANOSECONDS
from bilayer_core.record.log_reader import REPAIRED
from bilayer_core.record.log_records import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    CHUNK_HEAD,
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
    read_index,
    read_metadata,
    records_of,
    unpacked,
    walk,
)
from bilayer_core.record.log_summary import read_summary
from bilayer_core.record.mcap_log import CHUNK_SIZE
from bilayer_core.record.opening import open_log
from bilayer_core.record.paths import check_output_path, draft_of

SUFFIX = ".mcap"
_KNOWN = set(range(HEADER, DATA_END + 1))
_COMPRESSIONS = (b"\x03\x00\x00\x00lz4", b"\x04\x00\x00\x00zstd")
_CHUNK_TIMES = struct.Struct("<QQQI")
"""Begin and end [ns], size and checksum, before the name of the compression."""
_WINDOW = 1 << 20
"""In which the next chunk is looked for [bytes]."""


@dataclass
class Repaired:
    """What came of a repair.

    Attributes
    ----------
    whole : bool
        Nothing was wrong: the file was copied as it is.
    chunks, messages : int
        That were kept.
    attachments, metadata : int
        Likewise.
    last_time : float or None
        Of the last message that was kept [s].
    lost : list of str
        What was not, and where it was.
    """

    whole: bool = False
    chunks: int = 0
    messages: int = 0
    attachments: int = 0
    metadata: int = 0
    last_time: float | None = None
    lost: list[str] = field(default_factory=list)

    @property
    def kept(self) -> str:
        """What was kept, in words."""
        last = "" if self.last_time is None else f", the last at t = {self.last_time:g} s"
        others = f"{_count(self.attachments, 'attachment')}, {_count(self.metadata, 'metadata record')}"
        return f"{_count(self.messages, 'message')} in {_count(self.chunks, 'chunk')}{last}; {others}"

    def __str__(self) -> str:
        if self.whole:
            return f"the log is whole: copied as it is ({self.kept})"
        return "\n".join([f"kept {self.kept}", *(f"lost {what}" for what in self.lost or ["nothing but the index"])])


def repair(path: str | Path, new: str | Path, force: bool = False) -> Repaired:
    """Write what can be read of a log as one that is whole; a log that is whole is copied.

    Parameters
    ----------
    path, new : str or Path
    force : bool
        Replace `new` if it is there.

    Raises
    ------
    InputError
        If `path` is no MCAP file, or `new` is there or cannot be written.
    OutputError
        If writing fails; nothing is left then.
    """
    path, new = Path(path), Path(new)
    if new.exists() and path.exists() and new.samefile(path):
        raise InputError(f"{new}: is the log that is to be repaired; choose another name")
    with open_log(path):  # says what is wrong with the name, or that it is no log, before anything is written
        check_output_path(new, force, SUFFIX)
    with draft_of(new, force) as draft:
        with open_log(path) as file, draft.open("wb") as output:
            found = _Repair(file, output).run()
        if found.whole:
            shutil.copyfile(path, draft)
    return found


class _Repair:
    """One pass through a file."""

    def __init__(self, file: BinaryIO, output: BinaryIO):
        from mcap.writer import CompressionType, Writer

        self._file, self._size = file, file.seek(0, 2)
        self._writer = Writer(output, chunk_size=16 * CHUNK_SIZE, compression=CompressionType.LZ4)  # as they were
        self._found = Repaired()
        self._started = False
        self._last = 0
        self._definitions = Definitions()
        self._new: dict[int, int] = {}
        self._new_schemas: dict[int, int] = {}
        self._unknown = 0
        self._unfinished = True

    def run(self) -> Repaired:
        """Take all records; returns what was kept and lost."""
        summary = self._summary()
        chunk: Place | None = None
        for place in self._places():
            if place.opcode == MESSAGE_INDEX:
                continue
            if place.opcode in (DATA_END, FOOTER):
                self._unfinished = False
                break
            self._take(place)
            chunk = place if place.opcode == CHUNK else chunk
        self._start("", "")
        for number in self._definitions.channels:
            self._register(number)
        if self._unknown:
            self._lose(f"{_count(self._unknown, 'message')} of channels that nothing describes")
        found = self._found
        if found.messages:
            found.last_time = self._last / NANOSECONDS
        if not (found.messages or found.attachments or found.metadata):
            raise InputError(f"{self._file.name}: nothing in it can be kept: {'; '.join(found.lost) or 'it is empty'}")
        found.whole = not found.lost and not self._unfinished and summary
        if not found.whole:
            self._writer.flush()
            self._writer.add_metadata(REPAIRED, {"kept": found.kept, "lost": "; ".join(found.lost)})
        self._writer.finish()
        return found

    def _summary(self) -> bool:
        """Whether there is an index; channels and schemas are taken from it, for chunks that are damaged."""
        try:
            summary = read_summary(self._file)
        except DamagedChunk:
            summary = None
        if summary is None:
            return False
        self._definitions = summary.definitions
        return summary.is_index and _sound(self._file, self._size)

    def _places(self) -> Iterator[Place]:
        """The records of the file; where they end in nonsense, on from the next chunk that can be found."""
        begin = len(MAGIC)
        while True:
            for place in walk(self._file, begin):
                if place.opcode not in _KNOWN or not self._is_consistent(place):
                    break
                begin = place.end
                yield place
                if place.opcode == FOOTER:
                    return
            if begin >= self._size:
                return
            following = self._next_chunk(begin + 1)
            if following is None:
                self._lose(f"the last {_bytes(self._size - begin)}, from byte {begin} on, which hold no whole chunk")
                return
            self._lose(f"{_bytes(following - begin)} from byte {begin} on, which make no record")
            begin = following

    def _is_consistent(self, place: Place) -> bool:
        """Whether a chunk or an index is as long as its own parts say: nothing else protects these lengths."""
        if place.opcode not in (CHUNK, MESSAGE_INDEX):
            return True
        self._file.seek(place.offset)
        head = self._file.read(min(place.length, _CHUNK_TIMES.size + 32))
        before = 2 if place.opcode == MESSAGE_INDEX else _CHUNK_TIMES.size  # bytes before the next length
        if len(head) < before + 4:
            return False
        (length,) = struct.unpack_from("<I", head, before)
        if place.opcode == MESSAGE_INDEX:
            return place.length == before + 4 + length
        before += 4 + length
        return before + 8 <= len(head) and place.length == before + 8 + struct.unpack_from("<Q", head, before)[0]

    def _next_chunk(self, begin: int) -> int | None:
        """Where the next chunk begins that is whole, from an offset on."""
        overlap = HEAD.size + _CHUNK_TIMES.size + 16
        while begin < self._size:
            self._file.seek(begin)
            window = self._file.read(_WINDOW + overlap)
            for compression in _COMPRESSIONS:
                at = window.find(compression)
                while at >= 0:
                    start = at - _CHUNK_TIMES.size - HEAD.size
                    if start >= 0 and window[start] == CHUNK and self._is_chunk(begin + start):
                        return begin + start
                    at = window.find(compression, at + 1)
            begin += _WINDOW
        return None

    def _is_chunk(self, offset: int) -> bool:
        place = next(walk(self._file, offset), None)
        if place is None:
            return False
        try:
            unpacked(content(self._file, place))
        except DamagedChunk:
            return False
        return True

    def _take(self, place: Place) -> None:
        """Write what a record holds."""
        from mcap.records import Attachment, Header

        try:
            if place.opcode == HEADER:
                header = parse(Header, content(self._file, place))
                self._start(header.profile, header.library)
            elif place.opcode == CHUNK:
                self._start("", "")
                self._take_chunk(place)
            elif place.opcode == ATTACHMENT:
                data = content(self._file, place)
                if zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "little") and any(data[-4:]):
                    raise DamagedChunk("its checksum is another one")
                of = parse(Attachment, data)
                self._start("", "")
                self._writer.flush()
                self._writer.add_attachment(of.create_time, of.log_time, of.name, of.media_type, of.data)
                self._found.attachments += 1
            elif place.opcode == METADATA:
                name, values = read_metadata(content(self._file, place))
                self._start("", "")
                self._writer.flush()
                self._writer.add_metadata(name, values)
                self._found.metadata += 1
            elif place.opcode in (SCHEMA, CHANNEL, MESSAGE):  # outside of chunks
                self._start("", "")
                self._take_inside(HEAD.pack(place.opcode, place.length) + content(self._file, place))
        except DamagedChunk as error:
            what = {HEADER: "header", ATTACHMENT: "attachment", METADATA: "metadata record"}.get(place.opcode, "record")
            self._lose(f"the {what} at byte {place.begin}: {error}")

    def _start(self, profile: str, library: str) -> None:
        """Begin the new file, as the old one does."""
        if not self._started:
            self._writer.start(profile or "ros2", library)
            self._started = True

    def _take_chunk(self, place: Place) -> None:
        data = content(self._file, place)
        try:
            inside = unpacked(data)
        except DamagedChunk as error:
            begin, end, *_ = CHUNK_HEAD.unpack_from(data)
            count = self._indexed_after(place)
            messages = f", {_count(count, 'message')}" if count else ""
            span = f"t = {begin / NANOSECONDS:g} to {end / NANOSECONDS:g} s"
            self._lose(f"the chunk at byte {place.begin} ({span}{messages}): {error}")
            return
        self._take_inside(inside)
        self._writer.flush()
        self._found.chunks += 1

    def _indexed_after(self, place: Place) -> int:
        """How many messages the indexes behind a chunk speak of."""
        count = 0
        for following in walk(self._file, place.end):
            if following.opcode != MESSAGE_INDEX:
                break
            count += len(read_index(content(self._file, following))[1])
        return count

    def _take_inside(self, inside: bytes) -> None:
        """Write the records of a chunk."""
        for opcode, start, end in records_of(inside):
            if opcode == MESSAGE:
                number, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(inside, start)
                new = self._new.get(number) or self._register(number)
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

    def _register(self, number: int) -> int | None:
        """The number of a channel in the new file."""
        channel = self._definitions.channels.get(number)
        if channel is None or channel.schema_id and channel.schema_id not in self._definitions.schemas:
            return None
        if number not in self._new:
            schema = 0
            if channel.schema_id:
                schema = self._new_schemas.get(channel.schema_id) or self._new_schema(channel.schema_id)
            encoding = channel.message_encoding
            self._new[number] = self._writer.register_channel(channel.topic, encoding, schema, channel.metadata)
        return self._new[number]

    def _new_schema(self, number: int) -> int:
        schema = self._definitions.schemas[number]
        self._new_schemas[number] = self._writer.register_schema(schema.name, schema.encoding, schema.data)
        return self._new_schemas[number]

    def _lose(self, what: str) -> None:
        self._found.lost.append(what)


def _sound(file: BinaryIO, size: int) -> bool:
    """Whether the index of a finished file is as it was written, by the checksum in its footer."""
    length = 20
    file.seek(size - len(MAGIC) - length)
    summary_start, _, checksum = struct.unpack("<QQI", file.read(length))
    file.seek(summary_start)
    data = file.read(size - len(MAGIC) - 4 - summary_start)
    return not checksum or zlib.crc32(data) == checksum


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _bytes(number: int) -> str:
    return f"{number / 1e6:.3g} MB" if number >= 100_000 else f"{number} bytes"
