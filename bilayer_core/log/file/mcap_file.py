"""Writes MCAP files from the records of the library `mcap`, with chunks put together by this module.

Its `Writer` makes a dozen Python objects for each message, half of what a log cost: a log has a thousand messages of a
hundred bytes in a simulated second. Here a message is two appends to the chunk in hand.
Records, their layout and the order in which they stand in the file are the library's.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import BinaryIO

MESSAGE = 5
"""Opcode of messages."""
_MESSAGE = struct.Struct("<BQH")
"""Opcode, length and channel of a message record, before `_MOMENT` and its data."""
_MOMENT = struct.Struct("<IQQ")
"""Sequence, log time and publish time [ns] of a message."""
_MESSAGE_HEAD = 2 + _MOMENT.size  # of what is before the data the part that the length counts [bytes]
_INDEX = struct.Struct("<BQHI")
"""Opcode, length, channel and length of the entries of a message index record, before its entries."""
_INDEX_HEAD = 2 + 4  # of that what the length counts [bytes]
_FOOTER = struct.Struct("<BQQQ")
"""What of the footer the checksum of the summary counts."""
_FOOTER_SIZE = 8 + 8 + 4


def message_head(channel: int, size: int) -> tuple[bytes, int]:
    """Return the bytes before `size` bytes of data in a message record, and where `time_and_sequence` is in them."""
    head = _MESSAGE.pack(MESSAGE, _MESSAGE_HEAD + size, channel)
    return head + bytes(_MOMENT.size), len(head)


def time_and_sequence(time: int, sequence: int) -> bytes:
    """Return the part of a message record that has its sequence number and its time [ns]."""
    return _MOMENT.pack(sequence, time, time)


class McapFile:
    """An MCAP file that is being written, in chunks compressed by lz4, with indexes of messages and a summary.

    Importing this module does not import mcap.

    Parameters
    ----------
    file : BinaryIO
        Open for writing, at its start.
    chunk_size : int
        From how many bytes on a chunk is written [bytes].
    profile, library : str
        For the header.
    chunk_written : callable
        Called after each chunk and its indexes; it may add metadata.
    """

    def __init__(
        self,
        file: BinaryIO,
        chunk_size: int,
        profile: str,
        library: str,
        chunk_written: Callable[[], None] = lambda: None,
    ):
        from mcap import records, writer
        from mcap.data_stream import RecordBuilder
        from mcap.opcode import Opcode

        self._records, self._builder, self._opcodes = records, RecordBuilder, Opcode
        self._file, self._chunk_size, self._magic = file, chunk_size, writer.MCAP0_MAGIC
        self._chunk_written = chunk_written
        self._place = 0
        self._schemas: list = []
        self._channels: list = []
        self._attachments: list = []
        self._metadata: list = []
        self._chunks: list = []
        self._counts: dict[int, int] = {}
        self._span = [0, 0]
        self._begin_chunk()
        self._put(self._magic)
        self._write(records.Header(profile, library))

    @property
    def waiting(self) -> bool:
        """True if a message waits for its chunk to be written."""
        return any(self._index.values())

    def add_attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment."""
        begin, own = self._place, {"name": name, "media_type": media_type, "create_time": 0, "log_time": 0}
        length = self._write(self._records.Attachment(**own, data=data))
        index = self._records.AttachmentIndex(**own, offset=begin, length=length, data_size=len(data))
        self._attachments.append(index)

    def add_metadata(self, name: str, metadata: Mapping[str, str]) -> None:
        """Write a metadata record."""
        begin = self._place
        length = self._write(self._records.Metadata(name=name, metadata=dict(metadata)))
        self._metadata.append(self._records.MetadataIndex(offset=begin, length=length, name=name))

    def add_schema(self, name: str, text: str) -> int:
        """Announce a message type; its number."""
        schema = self._records.Schema(id=len(self._schemas) + 1, name=name, encoding="ros2msg", data=text.encode())
        self._schemas.append(schema)
        self._chunk += self._bytes_of(schema)
        return schema.id

    def add_channel(self, topic: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Announce a topic; its number."""
        channel = self._records.Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding="cdr",
            schema_id=schema,
            metadata=dict(metadata),
        )
        self._channels.append(channel)
        self._index[channel.id] = []
        self._chunk += self._bytes_of(channel)
        return channel.id

    def describe_outside(self) -> None:
        """Write the types and topics announced so far outside of chunks, too: if the first chunk is lost, what follows
        can be read.
        """
        for record in (*self._schemas, *self._channels):
            self._write(record)

    def add_message(self, channel: int, time: int, sequence: int, data: bytes) -> None:
        """Put a message of a time [ns] into the chunk in hand, and write that if it is full."""
        head = _MESSAGE.pack(MESSAGE, _MESSAGE_HEAD + len(data), channel)
        self.add_records(head + time_and_sequence(time, sequence) + data, [(channel, 0)], time)

    def add_records(self, records: bytes | bytearray, places: Sequence[tuple[int, int]], time: int) -> None:
        """Put message records of one time [ns] into the chunk in hand, and write that if it is full.

        Parameters
        ----------
        records : bytes
        places : sequence of (int, int)
            Channel of each record, and where it begins.
        time : int
        """
        begin, index = len(self._chunk), self._index
        for channel, place in places:
            index[channel] += (time, begin + place)
        self._chunk += records
        if len(self._chunk) > self._chunk_size:
            self._write_chunk()

    def flush(self) -> None:
        """Write the chunk in hand, and all to the system."""
        if self.waiting:
            self._write_chunk()
        self._file.flush()

    def finish(self) -> None:
        """Write what is left, and the summary; the file stays open."""
        self.flush()
        self._write(self._records.DataEnd(0))
        begin, offsets = self._place, []
        summary = bytearray()
        groups = (
            (self._opcodes.SCHEMA, self._schemas),
            (self._opcodes.CHANNEL, self._channels),
            (self._opcodes.STATISTICS, [self._statistics()]),
            (self._opcodes.CHUNK_INDEX, self._chunks),
            (self._opcodes.ATTACHMENT_INDEX, self._attachments),
            (self._opcodes.METADATA_INDEX, self._metadata),
        )
        for opcode, group in groups:
            first = begin + len(summary)
            for item in group:
                summary += self._bytes_of(item)
            length = begin + len(summary) - first
            offsets.append(self._records.SummaryOffset(group_opcode=opcode, group_start=first, group_length=length))
        offset_begin = begin + len(summary)
        for offset in offsets:
            summary += self._bytes_of(offset)
        footer = _FOOTER.pack(self._opcodes.FOOTER, _FOOTER_SIZE, begin, offset_begin)
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        self._put(summary)
        self._write(self._records.Footer(summary_start=begin, summary_offset_start=offset_begin, summary_crc=checksum))
        self._put(self._magic)
        self._file.flush()

    def _statistics(self):
        return self._records.Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_start_time=self._span[0],
            message_end_time=self._span[1],
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _begin_chunk(self) -> None:
        self._chunk = bytearray()
        self._index: dict[int, list[int]] = {channel.id: [] for channel in self._channels}
        """Records of the chunk in hand; of each channel in it time and place of each message in turn."""

    def _write_chunk(self) -> None:
        """Write the chunk in hand with its index, and begin another."""
        import lz4.frame

        chunk, used = self._chunk, (item for item in self._index.items() if item[1])
        indexes = dict(sorted(used, key=lambda item: item[1][1]))  # by the first message of each channel
        times = [time for index in indexes.values() for time in index[::2]]
        start, end = min(times), max(times)
        self._span = [min(start, self._span[0]) if self._chunks else start, max(end, self._span[1])]
        data = lz4.frame.compress(chunk)
        common = {
            "compression": "lz4",
            "message_start_time": start,
            "message_end_time": end,
            "uncompressed_size": len(chunk),
        }
        begin = self._place
        length = self._write(self._records.Chunk(**common, data=data, uncompressed_crc=zlib.crc32(chunk)))
        index_begin, offsets, records = self._place, {}, bytearray()
        for channel, index in indexes.items():
            offsets[channel] = index_begin + len(records)
            size = 8 * len(index)
            records += _INDEX.pack(self._opcodes.MESSAGE_INDEX, _INDEX_HEAD + size, channel, size)
            records += struct.pack(f"<{len(index)}Q", *index)
            self._counts[channel] = self._counts.get(channel, 0) + len(index) // 2
        self._put(records)
        self._chunks.append(
            self._records.ChunkIndex(
                **common,
                chunk_start_offset=begin,
                chunk_length=length,
                message_index_offsets=offsets,
                message_index_length=len(records),
                compressed_size=len(data),
            )
        )
        self._begin_chunk()
        self._chunk_written()

    def _bytes_of(self, record) -> bytes:
        builder = self._builder()
        record.write(builder)
        return builder.end()

    def _write(self, record) -> int:
        """Write a record of the library; its length [bytes]."""
        data = self._bytes_of(record)
        self._put(data)
        return len(data)

    def _put(self, data: bytes | bytearray) -> None:
        self._file.write(data)
        self._place += len(data)
