"""All messages of a frame in one, ``std_msgs/UInt8MultiArray``: for who shows a run, whole or not at all.

Messages of many topics cannot be thinned together by who receives them; of one topic, frames that are lost are lost as
a whole. Its layout has a dimension whose label lists the parts: ``/bilayer_sim/com:52 /bilayer_sim/energy:180 ...``,
each a topic as logs name it and the length of its message [bytes], which stand one after the other in ``data``.
"""

from __future__ import annotations

from collections.abc import Sequence

from bilayer_core.errors import InputError


def pack(parts: Sequence[tuple[str, bytes]]) -> tuple[str, bytes]:
    """Return the label and data of messages by their topics."""
    label = " ".join(f"{topic}:{len(data)}" for topic, data in parts)
    return label, b"".join(data for _, data in parts)


def unpack(label: str, data: bytes) -> list[tuple[str, bytes]]:
    """Return the messages of a frame with their topics. Raises InputError if the label does not fit the data."""
    parts, place = [], 0
    for part in label.split():
        topic, _, length = part.rpartition(":")
        if not topic or not length.isdecimal():
            raise InputError(f"the parts of a frame are not understood: {part[:80]!r} is not TOPIC:LENGTH")
        parts.append((topic, data[place : place + int(length)]))
        place += int(length)
    if place != len(data):
        raise InputError(f"the parts of a frame are {place} bytes long, and the frame has {len(data)}")
    return parts
