"""Messages of a finished log by their time, from any instant on, with one chunk of the file in memory.

Any MCAP file with an index will do, those of rosbag2 as well: only topics, types, times and bytes are looked at.
"""

from __future__ import annotations

import bisect
import itertools
import shlex
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from bilayer_core.errors import InputError
from bilayer_core.record.opening import damage_told, is_finished, open_log
from bilayer_core.record.topics import QOS

CHUNKS_AT_ONCE = 64
"""In whose index messages are looked for at once, some seconds of a log."""


@dataclass(frozen=True)
class Channel:
    """What a log holds of one topic.

    Attributes
    ----------
    number : int
        Within the log.
    topic, type : str
        The type is a ROS type such as ``std_msgs/msg/Float64`` where the log holds ROS messages.
    encoding : str
        Of messages; ``cdr`` for those of ROS 2.
    qos : str
        What the log says of the quality of service, YAML in the form of rosbag2; empty where it says nothing.
    count : int or None
        Messages; None where the log does not say.
    """

    number: int
    topic: str
    type: str
    encoding: str
    qos: str
    count: int | None


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
        from mcap.reader import SeekingReader

        self.path = Path(path)
        with ExitStack() as undo:
            file = undo.enter_context(open_log(self.path))
            finished = is_finished(file)
            self._reader = SeekingReader(file, validate_crcs=True)
            summary = self._reader.get_summary() if finished else None
            count = summary.statistics.message_count if summary is not None and summary.statistics else None
            if summary is None or (count != 0 and not (summary.chunk_indexes and summary.channels)):
                raise _without_index(self.path)
            chunks = [chunk for chunk in summary.chunk_indexes if chunk.message_end_time or chunk.message_index_offsets]
            if not chunks:
                raise InputError(f"{self.path}: holds no message")
            self.start = min(chunk.message_start_time for chunk in chunks)
            self.end = max(chunk.message_end_time for chunk in chunks)
            self.channels = tuple(sorted(_channels(summary), key=lambda channel: (channel.topic, channel.number)))
            self._topics = {channel.number: channel.topic for channel in self.channels}
            # Of the parts in which messages are read: the reader puts all chunks of a part in order first, which for
            # those of ten minutes takes four times as long as to read one.
            starts = sorted({chunk.message_start_time for chunk in chunks})
            self._borders = starts[CHUNKS_AT_ONCE::CHUNKS_AT_ONCE]
            self._resources = undo.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def messages(self, channels: Collection[int], start: int) -> Iterator[Message]:
        """Messages of some channels from `start` [ns] on, by time; those of one time in the order of the file."""
        later = self._borders[bisect.bisect_right(self._borders, start) :]
        for begin, end in itertools.pairwise([start, *later, max(start, self.end) + 1]):
            yield from self._read(channels, starting_at=begin, ending_before=end)

    def latest(self, channel: int, before: int, count: int) -> list[Message]:
        """The last messages of a channel before a time [ns], at most `count`, by time."""
        return list(itertools.islice(self._read({channel}, ending_before=before, reverse=True), count))[::-1]

    def _read(self, channels: Collection[int], **options: int | bool) -> Iterator[Message]:
        topics = {self._topics[channel] for channel in channels}
        with damage_told(self.path):
            for _, channel, message in self._reader.iter_messages(topics, **options):
                if channel.id in channels:
                    yield Message(channel.id, message.log_time, message.data)


def _channels(summary) -> Iterator[Channel]:
    counts = summary.statistics.channel_message_counts if summary.statistics is not None else None
    for channel in summary.channels.values():
        schema = summary.schemas.get(channel.schema_id)
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
