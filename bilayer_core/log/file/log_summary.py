"""Summary at the end of a finished MCAP file: its types and topics, and where its chunks are."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator
from typing import BinaryIO

import numpy as np

from bilayer_core.log.file.chunk_table import MOST_CHUNKS, MOST_RUNS
from bilayer_core.log.file.log_opening import is_finished
from bilayer_core.log.file.log_records import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    FOOTER,
    HEAD,
    SCHEMA,
    STATISTICS,
    DamagedChunk,
    Definitions,
    Place,
    content,
    parse,
    summary_start,
    walk,
)


class Summary:
    """The summary of a file, in some bytes for each chunk.

    Parameters
    ----------
    file : BinaryIO
    begin : int
        Where its summary begins [bytes].

    Attributes
    ----------
    definitions : Definitions
        Its types and topics.
    message_count : int or None
        None where the file does not say.
    message_counts : dict or None
        Number of messages of each channel.
    starts, ends : array
        Times of the first and the last message of each chunk [ns].
    """

    def __init__(self, file: BinaryIO, begin: int):
        from mcap.records import ChunkIndex, Statistics

        self.definitions = Definitions()
        self.message_count: int | None = None
        self.message_counts: dict[int, int] | None = None
        self.starts, self.ends = array("Q"), array("Q")
        self._begins, self._lengths, self._index_lengths = array("Q"), array("Q"), array("Q")
        # Channels of all chunks, one chunk after the other, and where those of each chunk end.
        self._channels, self._channel_ends = array("H"), array("I")
        self._size = file.seek(0, 2)
        for place in walk(file, begin):
            if place.opcode in (SCHEMA, CHANNEL):
                self.definitions.take(place.opcode, content(file, place))
            elif place.opcode == STATISTICS:
                statistics = parse(Statistics, content(file, place))
                self.message_count = statistics.message_count
                self.message_counts = statistics.channel_message_counts
            elif place.opcode == CHUNK_INDEX:
                self._add(parse(ChunkIndex, content(file, place)))
            elif place.opcode == FOOTER:
                break

    def __len__(self) -> int:
        return len(self._begins)

    @property
    def is_index(self) -> bool:
        """True if the summary lists all that the file holds; other writers may leave parts of it out."""
        schemas, channels = self.definitions.schemas, self.definitions.channels
        if self.message_count == 0:
            return True
        known = all(not channel.schema_id or channel.schema_id in schemas for channel in channels.values())
        return bool(self._begins and channels) and known

    def place(self, chunk: int) -> Place:
        """Return where a chunk is."""
        return Place(CHUNK, self._begins[chunk] + HEAD.size, self._lengths[chunk] - HEAD.size)

    def has(self, chunk: int, channels: Collection[int]) -> bool:
        """Return whether a chunk may have messages of some channels: the file says so, or does not say what it has."""
        begin, end = self._channel_ends[chunk - 1] if chunk else 0, self._channel_ends[chunk]
        return begin == end or any(channel in channels for channel in self._channels[begin:end])

    def is_empty(self, chunk: int) -> bool:
        """Return whether a chunk has no messages."""
        return not self.ends[chunk] and (self._channel_ends[chunk - 1] if chunk else 0) == self._channel_ends[chunk]

    def chunks(self) -> Iterator[tuple[Place, int]]:
        """Yield each chunk in the order of the file, with the length of the indexes that follow it [bytes].

        Raises DamagedChunk if chunks lie over each other.
        """
        end = 0
        for chunk in np.argsort(np.asarray(self._begins), kind="stable").tolist():
            place, length = self.place(chunk), self._index_lengths[chunk]
            if place.begin < end:
                raise DamagedChunk(f"its index has two chunks at byte {place.begin}")
            end = place.end + length
            yield place, length

    def _add(self, index) -> None:
        if len(self) == MOST_CHUNKS or len(self._channels) + len(index.message_index_offsets) > MOST_RUNS:
            raise DamagedChunk(f"its index has more than {MOST_CHUNKS:,} chunks, the most that are read")
        length = index.chunk_length + index.message_index_length
        if index.chunk_length < HEAD.size or index.chunk_start_offset + length > self._size:
            raise DamagedChunk("its index has a chunk where there is none")
        self._begins.append(index.chunk_start_offset)
        self._lengths.append(index.chunk_length)
        self._index_lengths.append(index.message_index_length)
        self.starts.append(index.message_start_time)
        self.ends.append(index.message_end_time)
        self._channels.extend(index.message_index_offsets)
        self._channel_ends.append(len(self._channels))


def read_summary(file: BinaryIO) -> Summary | None:
    """Return the summary of a finished file, or None; DamagedChunk if it is damaged."""
    begin = summary_start(file) if is_finished(file) else 0
    return Summary(file, begin) if begin else None
