"""Logs and saved states made by hand to fill the memory of their reader, each a few megabytes or less."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Metadata,
    Schema,
)
from mcap.writer import CompressionType, Writer

from bilayer_core.log.file.log_records import MAGIC
from bilayer_core.log.messages.cdr import HEADER
from bilayer_core.log.messages.description_text import to_text
from bilayer_core.log.messages.encoders import (
    SOLVER_LABELS,
    multi_array_template,
    point_cloud_template,
    pose_array_template,
    stamped_template,
)
from bilayer_core.log.messages.topics import output_topics
from bilayer_core.observed.frame import Description

GIGABYTE = 1 << 30
UNPACKED = 1 << 28
"""Size of a state, a few times the memory that its reader may take [bytes]."""
STATE = 1
"""Number of the topic of states."""


def packed(record) -> bytes:
    """A record as bytes."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


@cache
def frame(compression: str, data: bytes, times: int) -> bytes:
    """So many times the same data, compressed without holding them."""
    if compression == "zstd":
        one = zstandard.ZstdCompressor(level=1, write_content_size=False).compressobj()
        return b"".join([*(one.compress(data) for _ in range(times)), one.flush()])
    with lz4.frame.LZ4FrameCompressor() as one:
        return b"".join([one.begin(), *(one.compress(data) for _ in range(times)), one.flush()])


def chunk(compression: str, data: bytes, size: int) -> bytes:
    """A chunk that declares a size."""
    common = {"message_start_time": 0, "message_end_time": 10**9, "uncompressed_crc": 0}
    return packed(Chunk(compression=compression, data=data, uncompressed_size=size, **common))


def definitions() -> bytes:
    """A topic of states, outside of chunks."""
    schema = Schema(id=1, name="std_msgs/msg/Float64MultiArray", encoding="ros2msg", data=b"")
    channel = Channel(id=STATE, topic="/bilayer_sim/state", message_encoding="cdr", schema_id=1, metadata={})
    return packed(schema) + packed(channel)


def messages(count: int) -> bytes:
    """Messages of states that hold nothing."""
    one = packed(Message(channel_id=STATE, log_time=1, publish_time=1, sequence=0, data=b""))
    return one * count


def head(description: Description, **changes: str) -> bytes:
    """A log up to its first message; `changes` to the texts of its description."""
    scene = Attachment(0, 0, "scene.yaml", "application/yaml", description.scene_text.encode())
    records = [Header("ros2", "tests"), scene, Metadata("versions", {"bilayer_sim_ros": "0"}), Metadata("settings", {})]
    records.append(Metadata("description", to_text(description) | changes))
    return MAGIC + b"".join(map(packed, records))


def finished(data: bytes, summary: bytes = b"") -> bytes:
    """A file with its end."""
    data += packed(DataEnd(0))
    begin = len(data) if summary else 0
    return data + summary + packed(Footer(begin, 0, 0)) + MAGIC


def _numbers(description: Description, key: str, value: object) -> bytes:
    return finished(head(description, **{key: json.dumps(value)}) + definitions())


def _of_strand(description: Description, **changes: object) -> bytes:
    strands = json.loads(to_text(description)["strands"])
    strands[0] |= changes
    return _numbers(description, "strands", strands)


def _with_chunks(description: Description, *chunks: bytes) -> bytes:
    return head(description) + definitions() + b"".join(chunks)


def _bomb(compression: str, declared: int) -> bytes:
    return chunk(compression, frame(compression, bytes(1 << 20), 1024), declared)


def _many_messages(compression: str) -> bytes:
    """Chunks of a hundred megabytes, of messages without data."""
    data = messages(30_000)
    one = chunk(compression, frame(compression, data, 100), 100 * len(data))
    return one * 20


def _many_topics() -> bytes:
    """A chunk of topics with a hundred thousand keys each."""
    metadata = {f"{number:06}": "" for number in range(60_000)}
    one = Channel(id=2, topic="/x", message_encoding="", schema_id=0, metadata=metadata)
    text = packed(one)
    data = b"".join(text[:9] + struct.pack("<H", number) + text[11:] for number in range(2, 92))
    return chunk("zstd", zstandard.compress(data), len(data))


def _large_index(description: Description) -> bytes:
    """A chunk with an index of sixty million entries, which the file has but a part of."""
    one = packed(MessageIndex(STATE, []))
    entries = bytes(32_000_000)
    index = one[:1] + struct.pack("<QHI", 6 + len(entries), STATE, len(entries)) + entries
    return _with_chunks(description, chunk("", messages(1), len(messages(1))), index * 10)


def _same_chunk(description: Description) -> bytes:
    """An index that names one chunk many times, of sixty million messages."""
    data = _with_chunks(description)
    inside = messages(1000)
    one = chunk("", inside, len(inside))
    times = {"message_start_time": 0, "message_end_time": 10**9, "message_index_offsets": {}, "message_index_length": 0}
    sizes = {"compression": "", "compressed_size": len(inside), "uncompressed_size": len(inside)}
    entry = ChunkIndex(chunk_start_offset=len(data), chunk_length=len(one), **times, **sizes)
    return finished(data + one, definitions() + packed(entry) * 60_000)


def logs(description: Description) -> dict[str, bytes]:
    """Logs by what is hostile in them."""
    nodes = description.strands[0].nodes
    return {
        "lz4 that unpacks to more than it declares": _with_chunks(description, _bomb("lz4", 1000)),
        "zstd that unpacks to more than it declares": _with_chunks(description, _bomb("zstd", 1000)),
        "lz4 of a gigabyte": _with_chunks(description, _bomb("lz4", GIGABYTE)),
        "zstd of a gigabyte": _with_chunks(description, _bomb("zstd", GIGABYTE)),
        "zstd whose frame declares a terabyte": _with_chunks(
            description, chunk("zstd", b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 1 << 40) + b"\x01\0\0", 1000)
        ),
        "a chunk that declares more than a file can have": _with_chunks(description, chunk("lz4", b"", 2**64 - 1)),
        "many messages": _with_chunks(description, _many_messages("zstd")),
        "many topics": _with_chunks(description, _many_topics()),
        "a large index": _large_index(description),
        "an index of one chunk many times": _same_chunk(description),
        "large metadata": head(description) + packed(Metadata("run", {"x": "x" * 60_000_000})),
        "metadata of many keys": head(description) + packed(Metadata("run", {f"{n:06}": "" for n in range(900_000)})),
        "many metadata records": head(description) + packed(Metadata("run", {"complete": "true"})) * 200_000,
        "a large attachment": MAGIC + packed(Attachment(0, 0, "scene.yaml", "", bytes(60_000_000))),
        "nodes": _of_strand(description, nodes=[0, 2**31], edges=[0, 2**31 - 1]),
        "node count": _numbers(description, "node_count", 2**40),
        "many values": _of_strand(description, width=[0] * 2_900_000),
        "many lists": _of_strand(description, layers=[[]] * 90_000),
        "many names": _numbers(description, "channels", ["a"] * 2_900_000),
        "deep JSON": finished(head(description, strands="[" * 1_000_000)),
        "deep JSON that ends": finished(head(description, strands="[" * 90_000 + "]" * 90_000)),
        "state of many values": _numbers(description, "state_layout", [["position", [2**20, 2**20]]]),
        "labels of a state": finished(
            head(description)
            + definitions()
            + packed(Message(STATE, 0, HEADER + struct.pack("<I", 2**32 - 1) + bytes(1000), 0, 0))
        ),
        "nodes that no message has": _of_strand(
            description, width=[1.0] * (nodes.stop - nodes.start), nodes=[0, 10**9]
        ),
    }


def write_repeated(path: Path, description: Description, frames: int, nodes: int) -> None:
    """Write a log of one rod of many nodes whose frames are all the same."""
    (strand, *_), every = description.strands, np.full(nodes, 0.01)
    rod = {"nodes": slice(0, nodes), "edges": slice(0, nodes - 1), "width": every, "thickness": every}
    strand = replace(strand, offset=0.0 * every, curvature=0.0 * every, **rod)
    description = replace(description, strands=(strand,), node_count=nodes, edge_count=nodes - 1)
    specs = [spec for spec in output_topics(description) if spec.name not in ("/clock", "state", "markers")]
    bodies = {
        "nodes": pose_array_template(nodes),
        "points": point_cloud_template(nodes),
        "com": stamped_template(3),
        "body_pose": stamped_template(7),
        "stimulus_applied": multi_array_template(description.channels),
        "energy": multi_array_template(("kinetic", "bend")),
        "solver": multi_array_template(SOLVER_LABELS),
    }
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=50_000_000, compression=CompressionType.ZSTD)
        writer.start("ros2", "tests")
        writer.add_attachment(0, 0, "scene.yaml", "", description.scene_text.encode())
        for name, values in (("versions", {}), ("settings", {}), ("description", to_text(description))):
            writer.add_metadata(name, values)
        writer.register_schema("x/msg/X", "ros2msg", b"")
        channels = {spec.name: writer.register_channel(spec.full_name(), "cdr", 1) for spec in specs}
        for time in range(frames):
            for name, channel in channels.items():
                body = bodies.get(name.partition("/")[0]) or stamped_template(6)
                writer.add_message(channel, time, body.to_bytes(), time)
        writer.finish()


def _member(shape: tuple[int, ...], kind: str, data: bytes) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": kind, "fortran_order": False, "shape": shape})
    return stream.getvalue() + data


def write_states(folder: Path, layout: str) -> list[Path]:
    """Write saved states that unpack to `UNPACKED`, or declare far more."""
    text = np.array(layout)
    one = _member((), text.dtype.str, text.tobytes())
    members = {
        "state of zeros": {"state": _member((UNPACKED // 8,), "<f8", bytes(UNPACKED)), "layout": one},
        "layout of zeros": {"state": b"", "layout": _member((), f"<U{UNPACKED // 4}", bytes(UNPACKED))},
        "shape without values": {"state": _member((2**40,), "<f8", b""), "layout": one},
        "header of a gigabyte": {"state": b"\x93NUMPY\x02\0" + struct.pack("<I", 2**31) + b"{", "layout": one},
    }
    paths = []
    for name, parts in members.items():
        paths.append(folder / f"{name}.npz")
        with zipfile.ZipFile(paths[-1], "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
            for part, data in parts.items():
                file.writestr(f"{part}.npy", data)
    return paths
