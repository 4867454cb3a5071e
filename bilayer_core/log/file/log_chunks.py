"""An MCAP file as channels and chunks: which messages it has is known from its indexes, without unpacking a chunk."""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.file.chunk_table import ChunkTable
from bilayer_core.log.file.log_opening import open_log
from bilayer_core.log.file.log_records import (
    CHANNEL,
    CHUNK,
    DATA_END,
    LARGEST_CHUNK,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    SCHEMA,
    Definitions,
    Place,
    content,
    read_chunk,
    read_index,
    records_of,
    walk,
)
from bilayer_core.log.file.log_summary import Summary, read_summary
from bilayer_core.log.messages.topics import LOG_NAMESPACE
from bilayer_core.printable import shortened

if TYPE_CHECKING:
    from mcap.records import Channel

MOST_BARE = 1 << 20
"""Of messages that stand outside of chunks, as many as are read at once [bytes]."""


class LogFile:
    """Content of an MCAP file, whole or cut off.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    path : Path
    namespace : str
        What the names of a run's topics begin with.
    has_index : bool
        Whether the file was finished with an index.
    topics : dict
        Full name of each topic -> ROS type.

    Raises
    ------
    InputError
        If it is no MCAP file, or is damaged, or has more in it than is read.
    """

    namespace = LOG_NAMESPACE

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self._definitions = Definitions()
        self._chunks = ChunkTable()
        with open_log(self.path) as file:
            summary = read_summary(file)
            self.has_index = summary is not None and summary.is_index
            if self.has_index:
                self._take(summary, file)
            else:
                self._scan(file)
        self.topics = {channel.topic: self._type_of(channel) for channel in self.channels.values()}

    @property
    def channels(self) -> dict[int, Channel]:
        """Topics in the file by their numbers."""
        return self._definitions.channels

    def times(self, topic: str) -> np.ndarray:
        """Return when each message of a topic was logged [ns], in the order of the file."""
        return self._chunks.times(self._numbers({topic}))

    def count(self, topic: str) -> int:
        """Return how many messages of a topic there are."""
        return self._chunks.count(self._numbers({topic}))

    def spans(self) -> dict[str, tuple[int, int, int]]:
        """Return number of messages, and first and last time [ns], of each topic that has some."""
        found: dict[str, tuple[int, int, int]] = {}
        for number, (count, first, last) in self._chunks.spans().items():
            if number in self.channels:
                topic = self.channels[number].topic
                others = found.get(topic, (0, first, last))
                found[topic] = count + others[0], min(first, others[1]), max(last, others[2])
        return found

    def messages(self, topics: set[str] | None = None, begin: int = 0) -> Iterator[tuple[str, int, bytes]]:
        """Return the topic, time [ns] and data of each message of some topics (default all), in the order of the file.

        Chunks that have none of them, or whose messages are all before `begin` [ns], are not unpacked.
        """
        return ((topic, time, data) for topic, time, _, data in self.records(topics, begin))

    def records(self, topics: set[str] | None = None, begin: int = 0) -> Iterator[tuple[str, int, int, bytes]]:
        """Yield what `messages` yields, with the time at which a message was sent [ns] before its data."""
        with open_log(self.path) as file:
            for place, wanted in self._chunks.with_messages(self._numbers(topics), begin):
                inside = read_chunk(file, place)
                for opcode, start, end in records_of(inside):
                    if opcode != MESSAGE:
                        continue
                    number, _, time, sent = MESSAGE_HEAD.unpack_from(inside, start)
                    if number in wanted:
                        yield self.channels[number].topic, time, sent, inside[start + MESSAGE_HEAD.size : end]

    def _numbers(self, topics: set[str] | None) -> list[int]:
        return [number for number, channel in self.channels.items() if topics is None or channel.topic in topics]

    def _take(self, summary: Summary, file: BinaryIO) -> None:
        """Take the places of messages from the file's own index."""
        self._definitions = summary.definitions
        for place, length in summary.chunks():
            self._chunks.begin(place)
            for index in walk(file, place.end):
                if index.opcode != MESSAGE_INDEX or index.end > place.end + length:
                    break
                self._add_index(content(file, index))
            if not length:
                self._look_into(file)

    def _scan(self, file: BinaryIO) -> None:
        """Index a file without an index of its own, record by record."""
        indexed, known = True, False
        for place in walk(file):
            if place.opcode == MESSAGE_INDEX and self._chunks and self._chunks[-1].opcode == CHUNK:
                if not known and not self._add_index(content(file, place)):
                    self._look_into(file)
                    known = True  # from the chunk itself; what its other indexes say would count twice
                indexed = True
            elif place.opcode in (SCHEMA, CHANNEL, MESSAGE) and self._extend(place):
                indexed = False
            elif place.opcode in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
                if not indexed:
                    self._look_into(file)
                bare = place.opcode != CHUNK
                self._chunks.begin(Place(MESSAGE, place.begin, place.end - place.begin) if bare else place)
                indexed = known = False
            elif place.opcode == DATA_END:
                break
        if self._chunks:
            self._look_into(file)  # the last one may have lost a part of its indexes

    def _extend(self, place: Place) -> bool:
        """Add a record outside of chunks to the one before it."""
        last = self._chunks[-1] if self._chunks else None
        if last is None or last.opcode == CHUNK or last.end != place.begin:
            return False
        if last.length > MOST_BARE or place.end - last.offset > LARGEST_CHUNK:
            return False
        self._chunks.extend(place.end)
        return True

    def _look_into(self, file: BinaryIO) -> None:
        """Take channels and times of the last chunk from the chunk itself."""
        times: dict[int, array] = defaultdict(lambda: array("Q"))
        inside = read_chunk(file, self._chunks[-1])
        for opcode, start, end in records_of(inside):
            if opcode == MESSAGE:
                number, _, time, _ = MESSAGE_HEAD.unpack_from(inside, start)
                times[number].append(time)
            elif opcode in (SCHEMA, CHANNEL):
                self._definitions.take(opcode, inside[start:end])
        self._chunks.forget()
        for number, of in times.items():
            self._chunks.add(number, np.asarray(of))

    def _type_of(self, channel: Channel) -> str:
        """Return the type of a topic, or nothing where the file does not say."""
        schema = self._definitions.schemas.get(channel.schema_id)
        if channel.schema_id and schema is None:
            raise InputError(f"{self.path}: is damaged: the type of {shortened(channel.topic)} is missing")
        return "" if schema is None else schema.name

    def _add_index(self, data: bytes) -> bool:
        """Take a message index of the last chunk; False if it speaks of a channel that is not known yet."""
        number, times = read_index(data)
        if number not in self.channels:
            return False
        self._chunks.add(number, times)
        return True
