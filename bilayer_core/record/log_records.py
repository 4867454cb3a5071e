"""The records of an MCAP file, found and checked one by one, so that no more of a file is in memory than a chunk.

Files are walked from record to record; what `mcap` parses is parsed by it. A file that ends within a record is read up
to the last whole one. The messages of a chunk are cut out of it by their heads: `mcap` makes objects of all of them,
which takes twenty times as long.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO

import numpy as np

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = range(1, 8)
ATTACHMENT, METADATA, DATA_END = 0x09, 0x0C, 0x0F
"""Opcodes, as in `mcap.opcode`."""
HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Of a message: channel, sequence, log time and publish time [ns]."""
_INDEX_HEAD = struct.Struct("<HI")
"""Of the index of a channel's messages in a chunk: channel, length of its entries [bytes]."""


class DamagedChunk(ValueError):
    """A chunk that does not hold what was written."""


@dataclass(frozen=True)
class Place:
    """Where a record is.

    Attributes
    ----------
    opcode : int
    offset : int
        Of its content, from the beginning of the file [bytes].
    length : int
        Of its content [bytes].
    """

    opcode: int
    offset: int
    length: int

    @property
    def begin(self) -> int:
        """Offset of the record itself [bytes]."""
        return self.offset - HEAD.size

    @property
    def end(self) -> int:
        """Offset of what follows [bytes]."""
        return self.offset + self.length


def walk(file: BinaryIO, begin: int = len(MAGIC)) -> Iterator[Place]:
    """The whole records from an offset on, up to the end of the file or to what does not fit into it."""
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
    """The content of a record."""
    file.seek(place.offset)
    return file.read(place.length)


def parse(kind: type, data: bytes):
    """A record of `mcap.records` from its content; DamagedChunk if it has none of its form."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError

    stream = ReadDataStream(BytesIO(data))
    try:
        return kind.read(stream)
    except (McapError, ValueError, struct.error, OverflowError, MemoryError) as error:
        raise DamagedChunk(f"{kind.__name__} cannot be parsed") from error


def unpacked(data: bytes) -> bytes:
    """What a chunk holds, from the content of its record, held against its checksum.

    Raises
    ------
    DamagedChunk
        If it cannot be unpacked, or is not what was written.
    """
    import lz4.frame
    import zstandard
    from mcap.records import Chunk

    chunk = parse(Chunk, data)
    try:
        if chunk.compression == "lz4":
            inside = lz4.frame.decompress(chunk.data)
        elif chunk.compression == "zstd":
            inside = zstandard.decompress(chunk.data, chunk.uncompressed_size)
        elif not chunk.compression:
            inside = chunk.data
        else:
            raise DamagedChunk(f"its compression {chunk.compression!r} is not known")
    except (RuntimeError, ValueError, MemoryError, zstandard.ZstdError) as error:
        raise DamagedChunk("it cannot be unpacked") from error
    if len(inside) != chunk.uncompressed_size:
        raise DamagedChunk(f"it has {len(inside)} bytes, and should have {chunk.uncompressed_size}")
    if chunk.uncompressed_crc and zlib.crc32(inside) != chunk.uncompressed_crc:
        raise DamagedChunk("its checksum is another one")
    return inside


def records_of(inside: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, and begin and end of the content, of each whole record in what a chunk holds."""
    position, size = 0, len(inside)
    while position + HEAD.size <= size:
        opcode, length = HEAD.unpack_from(inside, position)
        position += HEAD.size
        if position + length > size:
            return
        yield opcode, position, position + length
        position += length


def read_index(data: bytes) -> tuple[int, np.ndarray]:
    """Channel, and times of its messages in a chunk [ns], from the content of a message index."""
    channel, length = _INDEX_HEAD.unpack_from(data)
    entries = np.frombuffer(data, "<u8", length // 8, _INDEX_HEAD.size)
    return channel, entries[::2]
