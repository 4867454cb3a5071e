"""Messages as templates: the CDR bytes are built once, and each frame overwrites the arrays in them.

The encoding is XCDR1, little-endian: a header of four bytes, then every field aligned to its own size (8 at most),
counted from the end of the header; a string is its length with the closing zero, its bytes, and the zero.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.printable import shortened

Value = TypeVar("Value")

HEADER = b"\x00\x01\x00\x00"
_STAMP = struct.Struct("<iI")
NANOSECONDS = 1_000_000_000
SEPARATOR = ","
"""Between the names in the label of an array of numbers."""


def nanoseconds(time: float) -> int:
    """Return a simulation time [s] as a whole number of nanoseconds."""
    return round(time * NANOSECONDS)


def seconds_text(time: int) -> str:
    """Return a time [ns] in seconds, with all its digits: also those of epoch times, which a float does not have."""
    whole, rest = divmod(abs(time), NANOSECONDS)
    return f"{'-' if time < 0 else ''}{whole}.{rest:09d}".rstrip("0").rstrip(".")


def stamp_of(time: int) -> bytes:
    """Return a ``builtin_interfaces/Time``, without padding before it, of a time [ns]."""
    return _STAMP.pack(*divmod(time, NANOSECONDS))


class Template:
    """A message whose layout is fixed; written field by field, then overwritten and copied out once a frame.

    Attributes
    ----------
    fields : dict
        Name -> (offset in the message [bytes], dtype, shape) of each array that changes.
    stamps : list of int
        Where times stand that `set_time` overwrites [bytes].
    """

    def __init__(self) -> None:
        self._buffer: bytearray | memoryview = bytearray(HEADER)
        self.stamps: list[int] = []
        self._of_stamps: tuple[np.ndarray, np.ndarray] | None = None
        self.fields: dict[str, tuple[int, np.dtype, tuple[int, ...]]] = {}

    def align(self, size: int) -> None:
        """Pad to a multiple of `size`."""
        self._buffer += bytes(-(len(self._buffer) - len(HEADER)) % size)

    def put(self, dtype: str, *values: float) -> None:
        """Append numbers of one little-endian type, for example ``"<u4"``, that never change."""
        array = np.array(values, dtype)
        self.align(array.itemsize)
        self._buffer += array.tobytes()

    def text(self, text: str) -> None:
        """Append a string."""
        data = text.encode() + b"\0"
        self.put("<u4", len(data))
        self._buffer += data

    def stamp(self) -> None:
        """Append a time that `set_time` overwrites."""
        self.align(4)
        self.stamps.append(len(self._buffer))
        self._buffer += bytes(_STAMP.size)

    def header(self, frame_id: str) -> None:
        """Append a ``std_msgs/Header``."""
        self.stamp()
        self.text(frame_id)

    def array(self, name: str, dtype: str, shape: tuple[int, ...], alignment: int | None = None) -> None:
        """Append zeros that `views` opens for writing. An array without elements has no padding before it."""
        kind = np.dtype(dtype)
        size = int(np.prod(shape)) * kind.itemsize
        if size:
            self.align(alignment or kind.itemsize)
        self.fields[name] = (len(self._buffer), kind, shape)
        self._buffer += bytes(size)

    def views(self) -> dict[str, np.ndarray]:
        """Return the writable arrays into the message, one for each field. Nothing can be appended afterwards."""
        self._end()
        return {name: decode(self._buffer, field) for name, field in self.fields.items()}

    def numbers(self, dtype: str) -> np.ndarray:
        """Return a view of all that it has as numbers of one type, which is to be complete; see `place`."""
        self._end()
        size = np.dtype(dtype).itemsize
        count = (len(self._buffer) - len(HEADER)) // size
        return np.frombuffer(self._buffer, dtype, count, len(HEADER))

    def place(self, name: str) -> int:
        """Return where an array that changes begins among the numbers of its type."""
        offset, dtype, _ = self.fields[name]
        return (offset - len(HEADER)) // dtype.itemsize

    def set_time(self, time: float) -> None:
        """Write simulation time [s] into every stamp."""
        if self._of_stamps is None:
            self._end()
            places = np.array(self.stamps, dtype=np.intp)[:, None] + np.arange(_STAMP.size)
            self._of_stamps = np.frombuffer(self._buffer, np.uint8), places
        buffer, places = self._of_stamps
        buffer[places] = np.frombuffer(stamp_of(nanoseconds(time)), np.uint8)

    def _end(self) -> None:
        """Move the complete message to where numbers after its header are aligned, as kernels want arrays."""
        if isinstance(self._buffer, bytearray):
            words = np.zeros(len(self._buffer) // 8 + 2)
            begin = 8 - len(HEADER)
            aligned = words.view(np.uint8)[begin : begin + len(self._buffer)]
            aligned[:] = self._buffer
            self._buffer = aligned.data

    def __len__(self) -> int:
        return len(self._buffer)

    def to_bytes(self) -> bytes:
        """Return a copy of the message in its present state."""
        return bytes(self._buffer)


def decode(data: bytes | bytearray | memoryview, field: tuple[int, np.dtype, tuple[int, ...]]) -> np.ndarray:
    """Return a view of one field (an item of `Template.fields`) of a message, without a copy."""
    offset, dtype, shape = field
    return np.frombuffer(data, dtype, int(np.prod(shape)), offset if np.prod(shape) else 0).reshape(shape)


def decoded(path: str | Path, topic: str, time: int, data: bytes, decode: Callable[[bytes], Value]) -> Value:
    """Return what a message in a file holds.

    `time`: of the message [ns]. `decode`: returns the value of `data`; raises ValueError, IndexError or struct.error if
    that has not the form of its type. Raises InputError if it has not.
    """
    try:
        return decode(data)
    except (ValueError, IndexError, OverflowError, struct.error) as error:
        where = f"{path}: {shortened(topic)}: the message at t = {time / NANOSECONDS:.9g} s"
        raise InputError(f"{where} is damaged, or not of its type: {error}") from error


def read_float64_multi_array(data: bytes) -> tuple[list[str], np.ndarray]:
    """Return the names and values of a ``std_msgs/Float64MultiArray``: names stand in the label of its one dimension,
    or, as older logs have them, each in one of its own.
    """
    position = len(HEADER)

    def unsigned() -> int:
        nonlocal position
        position += -(position - len(HEADER)) % 4
        (value,) = struct.unpack_from("<I", data, position)
        position += 4
        return value

    labels = []
    for _ in range(unsigned()):
        length = unsigned()
        label = data[position : position + length - 1].decode()
        position += length
        labels.append(label)
        unsigned(), unsigned()  # size, stride
    unsigned()  # data_offset
    count = unsigned()
    position += -(position - len(HEADER)) % 8 if count else 0
    names = [name for name in labels[0].split(SEPARATOR) if name] if len(labels) == 1 else labels
    return names, np.frombuffer(data, "<f8", count, position)
