"""All small messages of a frame as one piece of a log: records that are laid out once and then overwritten.

A frame has one to three dozen of them, most below a hundred bytes. Made and written one by one they cost more than what
they say; here each is an assignment.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bilayer_core.log.file.mcap_file import message_head, time_and_sequence
from bilayer_core.log.messages.cdr import decode, nanoseconds, stamp_of
from bilayer_core.log.messages.encoders import SmallMessage
from bilayer_core.observed.frame import Frame


class FrameBlock:
    """Message records of a frame.

    Parameters
    ----------
    messages : mapping of str to SmallMessage
        By topic, in order.
    channels : mapping of str to int
        Number of each topic's channel.

    Attributes
    ----------
    records : bytearray
        As `fill` left them.
    places : list of (int, int)
        Channel of each record, and where it begins.
    """

    def __init__(self, messages: Mapping[str, SmallMessage], channels: Mapping[str, int]):
        self.records, self.places = bytearray(), []
        marks, stamps, parts = [], [], []
        for name, message in messages.items():
            self.places.append((channels[name], len(self.records)))
            head, mark = message_head(channels[name], len(message.template))
            marks.append(len(self.records) + mark)
            self.records += head
            begin = len(self.records)
            stamps += [begin + offset for offset in message.template.stamps]
            self.records += message.template.to_bytes()
            parts.append((message, begin))
        whole = memoryview(self.records)
        self._data = [
            (decode(whole[begin:], message.template.fields["data"]), message.values)
            for message, begin in parts
            if message.values is not None
        ]
        self._bytes = np.frombuffer(self.records, np.uint8)
        self._marks = np.array(marks)[:, None] + np.arange(len(time_and_sequence(0, 0)))
        self._stamps = np.array(stamps)[:, None] + np.arange(len(stamp_of(0)))

    def fill(self, frame: Frame, sequence: int) -> None:
        """Have the records be those of a frame."""
        for data, values in self._data:
            data[:] = values(frame)
        time = nanoseconds(frame.time)
        self._bytes[self._marks] = np.frombuffer(time_and_sequence(time, sequence), np.uint8)
        self._bytes[self._stamps] = np.frombuffer(stamp_of(time), np.uint8)
