"""An MCAP file as channels and chunks: which messages it has is known from its indexes, without unpacking a chunk."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.record.log_records import (
    CHANNEL,
    CHUNK,
    DATA_END,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    SCHEMA,
    DamagedChunk,
    Place,
    content,
    parse,
    read_index,
    records_of,
    unpacked,
    walk,
)
from bilayer_core.record.opening import is_finished, open_log
from bilayer_core.record.topics import LOG_NAMESPACE

MOST_BARE = 1 << 20
"""Of messages that stand outside of chunks, as many as are read at once [bytes]."""


@dataclass(frozen=True)
class LogChannel:
    """A topic in a file: its full name and ROS type, how its messages are encoded, and what rosbag2 is told of it."""

    topic: str
    type: str
    encoding: str
    metadata: dict[str, str]


@dataclass
class _Chunk:
    """A chunk, or messages that stand outside of one, with the times of the messages of each channel [ns]."""

    place: Place
    bare: bool
    times: dict[int, np.ndarray]


class LogFile:
    """What an MCAP file holds, whole or cut off.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    path : Path
    namespace : str
        What the names of a run's topics begin with.
    channels : dict
        Number -> `LogChannel`.
    has_index : bool
        Whether the file was finished with an index.
    topics : dict
        Full name of each topic -> ROS type.

    Raises
    ------
    InputError
        If it is no MCAP file, or is damaged.
    """

    namespace = LOG_NAMESPACE

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self.channels: dict[int, LogChannel] = {}
        self._schemas: dict[int, str] = {}
        self._chunks: list[_Chunk] = []
        with open_log(self.path) as file:
            summary = read_summary(file)
            self.has_index = summary is not None and _is_index(summary)
            if self.has_index:
                self._take(summary, file)
            else:
                self._scan(file)
        self.topics = {channel.topic: channel.type for channel in self.channels.values()}

    def times(self, topic: str) -> np.ndarray:
        """When each message of a topic was logged [ns], in the order of the file."""
        of = [times for chunk in self._chunks for number, times in chunk.times.items() if self._is(number, {topic})]
        return np.concatenate(of) if of else np.empty(0, np.uint64)

    def messages(self, topics: set[str] | None = None, begin: int = 0) -> Iterator[tuple[str, int, bytes]]:
        """Topic, time [ns] and data of each message of some topics (default all), in the order of the file.

        Chunks that have none of them, or whose messages are all before `begin` [ns], are not unpacked.
        """
        return ((topic, time, data) for topic, time, _, data in self.records(topics, begin))

    def records(self, topics: set[str] | None = None, begin: int = 0) -> Iterator[tuple[str, int, int, bytes]]:
        """Yield what `messages` yields, with the time at which a message was sent [ns] before its data."""
        with open_log(self.path) as file:
            for chunk in self._chunks:
                wanted = {
                    number: self.channels[number].topic
                    for number, times in chunk.times.items()
                    if len(times) and int(times.max()) >= begin and self._is(number, topics)
                }
                if not wanted:
                    continue
                inside = self._inside(file, chunk)
                for opcode, start, end in records_of(inside):
                    if opcode != MESSAGE:
                        continue
                    number, _, time, sent = MESSAGE_HEAD.unpack_from(inside, start)
                    if number in wanted:
                        yield wanted[number], time, sent, inside[start + MESSAGE_HEAD.size : end]

    def _is(self, number: int, topics: set[str] | None) -> bool:
        return number in self.channels and (topics is None or self.channels[number].topic in topics)

    def _inside(self, file: BinaryIO, chunk: _Chunk) -> bytes:
        data = content(file, chunk.place)
        if chunk.bare:
            return data
        try:
            return unpacked(data)
        except DamagedChunk as error:
            raise DamagedChunk(f"the chunk at byte {chunk.place.begin}: {error}") from error

    def _take(self, summary, file: BinaryIO) -> None:
        """The file's own index."""
        self._schemas = {number: schema.name for number, schema in summary.schemas.items()}
        for channel in summary.channels.values():
            self._add_channel(channel)
        for index in sorted(summary.chunk_indexes, key=lambda of: of.chunk_start_offset):
            place = Place(CHUNK, index.chunk_start_offset + 9, index.chunk_length - 9)
            self._chunks.append(_Chunk(place, False, {}))
            file.seek(place.end)
            indexes = file.read(index.message_index_length)
            for opcode, start, end in records_of(indexes):
                if opcode == MESSAGE_INDEX:
                    self._add_index(indexes[start:end])
            if not index.message_index_length:
                self._look_into(file)

    def _scan(self, file: BinaryIO) -> None:
        """A file without an index, from record to record."""
        indexed = True
        for place in walk(file):
            if place.opcode == MESSAGE_INDEX and self._chunks and not self._chunks[-1].bare:
                if not self._add_index(content(file, place)):
                    self._look_into(file)
                indexed = True
            elif place.opcode in (SCHEMA, CHANNEL, MESSAGE) and self._extend(place):
                indexed = False
            elif place.opcode in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
                if not indexed:
                    self._look_into(file)
                bare = place.opcode != CHUNK
                place = Place(0, place.begin, place.end - place.begin) if bare else place
                self._chunks.append(_Chunk(place, bare, {}))
                indexed = False
            elif place.opcode == DATA_END:
                break
        if self._chunks:
            self._look_into(file)  # the last one may have lost a part of its indexes

    def _extend(self, place: Place) -> bool:
        """Add a record outside of chunks to the one before it."""
        last = self._chunks[-1] if self._chunks else None
        if last is None or not last.bare or last.place.end != place.begin or last.place.length > MOST_BARE:
            return False
        last.place = Place(0, last.place.offset, place.end - last.place.offset)
        return True

    def _look_into(self, file: BinaryIO) -> None:
        """Take channels and times of the last chunk from the chunk itself."""
        from mcap.records import Channel, Schema

        times = defaultdict(list)
        inside = self._inside(file, self._chunks[-1])
        for opcode, start, end in records_of(inside):
            if opcode == MESSAGE:
                number, _, time, _ = MESSAGE_HEAD.unpack_from(inside, start)
                times[number].append(time)
            elif opcode == SCHEMA:
                schema = parse(Schema, inside[start:end])
                self._schemas[schema.id] = schema.name
            elif opcode == CHANNEL:
                self._add_channel(parse(Channel, inside[start:end]))
        self._chunks[-1].times = {number: np.array(of, np.uint64) for number, of in times.items()}

    def _add_channel(self, channel) -> None:
        if channel.schema_id and channel.schema_id not in self._schemas:
            raise InputError(f"{self.path}: is damaged: the type of {channel.topic} is missing")
        name = self._schemas.get(channel.schema_id, "")  # of number 0: the file does not say
        self.channels[channel.id] = LogChannel(channel.topic, name, channel.message_encoding, channel.metadata)

    def _add_index(self, data: bytes) -> bool:
        """Take a message index of the last chunk; False if it speaks of a channel that is not known yet."""
        number, times = read_index(data)
        if number not in self.channels:
            return False
        self._chunks[-1].times[number] = times
        return True


def _is_index(summary) -> bool:
    """Return whether a summary tells all that a file holds; other writers may leave parts of it out."""
    if summary.statistics is not None and summary.statistics.message_count == 0:
        return True
    described = all(channel.schema_id in (0, *summary.schemas) for channel in summary.channels.values())
    return bool(summary.chunk_indexes and summary.channels) and described


def read_summary(file: BinaryIO):
    """The index of a finished file (`mcap.summary.Summary`), or None."""
    from mcap.reader import SeekingReader

    finished = is_finished(file)
    file.seek(0)
    return SeekingReader(file).get_summary() if finished else None
