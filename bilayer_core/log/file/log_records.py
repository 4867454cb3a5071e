"""The records of an MCAP file, found and checked one by one, so that no more of a file is in memory than a chunk.

Files are walked from record to record, and `mcap` parses the small ones. A file that ends within a record is read up to
the last whole one. The messages of a chunk are cut out of it by their heads: `mcap` makes objects of all of them, which
takes twenty times as long.

A file may have been made to fill the memory of its reader. So no record is read that is longer than its kind may be,
and a chunk is unpacked into the size that it declares, which is at most `LARGEST_CHUNK`.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from bilayer_core.printable import shortened

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = range(1, 8)
CHUNK_INDEX, ATTACHMENT, STATISTICS, METADATA, DATA_END = 0x08, 0x09, 0x0B, 0x0C, 0x0F
"""Opcodes, as in `mcap.opcode`."""
LARGEST_CHUNK = 100_000_000
"""Of a chunk, packed or unpacked, and of an attachment [bytes]."""
LARGEST_INDEX = LARGEST_CHUNK // 31 * 16
"""Of the index of a chunk [bytes]: an entry takes 16, the smallest message 31."""
LARGEST_METADATA = 32_000_000
"""Of a metadata record [bytes]: the description of the largest scene takes 20 MB."""
LARGEST_RECORD = 1_000_000
"""Of any other record [bytes]."""
_LARGEST = {
    CHUNK: LARGEST_CHUNK,
    ATTACHMENT: LARGEST_CHUNK,
    MESSAGE: LARGEST_CHUNK,
    MESSAGE_INDEX: LARGEST_INDEX,
    METADATA: LARGEST_METADATA,
    SCHEMA: 4 * LARGEST_RECORD,
}
MOST_DEFINITIONS = 32_000_000
"""Of all types and topics of a file [bytes]."""
MOST_ENTRIES = 10_000
"""Keys of a metadata record."""
HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Of a message: channel, sequence, log time and publish time [ns]."""
CHUNK_HEAD = struct.Struct("<QQQII")
"""Of a chunk: first and last time [ns], size and checksum when unpacked, length of the name of its compression."""
_INDEX_HEAD = struct.Struct("<HI")
"""Of the index of a channel's messages in a chunk: channel, length of its entries [bytes]."""
_LENGTH = struct.Struct("<I")
_FOOTER = struct.Struct("<QQI")


class DamagedChunk(ValueError):
    """A chunk, or another record, that does not hold what was written, or more than is read."""


@dataclass(frozen=True)
class Place:
    """Where a record is."""

    opcode: int
    offset: int  # Of its content, from the beginning of the file [bytes]
    length: int  # Of its content [bytes]

    @property
    def begin(self) -> int:
        """Offset of the record itself [bytes]."""
        return self.offset - HEAD.size

    @property
    def end(self) -> int:
        """Offset of what follows [bytes]."""
        return self.offset + self.length


def walk(file: BinaryIO, begin: int = len(MAGIC)) -> Iterator[Place]:
    """Yield the complete records from an offset on, up to the end of the file or the first record that does not fit."""
    size = file.seek(0, 2)
    while begin + HEAD.size <= size:
        file.seek(begin)
        opcode, length = HEAD.unpack(file.read(HEAD.size))
        place = Place(opcode, begin + HEAD.size, length)
        if place.end > size:
            return
        yield place
        begin = place.end


def content(file: BinaryIO, place: Place) -> bytes:
    """Return the content of a record. Raises DamagedChunk if it is longer than a record of its kind may be."""
    most = _LARGEST.get(place.opcode, LARGEST_RECORD)
    if place.length > most:
        size = f"{place.length / 1e6:.3g} MB, and at most {most / 1e6:.3g} MB are read"
        raise DamagedChunk(f"the record at byte {place.begin} has {size}")
    file.seek(place.offset)
    return file.read(place.length)


def parse(kind: type, data: bytes):
    """Return a record of `mcap.records` from its content; raise DamagedChunk if the content has another form."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError

    stream = ReadDataStream(BytesIO(data))
    try:
        return kind.read(stream)
    except (McapError, ValueError, struct.error, OverflowError, MemoryError) as error:
        raise DamagedChunk(f"{kind.__name__} cannot be parsed") from error


def read_metadata(data: bytes, wanted: Collection[str] | None = None) -> tuple[str, dict[str, str]]:
    """Return name and values of a metadata record from its content; without values if its name is not `wanted`.

    Raises DamagedChunk if it has not the form of one, or more than `MOST_ENTRIES` keys.
    """
    try:
        name, place = _text(data, 0)
        if wanted is not None and name not in wanted:
            return name, {}
        end = place + _LENGTH.size + _LENGTH.unpack_from(data, place)[0]
        place += _LENGTH.size
        values: dict[str, str] = {}
        while place < end:
            if len(values) == MOST_ENTRIES:
                raise DamagedChunk(f"metadata {name} has more than {MOST_ENTRIES} keys")
            key, place = _text(data, place)
            values[key], place = _text(data, place)
    except (struct.error, UnicodeDecodeError) as error:
        raise DamagedChunk("a metadata record cannot be parsed") from error
    return name, values


def _text(data: bytes, place: int) -> tuple[str, int]:
    """Return a text in a record, and the offset at which it ends."""
    (length,) = _LENGTH.unpack_from(data, place)
    place += _LENGTH.size
    if place + length > len(data):
        raise struct.error("a text ends after its record")
    return data[place : place + length].decode(), place + length


def read_chunk(file: BinaryIO, place: Place) -> bytes:
    """Return the records in a chunk, or at a place that is none; DamagedChunk if it is damaged or too large."""
    data = content(file, place)
    if place.opcode != CHUNK:
        return data
    try:
        return unpacked(data)
    except DamagedChunk as error:
        raise DamagedChunk(f"the chunk at byte {place.begin}: {error}") from error


def unpacked(data: bytes) -> bytes:
    """Return the unpacked data of a chunk from the content of its record, checked against its checksum.

    Raises DamagedChunk if it cannot be unpacked, is not what was written, or is larger than `LARGEST_CHUNK`.
    """
    try:
        _, _, size, checksum, length = CHUNK_HEAD.unpack_from(data)
        compression = data[CHUNK_HEAD.size : CHUNK_HEAD.size + length].decode()
        begin = CHUNK_HEAD.size + length + 8
        (packed_size,) = struct.unpack_from("<Q", data, begin - 8)
    except (struct.error, UnicodeDecodeError) as error:
        raise DamagedChunk("Chunk cannot be parsed") from error
    if size > LARGEST_CHUNK:
        raise DamagedChunk(f"unpacked it has {size / 1e6:.3g} MB, and at most {LARGEST_CHUNK / 1e6:g} MB are read")
    inside = _decompressed(memoryview(data)[begin : begin + packed_size], compression, size)
    if len(inside) != size:
        raise DamagedChunk(f"it has {len(inside)} bytes, and should have {size}")
    if checksum and zlib.crc32(inside) != checksum:
        raise DamagedChunk("its checksum is another one")
    return inside


def _decompressed(packed: memoryview, compression: str, size: int) -> bytes:
    """Return the unpacked data; unpack no more of it than shows that it does not have the declared size."""
    if not compression:
        return bytes(packed)
    if compression == "lz4":
        import lz4.frame

        unpacker = lz4.frame.LZ4FrameDecompressor()
        try:
            inside = unpacker.decompress(packed, max_length=size + 1)
        except (RuntimeError, MemoryError, EOFError) as error:
            raise DamagedChunk("it cannot be unpacked") from error
        if len(inside) <= size and not unpacker.eof:
            raise DamagedChunk("it cannot be unpacked")
        return inside
    if compression == "zstd":
        import zstandard

        try:
            if zstandard.frame_content_size(packed) not in (-1, size):  # by which the unpacker would take memory
                raise DamagedChunk(f"it should have {size} bytes, and its frame declares another size")
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=max(size, 1))
        except (zstandard.ZstdError, MemoryError) as error:
            raise DamagedChunk("it cannot be unpacked") from error
    raise DamagedChunk(f"its compression {shortened(compression)!r} is not known")


def records_of(inside: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield the opcode, and begin and end of the content, of each whole record in what a chunk holds."""
    position, size = 0, len(inside)
    while position + HEAD.size <= size:
        opcode, length = HEAD.unpack_from(inside, position)
        position += HEAD.size
        if position + length > size:
            return
        if opcode == MESSAGE and length < MESSAGE_HEAD.size:
            raise DamagedChunk(f"a message has {length} bytes, and its head alone has {MESSAGE_HEAD.size}")
        yield opcode, position, position + length
        position += length


def read_index(data: bytes) -> tuple[int, np.ndarray]:
    """Return the channel, and times of its messages in a chunk [ns], from the content of a message index."""
    try:
        channel, length = _INDEX_HEAD.unpack_from(data)
        entries = np.frombuffer(data, "<u8", length // 16 * 2, _INDEX_HEAD.size)
    except (struct.error, ValueError) as error:
        raise DamagedChunk("an index of messages cannot be parsed") from error
    return channel, entries[::2]


class Definitions:
    """Types and topics of a file, by their numbers.

    Attributes
    ----------
    schemas, channels : dict
        Records of `mcap.records`.
    """

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._size = 0

    def take(self, opcode: int, data: bytes) -> None:
        """Take a schema or a channel from the content of its record.

        Raises DamagedChunk if it cannot be parsed, or all of them are larger than `MOST_DEFINITIONS`.
        """
        from mcap.records import Channel, Schema

        known = self.schemas if opcode == SCHEMA else self.channels
        if len(data) > _LARGEST.get(opcode, LARGEST_RECORD):
            raise DamagedChunk(f"the description of a topic has {len(data) / 1e6:.3g} MB")
        record = parse(Schema if opcode == SCHEMA else Channel, data)
        if known.get(record.id) != record:
            self._size += len(data) + _PER_ENTRY * len(getattr(record, "metadata", ()))
            if self._size > MOST_DEFINITIONS:
                most = f"{MOST_DEFINITIONS / 1e6:g} MB"
                raise DamagedChunk(f"its types and topics have more than {most}, the most that are read")
            known[record.id] = record


_PER_ENTRY = 200
"""Memory that a key of a channel's metadata takes beside its text [bytes]."""


def summary_start(file: BinaryIO) -> int:
    """Return where the summary of a finished file begins [bytes]; 0 if it has none."""
    size = file.seek(0, 2)
    place = size - len(MAGIC) - _FOOTER.size
    if place < HEAD.size:
        return 0
    file.seek(place - HEAD.size)
    opcode, length = HEAD.unpack(file.read(HEAD.size))
    begin, _, _ = _FOOTER.unpack(file.read(_FOOTER.size))
    return begin if (opcode, length) == (FOOTER, _FOOTER.size) and begin < place else 0
