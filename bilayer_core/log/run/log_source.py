"""Quantities of a log, read one by one or in blocks of rows: as much of it is in memory as was asked for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.file.log_head import Head
from bilayer_core.log.messages import encoders
from bilayer_core.log.messages.cdr import NANOSECONDS, Template, decoded, read_float64_multi_array
from bilayer_core.log.messages.event_messages import decode_event
from bilayer_core.log.messages.events import Event
from bilayer_core.log.messages.node_frames import node_order
from bilayer_core.log.messages.topics import CONTACT_PAIRS, EVENTS, JOINTS, SECTION_POINTS, Rate, output_topics
from bilayer_core.log.run.bag import split_address
from bilayer_core.log.run.opened_run import MessageSource, open_run
from bilayer_core.log.run.quantities import Entry, Quantity, entries
from bilayer_core.names import is_name
from bilayer_core.observed.frame import Description
from bilayer_core.printable import shortened

Array = np.ndarray
BLOCK = 8 << 20
"""About as much is read at once [bytes]."""
LEAST_MEMORY, MOST_EXPANSION = 1e9, 20
"""A log's arrays may take so much memory [bytes], or so many times the size of the file if that is more."""
PER_EVENT = 500
"""Memory that an event takes beside its text [bytes]."""
PADDING = 4
"""Some middlewares fill messages up to a multiple of this [bytes]."""
TIME, SHAPE_TIME = "time", "shape_time"
"""The two times of a run: of frames, and of shapes of rods."""
_WIDTHS = {"body_positions": 3, "body_quaternions": 4, "contact_wrenches": 6, "clamp_wrenches": 6}


@dataclass
class _Topic:
    """A topic in the log: the array in its messages, and which of them are rows."""

    name: str
    size: int  # of a message [bytes]
    offset: int  # of the array in it [bytes]
    dtype: np.dtype
    shape: tuple[int, ...]
    stamps: Array  # of all messages [ns]
    kept: Array | None = None  # None: all

    @property
    def row_size(self) -> int:
        return self.dtype.itemsize * int(np.prod(self.shape))

    def stack(self, messages: list[bytes]) -> Array:
        """Return the arrays of messages, shape (messages, ...)."""
        whole = np.frombuffer(b"".join(messages), np.uint8).reshape(len(messages), self.size)
        part = np.ascontiguousarray(whole[:, self.offset : self.offset + self.row_size])
        found = part.view(self.dtype).reshape(len(messages), *self.shape)
        return found.astype(np.float32) if self.name == "nodes" else found


@dataclass
class _Queue:
    """Messages of a topic that wait for those of the others."""

    topic: _Topic
    wanted: list[Entry] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    seen: int = 0


class LogSource:
    """The quantities of a log.

    `path`: of a log or a bag, see `open_run`. `head`, `file`: if they are read already. Raises InputError if the file
    is no log, or is damaged; that a chunk is damaged is told when it is read.
    """

    def __init__(self, path: str | Path, head: Head | None = None, file: MessageSource | None = None):
        self.path = Path(path)
        if head is None or file is None:
            head, file = open_run(path)
        self.description: Description = head.description
        self._file = file
        unread = ("/clock", "state", "markers")
        groups: dict[str, list[str]] = {TIME: [], SHAPE_TIME: []}
        for spec in output_topics(self.description):
            if spec.name not in unread:
                groups[SHAPE_TIME if spec.rate is Rate.DISPLAY else TIME].append(spec.name)
        counts = {name: self._file.count(self._full(name)) for names in groups.values() for name in names}
        begun = any(counts.values())  # what comes later does not lack in a log of no frame yet
        self._held = {group: [name for name in names if counts[name] or not begun] for group, names in groups.items()}
        self.lacks = tuple(
            self._full(name)
            for group, names in groups.items()
            for name in names
            if name not in self._held[group] and (self._held[group] or self._full(name) not in self._file.topics)
        )  # Topics with quantities that the log does not hold
        terms, figures = (self._first(name)[0] if counts[name] else () for name in ("energy", "solver"))
        lacking = set(self.lacks)
        self.entries = {
            entry.name: entry
            for entry in entries(self.description, terms, figures)
            if self._full(entry.topic) not in lacking
        }  # Name -> `Entry` of each quantity
        self._most_memory = max(LEAST_MEMORY, MOST_EXPANSION * size_of(split_address(path)[0]))
        self._memory = 0

    @property
    def times(self) -> dict[str, Array]:
        """``time`` and ``shape_time`` -> when the log has all topics of that rate [s]."""
        return self._aligned[0]

    @property
    def _topics(self) -> dict[str, _Topic]:
        return self._aligned[1]

    @cached_property
    def _aligned(self) -> tuple[dict[str, Array], dict[str, _Topic]]:
        """Times of rows, and the topics with those of their messages that are rows."""
        times, topics = {}, {}
        for group, names in self._held.items():
            of_group = {name: self._layout(name, self._file.times(self._full(name))) for name in names}
            times[group] = _align(list(of_group.values()))
            topics |= of_group
        return times, topics

    def why_not(self, name: str) -> str | None:
        """Return why a quantity that other logs have is not in this one; None if no log has it."""
        held = self.description
        for entry in entries(held, (), ()):
            if entry.name == name and name not in self.entries:
                return f"{self.path} does not hold it: it has no {self._full(entry.topic)}"
        return None

    def read(self, entry: Entry) -> Quantity:
        """Return a quantity from all messages of the log that hold it."""
        values = self._values([entry])[entry.name]
        return entry.filled(self.times[_group(entry)], values)

    def attributes_with(self, name: str) -> dict[str, object]:
        """Return an attribute of `RunData`, and all others that come at the same rate."""
        if name == EVENTS.name:
            return {name: tuple(self._events())}
        if name in _OF_SHAPES:
            return self._shapes()
        description, count = self.description, len(self.times[TIME])
        rows = {"stimulus": len(description.channels), "com": 3, "pair_forces": len(description.contact_pairs)}
        rows["joint_figures"] = len(description.joint_labels)
        self._take_memory(8 * count * (len(description.bodies) * sum(_WIDTHS.values()) + sum(rows.values())))
        # Of a run that goes on, shapes may have come alone.
        wanted = [entry for entry in self.entries.values() if not entry.of_shape and entry.topic in self._topics]
        values = self._values(wanted)
        of = {
            attribute: np.full((count, len(description.bodies), width), np.nan) for attribute, width in _WIDTHS.items()
        }
        of["clamp_wrenches"][:, [k for k, body in enumerate(description.bodies) if not body.holds_rods]] = 0.0
        of |= {name: np.full((count, width), np.nan) for name, width in rows.items()}
        of |= {"energy": {}, "solver": {}}
        for entry in wanted:
            if isinstance(of[entry.attribute], dict):
                of[entry.attribute][entry.index] = values[entry.name]
            else:
                of[entry.attribute][(slice(None), *entry.index)] = values[entry.name]
        return of

    def _events(self) -> Iterator[Event]:
        topic = self._full(EVENTS.name)
        for _, time, data in self._file.messages({topic}):
            self._take_memory(len(data) + PER_EVENT)
            yield decoded(self.path, topic, time, data, decode_event)

    def blocks(self, wanted: Iterable[Entry], most: int = BLOCK) -> Iterator[tuple[slice, dict[str, Array]]]:
        """Yield values of quantities that come at one rate, in blocks of rows: where they are in the times, and by
        name.

        `most`: about as much is read at once [bytes].
        """
        queues: dict[str, _Queue] = {}
        for entry in wanted:
            queues.setdefault(self._full(entry.topic), _Queue(self._topics[entry.topic])).wanted.append(entry)
        if not queues:
            return
        made = sum(_size_of_derived(queue) for queue in queues.values())
        rows = max(1, most // (made + sum(queue.topic.size for queue in queues.values())))
        done = waiting = 0
        for name, stamp, data in self._file.messages(set(queues)):
            queue = queues[name]
            topic, number = queue.topic, queue.seen
            queue.seen += 1
            if number >= len(topic.stamps) or topic.stamps[number] != stamp:
                raise InputError(f"{self.path}: is damaged: its index says another time for {name} than the message")
            if not topic.size <= len(data) < topic.size + PADDING:
                raise InputError(f"{self.path}: {name}: a message has {len(data)} bytes, expected are {topic.size}")
            if topic.kept is not None and not topic.kept[number]:
                continue
            queue.messages.append(data[: topic.size])
            waiting += topic.size
            if waiting > self._most_memory:
                raise InputError(f"{self.path}: has its topics one after the other, not by time; this is not read")
            if len(queue.messages) >= rows and all(len(of.messages) >= rows for of in queues.values()):
                yield slice(done, done + rows), _taken(queues.values(), rows)
                done += rows
                waiting = sum(len(of.messages) * of.topic.size for of in queues.values())
        left = min(len(queue.messages) for queue in queues.values())
        if left:
            yield slice(done, done + left), _taken(queues.values(), left)

    def _full(self, name: str) -> str:
        return f"{self._file.namespace}/{name}"

    def _values(self, wanted: list[Entry]) -> dict[str, Array]:
        """Return the values of quantities that come at one rate, by name."""
        found: dict[str, Array] = {}
        if not wanted:
            return found
        count = len(self.times[_group(wanted[0])])
        for rows, block in self.blocks(wanted):
            for name, values in block.items():
                if name not in found:
                    self._take_memory(count * values[:1].nbytes)
                    found[name] = np.empty((count, *values.shape[1:]), values.dtype)
                found[name][rows] = values
        for entry in wanted:
            if entry.name not in found:  # not a single row
                topic = self._topics.get(entry.topic)
                found[entry.name] = entry.taken(np.empty((0, *topic.shape)), entry.columns) if topic else np.empty(0)
        return found

    def _shapes(self) -> dict[str, object]:
        """Return the shapes of rods, of all nodes."""
        count, nodes = len(self.times[SHAPE_TIME]), self.description.node_count
        self._take_memory(4 * count * nodes * (len(encoders.POINT_FIELDS) + 7))
        whole = {
            "points": np.full((count, nodes, len(encoders.POINT_FIELDS)), np.nan, np.float32),
            "nodes": np.full((count, len(node_order(self.description)), 7), np.nan, np.float32),
        }
        if SECTION_POINTS.name in self._topics:
            self._take_memory(4 * count * nodes * len(encoders.SECTION_FIELDS))
            whole[SECTION_POINTS.name] = np.full((count, nodes, len(encoders.SECTION_FIELDS)), np.nan, np.float32)
        held = [Entry(topic, "", "", (), topic, (), ("node",)) for topic in whole if topic in self._topics]
        for rows, block in self.blocks(held):
            for name, values in block.items():
                whole[name][rows] = values
        points, flat = whole["points"], np.broadcast_to(np.zeros(4, np.float32), (count, nodes, 4))
        return {
            "positions": points[..., :3],
            "contact_forces": points[..., 5:],
            "strain": points[..., 3],
            "curvature": points[..., 4],
            "section_curvature": whole.get(SECTION_POINTS.name, flat)[..., 3],
            "material_frames": whole["nodes"][..., 3:],
        }

    def _layout(self, name: str, stamps: Array) -> _Topic:
        """Return where the array is in the messages of a topic."""
        if name in ("stimulus_applied", "energy", "solver"):
            channels = (len(self.description.channels),)
            if not len(stamps):
                return _Topic(name, 1, 0, np.dtype(float), channels, stamps)
            _, values, size = self._first(name)
            if name == "stimulus_applied" and values.shape != channels:
                raise InputError(
                    f"{self.path}: {self._full(name)}: has {values.size} values for {channels[0]} channels"
                )
            return _Topic(name, size, size - values.nbytes, values.dtype, values.shape, stamps)
        template, part = self._template(name)
        offset, dtype, shape = template.fields[part]
        return _Topic(name, len(template), offset, dtype, shape, stamps)

    def _first(self, name: str) -> tuple[tuple[str, ...], Array, int]:
        """Return the labels and values of a topic's first message, and its size [bytes]."""
        topic = self._full(name)
        for _, time, data in self._file.messages({topic}):
            labels, values = decoded(self.path, topic, time, data, read_float64_multi_array)
            wrong = [label for label in labels if not is_name(label.replace(" ", "_"))]
            if wrong or len(set(labels)) != len(labels) or len(labels) != values.size:
                found = f"{len(labels)} names ({shortened(', '.join(labels))}) for {values.size} values"
                raise InputError(f"{self.path}: {topic}: found {found}; each value must have a name of its own")
            return tuple(labels), values, len(data)
        raise InputError(f"{self.path}: is damaged: its index has messages of {topic}, and its chunks have none")

    def _take_memory(self, size: int) -> None:
        """Count what arrays take [bytes]; InputError if that is more than logs of this size hold."""
        self._memory += size
        if self._memory > self._most_memory:
            raise InputError(
                f"{self.path}: unpacks to more than {self._most_memory / 1e9:.3g} GB in memory; at most "
                f"{LEAST_MEMORY / 1e9:g} GB are read, or {MOST_EXPANSION} times the size of the file"
            )

    def _template(self, name: str) -> tuple[Template, str]:
        """Return the message of a topic whose layout the description fixes, and the name of its array."""
        kind = name.partition("/")[0]
        if kind == "nodes":
            return encoders.pose_array_template(len(node_order(self.description))), "poses"
        if kind == "points":
            return encoders.point_cloud_template(self.description.node_count), "points"
        if kind == CONTACT_PAIRS.name:
            return encoders.contact_pairs_template(self.description), "data"
        if kind == JOINTS.name:
            return encoders.multi_array_template(self.description.joint_labels), "data"
        if kind == SECTION_POINTS.name:
            return encoders.point_cloud_template(self.description.node_count, encoders.SECTION_FIELDS), "points"
        return encoders.stamped_template({"com": 3, "body_pose": 7}.get(kind, 6)), "data"


_OF_SHAPES = ("positions", "contact_forces", "material_frames", "strain", "curvature", "section_curvature")


def size_of(path: Path) -> float:
    """Return the size of a file, or of all files of a directory [bytes]; infinite for what is neither."""
    if not path.exists():
        return math.inf
    files = [path] if path.is_file() else path.rglob("*")
    return sum(file.stat().st_size for file in files if file.is_file())


def _align(topics: list[_Topic]) -> Array:
    """Note which messages of topics that come at one rate are rows: those of times that all have. Returns these [s]."""
    if not topics:
        return np.empty(0)
    first, *others = (topic.stamps for topic in topics)
    common = first
    if not all(np.array_equal(first, of) for of in others):
        for of in others:
            common = np.intersect1d(common, of)
    for topic in topics:
        if common is not first or len(others) and not np.array_equal(topic.stamps, common):
            topic.kept = np.zeros(len(topic.stamps), bool)
            topic.kept[np.unique(topic.stamps, return_index=True)[1]] = True
            topic.kept &= np.isin(topic.stamps, common)
    return np.asarray(common, float) / NANOSECONDS


def _group(entry: Entry) -> str:
    return SHAPE_TIME if entry.of_shape else TIME


def _size_of_derived(queue: _Queue) -> int:
    """Return what derived quantities of one message take beside it [bytes]."""
    message = np.ones((1, *queue.topic.shape), queue.topic.dtype)
    return sum(entry.taken(message, entry.columns).nbytes for entry in queue.wanted if entry.derive is not None)


def _taken(queues: Iterable[_Queue], rows: int) -> dict[str, Array]:
    """Remove and return the next rows of all quantities that are wanted."""
    found = {}
    for queue in queues:
        whole = queue.topic.stack(queue.messages[:rows])
        del queue.messages[:rows]
        for entry in queue.wanted:
            found[entry.name] = entry.taken(whole, entry.columns)
    return found
