"""Small MCAP files of any content, as other programs may write them."""

import struct

from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from bilayer_core.log.messages.cdr import HEADER

FLOAT = "std_msgs/msg/Float64"
LATCHED = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
"""Quality of service of what is transient local."""


def number(value) -> bytes:
    """A ``std_msgs/Float64``."""
    return HEADER + struct.pack("<d", value)


def value_of(data) -> float:
    """Of a ``std_msgs/Float64``."""
    return struct.unpack_from("<d", data, len(HEADER))[0]


def write_log(
    path,
    messages,
    types=None,
    qos=None,
    chunk_size=300,
    compression=CompressionType.LZ4,
    encoding="cdr",
    finish=True,
    **options,
):
    """Write a log.

    Parameters
    ----------
    path : Path
    messages : iterable of (str, float, bytes)
        Topic, time [s], data.
    types, qos : dict
        Of topics, by name: by default Float64, and nothing about the quality of service.
    """
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=compression, **options)
        writer.start(profile="ros2", library="tests")
        channels = {}
        for topic, time, data in messages:
            if topic not in channels:
                schema = writer.register_schema((types or {}).get(topic, FLOAT), "ros2msg", b"float64 data\n")
                metadata = {"offered_qos_profiles": qos[topic]} if topic in (qos or {}) else {}
                channels[topic] = writer.register_channel(topic, encoding, schema, metadata)
            stamp = round(time * 1e9)
            writer.add_message(channels[topic], stamp, data, stamp)
        if finish:
            writer.finish()
    return path


def damage(path):
    """Damage the chunk in the middle of a finished log."""
    with path.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    chunk = chunks[len(chunks) // 2]
    content = bytearray(path.read_bytes())
    for place in range(chunk.chunk_start_offset + 60, chunk.chunk_start_offset + chunk.chunk_length - 4):
        content[place] ^= 0x55
    path.write_bytes(content)


WITHOUT_INDEX = {"index_types": IndexType.NONE, "use_chunking": False}
