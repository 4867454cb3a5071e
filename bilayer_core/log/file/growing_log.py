"""A log that another program is writing: its messages, as chunks come."""

from __future__ import annotations

import os
from pathlib import Path

from bilayer_core.errors import InputError
from bilayer_core.log.file.log_head import Head, read_head
from bilayer_core.log.file.log_opening import open_log
from bilayer_core.log.file.log_records import (
    CHANNEL,
    CHUNK,
    FOOTER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    Definitions,
    content,
    read_chunk,
    records_of,
    walk,
)

Message = tuple[str, int, bytes]


class GrowingLog:
    """Reader of the messages added to a log since the last look at it; only whole chunks are read.

    Raises InputError if it is no log, or, from `read` too, is damaged.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self._begin()

    def _begin(self) -> None:
        self.head: Head = read_head(self.path)  # Its scene, versions and settings
        self.finished = False  # Whether its writer has finished it
        self._place = len(MAGIC)
        self._definitions = Definitions()
        self._file_number = os.stat(self.path).st_ino

    @property
    def replaced(self) -> bool:
        """True if another log has been begun under its name."""
        try:
            now = os.stat(self.path)
        except FileNotFoundError:
            return False
        return now.st_ino != self._file_number or now.st_size < self._place

    def restart(self) -> bool:
        """Go on with the log that replaced this one; False as long as its head is not written."""
        try:
            self._begin()
        except InputError:
            return False
        return True

    def read(self) -> list[Message]:
        """Return the topic, time [ns] and data of each message that was added, those of about 8 MB at most."""
        found: list[Message] = []
        size = 0
        with open_log(self.path) as file:
            for place in walk(file, self._place):
                self._place = place.end
                if place.opcode == CHANNEL:
                    self._definitions.take(CHANNEL, content(file, place))
                elif place.opcode == CHUNK:
                    inside = read_chunk(file, place)
                    size += len(inside)
                    found += self._messages(inside)
                elif place.opcode == FOOTER:
                    self.finished = True
                    break
                if size > MOST_AT_ONCE:
                    break
        return found

    def _messages(self, inside: bytes) -> list[Message]:
        found: list[Message] = []
        channels = self._definitions.channels
        for opcode, start, end in records_of(inside):
            if opcode == CHANNEL:
                self._definitions.take(CHANNEL, inside[start:end])
            elif opcode == MESSAGE:
                number, _, time, _ = MESSAGE_HEAD.unpack_from(inside, start)
                if number in channels:
                    found.append((channels[number].topic, time, inside[start + MESSAGE_HEAD.size : end]))
        return found


MOST_AT_ONCE = 8 << 20
"""About as much is unpacked at once [bytes]."""
