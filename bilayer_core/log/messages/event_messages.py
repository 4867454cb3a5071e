"""Events as messages ``rcl_interfaces/msg/Log``, which Foxglove, rerun and ``ros2 topic echo`` show as text."""

from __future__ import annotations

import struct

from bilayer_core.log.messages.cdr import HEADER, NANOSECONDS, Template
from bilayer_core.log.messages.events import Event

_HEAD = struct.Struct("<iIB")


def encode_event(event: Event) -> bytes:
    """Return the message of an event; its file, function and line are empty."""
    template = Template()
    template.stamp()
    template.put("u1", event.level)
    for text in (event.name, event.text, "", ""):
        template.text(text)
    template.put("<u4", 0)
    template.set_time(event.time)
    return template.to_bytes()


def decode_event(data: bytes) -> Event:
    """Return the event in a message of `encode_event`."""
    seconds, rest, level = _HEAD.unpack_from(data, len(HEADER))
    place, texts = len(HEADER) + _HEAD.size, []
    for _ in range(2):
        place += -(place - len(HEADER)) % 4
        (length,) = struct.unpack_from("<I", data, place)
        texts.append(data[place + 4 : place + 3 + length].decode())
        place += 4 + length
    return Event((seconds * NANOSECONDS + rest) / NANOSECONDS, level, *texts)
