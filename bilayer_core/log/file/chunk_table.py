"""Which messages each chunk of a file has: their channels and times, in some bytes each, however many there are."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Iterator

import numpy as np

from bilayer_core.log.file.log_records import DamagedChunk, Place

MOST_MESSAGES = 12_000_000
"""Of a file: some hours of a run."""
MOST_RUNS = 3_000_000
"""Of a file: messages of one channel in one chunk count as one."""
MOST_CHUNKS = 1_000_000
"""Of a file with messages in them."""


class ChunkTable:
    """The chunks of a file, in its order, and the times of the messages of each channel in them [ns].

    All methods that add something raise DamagedChunk where the file has more than is read: `MOST_MESSAGES`,
    `MOST_RUNS` or `MOST_CHUNKS`.
    """

    def __init__(self) -> None:
        self._opcodes, self._offsets, self._lengths = array("B"), array("Q"), array("Q")
        # Of each channel in each chunk: their numbers, how many messages there are, and the latest of their times.
        self._chunk, self._channel, self._count, self._latest = array("I"), array("H"), array("I"), array("Q")
        self._times = array("Q")

    def __len__(self) -> int:
        return len(self._offsets)

    def __getitem__(self, chunk: int) -> Place:
        return Place(self._opcodes[chunk], self._offsets[chunk], self._lengths[chunk])

    def begin(self, place: Place) -> None:
        """Add a chunk, whose messages follow."""
        if len(self) == MOST_CHUNKS:
            raise DamagedChunk(f"it has more than {MOST_CHUNKS:,} chunks, the most that are read")
        self._opcodes.append(place.opcode)
        self._offsets.append(place.offset)
        self._lengths.append(place.length)

    def extend(self, end: int) -> None:
        """Let the last chunk go on up to an offset in the file [bytes]."""
        self._lengths[-1] = end - self._offsets[-1]

    def add(self, channel: int, times: np.ndarray) -> None:
        """Add the messages of a channel to the last chunk."""
        if not len(times):
            return
        if len(self._times) + len(times) > MOST_MESSAGES or len(self._chunk) == MOST_RUNS:
            raise DamagedChunk(f"it has more than {MOST_MESSAGES:,} messages, the most that are read")
        self._chunk.append(len(self) - 1)
        self._channel.append(channel)
        self._count.append(len(times))
        self._latest.append(int(times.max()))
        self._times.frombytes(memoryview(np.ascontiguousarray(times, np.uint64)).cast("B"))

    def forget(self) -> None:
        """Forget the messages of the last chunk."""
        while self._chunk and self._chunk[-1] == len(self) - 1:
            del self._times[len(self._times) - self._count[-1] :]
            for column in (self._chunk, self._channel, self._count, self._latest):
                column.pop()

    def times(self, channels: Collection[int]) -> np.ndarray:
        """Return the times of all messages of some channels [ns], in the order of the file."""
        return np.asarray(self._times)[np.repeat(self._are(channels), np.asarray(self._count))]

    def count(self, channels: Collection[int]) -> int:
        """Return how many messages some channels have."""
        return int(np.asarray(self._count)[self._are(channels)].sum())

    def spans(self) -> dict[int, tuple[int, int, int]]:
        """Return number of messages, and first and last time [ns], of each channel that has some."""
        if not self._chunk:
            return {}
        counts = np.array(self._count, np.int64)
        begins = np.cumsum(counts) - counts
        first = np.minimum.reduceat(np.asarray(self._times), begins)
        channels, latest = np.asarray(self._channel), np.asarray(self._latest)
        found = {}
        for channel in np.unique(channels).tolist():
            rows = channels == channel
            found[channel] = int(counts[rows].sum()), int(first[rows].min()), int(latest[rows].max())
        return found

    def with_messages(self, channels: Collection[int], begin: int = 0) -> Iterator[tuple[Place, set[int]]]:
        """Yield each chunk that has messages of some channels at or after a time [ns], and which of them it has."""
        chunk, found = -1, set()
        wanted = set(channels)
        for of, channel, latest in zip(self._chunk, self._channel, self._latest, strict=True):
            if of != chunk and found:
                yield self[chunk], found
                found = set()
            chunk = of
            if channel in wanted and latest >= begin:
                found.add(channel)
        if found:
            yield self[chunk], found

    def _are(self, channels: Collection[int]) -> np.ndarray:
        """Return which runs of messages are of some channels."""
        return np.isin(np.asarray(self._channel), list(channels))
