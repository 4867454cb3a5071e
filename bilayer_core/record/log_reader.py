"""Reading logs, whole or cut off by a crash, with numpy alone.

A cut-off log is read up to its last whole record; the chunk that was being written when the process died is lost.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from bilayer_core import DISTRIBUTION
from bilayer_core.errors import InputError
from bilayer_core.record import encoders
from bilayer_core.record.cdr import NANOSECONDS, Template, decode, nanoseconds, read_float64_multi_array
from bilayer_core.record.description_text import from_text
from bilayer_core.record.log_file import MAGIC_SIZE, is_finished, open_log
from bilayer_core.record.node_frames import node_order
from bilayer_core.record.run_data import RunData
from bilayer_core.record.topics import LOG_NAMESPACE, MULTI_ARRAY, output_topics
from bilayer_core.simulation.frame import Description

CUT_OFF = "cut off"
_RECORD_HEAD = 9  # opcode and length of a record [bytes]
_HEAD = ("description", "versions", "settings")
"""Metadata that every log has before its first chunk."""


@dataclass(frozen=True)
class LogInfo:
    """What a log holds: the content of `bilayer info` (`dataclasses.asdict` gives its JSON).

    Attributes
    ----------
    path, scene, title : str
    versions, settings : dict
    start_time, last_time, duration : float
        Simulated time of the first and last message, and between them [s].
    channels : tuple of str
        Stimulus channels.
    topics : dict
        Topic -> {"type": ROS type, "count": messages}.
    complete : bool
        Whether the run reached its end and the file was finished.
    termination : str
        Why it ended; ``"cut off"`` for a file without an end.
    size : int
        Of the file [bytes].
    """

    path: str
    scene: str
    title: str
    versions: dict[str, str]
    settings: dict[str, str]
    start_time: float
    last_time: float
    duration: float
    channels: tuple[str, ...]
    topics: dict[str, dict]
    complete: bool
    termination: str
    size: int


def read_info(path: str | Path) -> LogInfo:
    """What a log holds, from its index or, when it was cut off, by reading it through. InputError if it is no log."""
    path = Path(path)
    head = read_head(path)
    counts: dict[str, int]
    with open_log(path) as file:
        summary = _read_summary(file)
    if summary is not None:
        statistics = summary.statistics
        counts = {
            channel.topic: statistics.channel_message_counts.get(channel.id, 0) for channel in summary.channels.values()
        }
        times = [statistics.message_start_time, statistics.message_end_time] if statistics.message_count else []
        types = {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
        ending = _read_ending(path, summary)
    else:
        counts, times, types, ending = defaultdict(int), [], {}, {}
        for topic, ros_type, time, data in read_messages(path):
            types[topic] = ros_type
            if data is not None:
                counts[topic] += 1
                times = [min(time, times[0]), max(time, times[1])] if times else [time, time]
    start, last = (time / NANOSECONDS for time in times) if times else (0.0, 0.0)
    return LogInfo(
        path=str(path),
        scene=head.description.scene_name,
        title=head.description.title,
        versions=head.versions,
        settings=head.settings,
        start_time=start,
        last_time=last,
        duration=last - start,
        channels=head.description.channels,
        topics={topic: {"type": types[topic], "count": counts[topic]} for topic in sorted(types)},
        complete=ending.get("complete") == "true",
        termination=ending.get("termination", CUT_OFF),
        size=path.stat().st_size,
    )


def read_description(path: str | Path) -> Description:
    """The description that the log was written with."""
    return read_head(Path(path)).description


def scene_from_log(path: str | Path) -> str:
    """YAML text of the scene that was run, overrides included."""
    return read_description(path).scene_text


def read_state(path: str | Path, time: float | None = None) -> tuple[np.ndarray, float]:
    """Flat state and its time [s]: the last one logged, or the last one at or before `time`."""
    path = Path(path)
    limit = None if time is None else nanoseconds(time)
    found = None
    for _, _, stamp, data in read_messages(path, {f"{LOG_NAMESPACE}/state"}):
        if data is not None and limit is not None and stamp > limit:
            break
        if data is not None:
            found = (data, stamp)
    if found is None:
        before = "" if time is None else f" at or before t = {time:g} s"
        raise InputError(f"{path}: holds no state{before}")
    data, stamp = found
    return read_float64_multi_array(data)[1].copy(), stamp / NANOSECONDS


def read_log(path: str | Path) -> RunData:
    """All quantities over time as arrays."""
    path = Path(path)
    description = read_description(path)
    prefix = f"{LOG_NAMESPACE}/"
    unread = {"/clock", f"{prefix}state", f"{prefix}markers"}
    wanted = {spec.full_name() for spec in output_topics(description)} - unread
    columns: dict[str, list[np.ndarray]] = defaultdict(list)
    times: dict[str, list[int]] = defaultdict(list)
    labels: dict[str, list[str]] = {}
    fields = _fixed_fields(description)
    for topic, ros_type, time, data in read_messages(path, wanted):
        if data is None:
            continue
        name = topic.removeprefix(prefix)
        if ros_type == MULTI_ARRAY:
            parts, values = read_float64_multi_array(data)
            labels[name] = [label for label, _ in parts]
        else:
            size, field = fields[name]
            if len(data) != size:
                raise InputError(f"{path}: {topic}: a message has {len(data)} bytes, expected are {size}")
            values = decode(data, field)
            if name == "nodes":
                values = values[:, 3:].astype(np.float32)
        columns[name].append(values)
        times[name].append(time)
    return _assemble(description, columns, times, labels)


def _assemble(description: Description, columns, times, labels) -> RunData:
    """Arrays over time from lists of messages; a topic that a cut-off log holds once less is not missed."""
    bodies = [body.name for body in description.bodies]
    scalar_topics = ["stimulus_applied", "energy", "solver", "com"]
    scalar_topics += [f"{kind}/{body}" for body in bodies for kind in ("body_pose", "contact_wrench")]
    holding = [body.name for body in description.bodies if body.holds_rods]
    scalar_topics += [f"clamp_wrench/{body}" for body in holding]
    frames = min((len(columns[name]) for name in scalar_topics), default=0)
    shapes = min(len(columns["nodes"]), len(columns["points"]))

    def stack(name: str, count: int, shape: tuple[int, ...]) -> np.ndarray:
        return np.array(columns[name][:count]).reshape(count, *shape)

    def labelled(name: str) -> dict[str, np.ndarray]:
        names = labels.get(name, [])
        return dict(zip(names, stack(name, frames, (len(names),)).T, strict=True))

    def of_bodies(kind: str, width: int) -> np.ndarray:
        parts = [stack(f"{kind}/{body}", frames, (width,)) for body in bodies]
        return np.stack(parts, axis=1) if parts else np.empty((frames, 0, width))

    poses = of_bodies("body_pose", 7)
    columns |= {f"clamp_wrench/{body}": [np.zeros(6)] * frames for body in bodies if body not in holding}
    points = stack("points", shapes, (description.node_count, len(encoders.POINT_FIELDS)))
    return RunData(
        description=description,
        times=np.array(times["com"][:frames], float) / NANOSECONDS,
        stimulus=stack("stimulus_applied", frames, (len(description.channels),)),
        energy=labelled("energy"),
        com=stack("com", frames, (3,)),
        body_positions=poses[..., :3],
        body_quaternions=poses[..., 3:],
        contact_wrenches=of_bodies("contact_wrench", 6),
        clamp_wrenches=of_bodies("clamp_wrench", 6),
        solver=labelled("solver"),
        shape_times=np.array(times["points"][:shapes], float) / NANOSECONDS,
        positions=points[..., :3],
        contact_forces=points[..., 5:],
        material_frames=stack("nodes", shapes, (len(node_order(description)), 4)),
        strain=points[..., 3],
        curvature=points[..., 4],
    )


def _fixed_fields(description: Description) -> dict[str, tuple[int, tuple]]:
    """Size of a message [bytes] and the place of its array, of each topic whose layout the description fixes."""

    def place(template: Template, name: str = "data") -> tuple[int, tuple]:
        return len(template), template.fields[name]

    fields = {
        "com": place(encoders.stamped_template(3)),
        "nodes": place(encoders.pose_array_template(len(node_order(description))), "poses"),
        "points": place(encoders.point_cloud_template(description.node_count), "points"),
    }
    for body in description.bodies:
        fields[f"body_pose/{body.name}"] = place(encoders.stamped_template(7))
        fields[f"contact_wrench/{body.name}"] = place(encoders.stamped_template(6))
        fields[f"clamp_wrench/{body.name}"] = fields[f"contact_wrench/{body.name}"]
    return fields


@dataclass(frozen=True)
class Head:
    """What a log holds before its first message."""

    description: Description
    versions: dict[str, str]
    settings: dict[str, str]
    machine: dict[str, str]  # empty in older logs


class _WholeRecords:
    """The part of a file that ends with its last whole record."""

    def __init__(self, file: BinaryIO):
        size = file.seek(0, 2)
        end = MAGIC_SIZE
        while end + _RECORD_HEAD <= size:
            file.seek(end + 1)
            length = int.from_bytes(file.read(8), "little")
            if end + _RECORD_HEAD + length > size:
                break
            end += _RECORD_HEAD + length
        # The magic bytes after the last record of a finished file.
        self._left = end + MAGIC_SIZE if end + MAGIC_SIZE == size else end
        self._file = file
        file.seek(0)

    def read(self, size: int) -> bytes:
        """At most `size` bytes, none at the end."""
        data = self._file.read(min(size, self._left))
        self._left -= len(data)
        return data


def _records(file: BinaryIO) -> Iterator:
    """All whole records of a log in the order of the file."""
    from mcap.exceptions import EndOfFile
    from mcap.stream_reader import StreamReader

    try:
        yield from StreamReader(_WholeRecords(file), validate_crcs=True).records
    except EndOfFile:
        return


def read_messages(path: Path, topics: set[str] | None = None) -> Iterator[tuple[str, str, int, bytes | None]]:
    """Topic, ROS type, time [ns] and data of each message of `topics` (default all).

    Each topic is announced once with the data None, even if no message follows.
    """
    from mcap.records import Channel, Message, Schema

    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    with open_log(path) as file:
        for record in _records(file):
            if isinstance(record, Message):
                known = channels.get(record.channel_id)
                if known is not None:
                    yield *known, record.log_time, record.data
            elif isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel) and record.id not in channels:
                if topics is not None and record.topic not in topics:
                    continue
                if record.schema_id not in schemas:
                    raise InputError(f"{path}: is damaged: the type of {record.topic} is missing")
                channels[record.id] = (record.topic, schemas[record.schema_id])
                yield *channels[record.id], 0, None


def read_head(path: Path) -> Head:
    """Scene, description, versions and settings: all that comes before the first chunk."""
    from mcap.records import Attachment, Metadata

    metadata: dict[str, dict[str, str]] = {}
    scene = None
    with open_log(path) as file:
        for record in _records(file):
            if isinstance(record, Attachment):
                scene = record.data.decode()
            elif isinstance(record, Metadata):
                metadata[record.name] = record.metadata
            if scene is not None and "description" in metadata:
                break
    missing = [name for name in _HEAD if name not in metadata] + ([] if scene is not None else ["scene"])
    if missing:
        what = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        raise InputError(f"{path}: is an MCAP file, but no log of bilayer_sim_ros, or is damaged: {what}")
    versions = metadata["versions"]
    try:
        description = from_text(metadata["description"], scene)
    except (KeyError, TypeError, ValueError):
        writer = versions.get(DISTRIBUTION, "unknown")
        raise InputError(
            f"{path}: describes its run in another way than this version reads (it was written by {DISTRIBUTION} "
            f"{writer}); run its scene again"
        ) from None
    return Head(description, versions, metadata["settings"], metadata.get("machine", {}))


def _read_summary(file: BinaryIO):
    """The index of a finished file, or None."""
    from mcap.reader import SeekingReader

    return SeekingReader(file).get_summary() if is_finished(file) else None


def _read_ending(path: Path, summary) -> dict[str, str]:
    """The metadata ``run`` of a finished file."""
    from mcap.reader import SeekingReader

    if not any(index.name == "run" for index in summary.metadata_indexes):
        return {}
    with open_log(path) as file:
        return next(item.metadata for item in SeekingReader(file).iter_metadata() if item.name == "run")
