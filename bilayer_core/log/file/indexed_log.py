"""Messages of a finished log by their time, from any instant on, with those chunks in memory that overlap in time.

Any MCAP file with an index will do, those of rosbag2 as well: only topics, types, times and bytes are looked at.
"""

from __future__ import annotations

import heapq
import shlex
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from bilayer_core.errors import InputError
from bilayer_core.log.file.log_opening import damage_told, open_log
from bilayer_core.log.file.log_records import MESSAGE, MESSAGE_HEAD, read_chunk, records_of
from bilayer_core.log.file.log_summary import Summary, read_summary
from bilayer_core.log.messages.topics import QOS

MOST_WAITING = 500_000_000
"""Of messages of chunks that overlap in time [bytes]."""


@dataclass(frozen=True)
class Channel:
    """Topic in a log: its type, encoding, quality of service and number of messages."""

    number: int  # Within the log
    topic: str
    type: str
    """`topic`, `type`: the type is a ROS type such as ``std_msgs/msg/Float64`` where the log holds ROS messages."""
    encoding: str  # Of messages; ``cdr`` for those of ROS 2
    qos: str  # What the log says of the quality of service, YAML in the form of rosbag2; empty where it says nothing
    count: int | None  # Messages; None where the log does not say


@dataclass(frozen=True)
class Message:
    """One message: number of its channel, time [ns], and bytes."""

    channel: int
    time: int
    data: bytes


class IndexedLog:
    """A log, read by time.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    path : Path
    channels : tuple of Channel
        In the order of their topics.
    start, end : int
        Times of the first and the last message [ns].

    Raises
    ------
    InputError
        If the file is no log, holds no message, or has no index as it was cut off. All methods raise it where the file
        is damaged.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        with ExitStack() as undo:
            self._file = undo.enter_context(open_log(self.path))
            summary = read_summary(self._file)
            if summary is None or (summary.message_count != 0 and not (len(summary) and summary.definitions.channels)):
                raise _without_index(self.path)
            self._summary = summary
            self._chunks = [chunk for chunk in range(len(summary)) if not summary.is_empty(chunk)]
            if not self._chunks:
                raise InputError(f"{self.path}: holds no message")
            self._chunks.sort(key=lambda chunk: (summary.starts[chunk], summary.place(chunk).begin))
            self.start = summary.starts[self._chunks[0]]
            self.end = max(summary.ends[chunk] for chunk in self._chunks)
            self.channels = tuple(sorted(_channels(summary), key=lambda channel: (channel.topic, channel.number)))
            self._resources = undo.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def messages(self, channels: Collection[int], start: int) -> Iterator[Message]:
        """Yield the messages of some channels from `start` [ns] on, by time; those of one time in the order of the
        file.
        """
        waiting: list[_Placed] = []
        size, starts, ends = 0, self._summary.starts, self._summary.ends
        for chunk in self._chunks:
            if ends[chunk] < start or not self._summary.has(chunk, channels):
                continue
            while waiting and waiting[0][0] < starts[chunk]:
                message = heapq.heappop(waiting)[-1]
                size -= len(message.data)
                yield message
            for placed in self._of_chunk(chunk, channels):
                if placed[0] >= start:
                    heapq.heappush(waiting, placed)
                    size += len(placed[-1].data)
            if size > MOST_WAITING:
                raise InputError(f"{self.path}: more than {MOST_WAITING / 1e6:g} MB of its messages overlap in time")
        while waiting:
            yield heapq.heappop(waiting)[-1]

    def latest(self, channel: int, before: int, count: int) -> list[Message]:
        """Return the last messages of a channel before a time [ns], at most `count`, sorted by time."""
        found: list[_Placed] = []
        starts, ends = self._summary.starts, self._summary.ends
        for chunk in sorted(self._chunks, key=ends.__getitem__, reverse=True):
            if len(found) == count and (not found or ends[chunk] < found[0][0]):
                break
            if starts[chunk] >= before or not self._summary.has(chunk, {channel}):
                continue
            for placed in self._of_chunk(chunk, {channel}):
                if placed[0] < before:
                    (heapq.heappush if len(found) < count else heapq.heappushpop)(found, placed)
        return [placed[-1] for placed in sorted(found)]

    def _of_chunk(self, chunk: int, channels: Collection[int]) -> Iterator[_Placed]:
        """Yield the messages of some channels of a chunk, with their time and place, by which they are put in order."""
        place = self._summary.place(chunk)
        with damage_told(self.path):
            inside = read_chunk(self._file, place)
            for opcode, start, end in records_of(inside):
                if opcode == MESSAGE:
                    number, _, time, _ = MESSAGE_HEAD.unpack_from(inside, start)
                    if number in channels:
                        message = Message(number, time, inside[start + MESSAGE_HEAD.size : end])
                        yield time, place.begin, start, message


_Placed = tuple[int, int, int, Message]


def _channels(summary: Summary) -> Iterator[Channel]:
    counts = summary.message_counts
    for channel in summary.definitions.channels.values():
        schema = summary.definitions.schemas.get(channel.schema_id)
        yield Channel(
            number=channel.id,
            topic=channel.topic,
            type=schema.name if schema is not None else "",
            encoding=channel.message_encoding,
            qos=channel.metadata.get(QOS, ""),
            count=None if counts is None else counts.get(channel.id, 0),
        )


def _without_index(path: Path) -> InputError:
    return InputError(
        f"{path}: has no index, by which messages are found, as it was cut off or is still being written; make a whole "
        f"log of it first: bilayer repair {shlex.quote(str(path))} NEW.mcap"
    )
