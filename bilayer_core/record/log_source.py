"""Quantities of a log, read one by one or in blocks of rows: as much of it is in memory as was asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.observed.frame import Description
from bilayer_core.record import encoders
from bilayer_core.record.cdr import NANOSECONDS, Template, read_float64_multi_array
from bilayer_core.record.event_messages import decode_event
from bilayer_core.record.log_head import Head
from bilayer_core.record.node_frames import node_order
from bilayer_core.record.opened_run import MessageSource, open_run
from bilayer_core.record.quantities import Entry, Quantity, entries
from bilayer_core.record.topics import EVENTS, Rate, output_topics

Array = np.ndarray
BLOCK = 8 << 20
"""About as much is read at once [bytes]."""
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
    labels: tuple[str, ...] = ()
    kept: Array | None = None  # None: all

    @property
    def row_size(self) -> int:
        return self.dtype.itemsize * int(np.prod(self.shape))

    def stack(self, messages: list[bytes]) -> Array:
        """Arrays of messages, shape (messages, ...)."""
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

    Parameters
    ----------
    path : str or Path
        Of a log or a bag, see `open_run`.
    head : Head, optional
    file : MessageSource, optional
        If they are read already.

    Attributes
    ----------
    description : Description
    times : dict
        ``time`` and ``shape_time`` -> when the log has all topics of that rate [s].
    entries : dict
        Name -> `Entry` of each quantity.
    lacks : tuple of str
        Topics with quantities that the log does not hold.

    Raises
    ------
    InputError
        If the file is no log, or is damaged; that a chunk is damaged is told when it is read.
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
        self._topics: dict[str, _Topic] = {}
        self.times: dict[str, Array] = {}
        lacks: list[str] = []
        stamps = {name: self._file.times(self._full(name)) for names in groups.values() for name in names}
        begun = any(len(of) for of in stamps.values())  # what comes later does not lack in a log of no frame yet
        for group, names in groups.items():
            held = {name: stamps[name] for name in names if len(stamps[name]) or not begun}
            missing = [name for name in names if name not in held]
            lacks += [self._full(name) for name in missing if held or self._full(name) not in self._file.topics]
            self.times[group] = self._align(held)
        self.lacks = tuple(lacks)
        terms, figures = (self._topics[name].labels if name in self._topics else () for name in ("energy", "solver"))
        lacking = set(lacks)
        self.entries = {
            entry.name: entry
            for entry in entries(self.description, terms, figures)
            if self._full(entry.topic) not in lacking
        }

    def why_not(self, name: str) -> str | None:
        """Why a quantity that other logs have is not in this one; None if no log has it."""
        held = self.description
        for entry in entries(held, (), ()):
            if entry.name == name and name not in self.entries:
                return f"{self.path} does not hold it: it has no {self._full(entry.topic)}"
        return None

    def read(self, entry: Entry) -> Quantity:
        """A quantity, from all of the log's messages that hold it."""
        values = self._values([entry])[entry.name]
        return entry.filled(self.times[_group(entry)], values)

    def attributes_with(self, name: str) -> dict[str, object]:
        """That attribute of `RunData`, and all others that come at the same rate."""
        if name == EVENTS.name:
            return {name: tuple(decode_event(data) for _, _, data in self._file.messages({self._full(EVENTS.name)}))}
        if name in _OF_SHAPES:
            return self._shapes()
        # Of a run that goes on, shapes may have come alone.
        wanted = [entry for entry in self.entries.values() if not entry.of_shape and entry.topic in self._topics]
        values = self._values(wanted)
        description, count = self.description, len(self.times[TIME])
        of = {
            attribute: np.full((count, len(description.bodies), width), np.nan) for attribute, width in _WIDTHS.items()
        }
        of["clamp_wrenches"][:, [k for k, body in enumerate(description.bodies) if not body.holds_rods]] = 0.0
        of |= {"stimulus": np.full((count, len(description.channels)), np.nan), "com": np.full((count, 3), np.nan)}
        of |= {"energy": {}, "solver": {}}
        for entry in wanted:
            if isinstance(of[entry.attribute], dict):
                of[entry.attribute][entry.index] = values[entry.name]
            else:
                of[entry.attribute][(slice(None), *entry.index)] = values[entry.name]
        return of

    def blocks(self, wanted: Iterable[Entry], most: int = BLOCK) -> Iterator[tuple[slice, dict[str, Array]]]:
        """Values of quantities that come at one rate, in blocks of rows: where they are in the times, and by name.

        Parameters
        ----------
        wanted : iterable of Entry
        most : int
            About as much is read at once [bytes].
        """
        queues: dict[str, _Queue] = {}
        for entry in wanted:
            queues.setdefault(self._full(entry.topic), _Queue(self._topics[entry.topic])).wanted.append(entry)
        if not queues:
            return
        rows = max(1, most // sum(queue.topic.size for queue in queues.values()))
        done = 0
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
            if len(queue.messages) >= rows and all(len(of.messages) >= rows for of in queues.values()):
                yield slice(done, done + rows), _taken(queues.values(), rows)
                done += rows
        left = min(len(queue.messages) for queue in queues.values())
        if left:
            yield slice(done, done + left), _taken(queues.values(), left)

    def _full(self, name: str) -> str:
        return f"{self._file.namespace}/{name}"

    def _values(self, wanted: list[Entry]) -> dict[str, Array]:
        """Values of quantities that come at one rate, by name."""
        found: dict[str, Array] = {}
        if not wanted:
            return found
        count = len(self.times[_group(wanted[0])])
        for rows, block in self.blocks(wanted):
            for name, values in block.items():
                if name not in found:
                    found[name] = np.empty((count, *values.shape[1:]), values.dtype)
                found[name][rows] = values
        for entry in wanted:
            if entry.name not in found:  # not a single row
                topic = self._topics.get(entry.topic)
                shape = np.empty(topic.shape)[entry.columns].shape if topic else ()
                found[entry.name] = np.empty((0, *shape))
        return found

    def _shapes(self) -> dict[str, object]:
        """Shapes of rods, of all nodes."""
        count, nodes = len(self.times[SHAPE_TIME]), self.description.node_count
        whole = {
            "points": np.full((count, nodes, len(encoders.POINT_FIELDS)), np.nan, np.float32),
            "nodes": np.full((count, len(node_order(self.description)), 7), np.nan, np.float32),
        }
        held = [Entry(topic, "", "", (), topic, (), ("node",)) for topic in whole if topic in self._topics]
        for rows, block in self.blocks(held):
            for name, values in block.items():
                whole[name][rows] = values
        points = whole["points"]
        return {
            "positions": points[..., :3],
            "contact_forces": points[..., 5:],
            "strain": points[..., 3],
            "curvature": points[..., 4],
            "material_frames": whole["nodes"][..., 3:],
        }

    def _align(self, stamps: dict[str, Array]) -> Array:
        """Which messages of topics that come at one rate are rows: those of times that all have. Returns these [s]."""
        if not stamps:
            return np.empty(0)
        first, *others = stamps.values()
        common = first
        if not all(np.array_equal(first, of) for of in others):
            for of in others:
                common = np.intersect1d(common, of)
        for name, of in stamps.items():
            topic = self._layout(name, of)
            if common is not first or len(others) and not np.array_equal(of, common):
                topic.kept = np.zeros(len(of), bool)
                topic.kept[np.unique(of, return_index=True)[1]] = True
                topic.kept &= np.isin(of, common)
            self._topics[name] = topic
        return np.asarray(common, float) / NANOSECONDS

    def _layout(self, name: str, stamps: Array) -> _Topic:
        """Where the array is in the messages of a topic."""
        labelled = name in ("stimulus_applied", "energy", "solver")
        if labelled and not len(stamps):
            return _Topic(name, 1, 0, np.dtype(float), (len(self.description.channels),), stamps)
        if labelled:
            _, _, data = next(self._file.messages({self._full(name)}))
            labels, values = read_float64_multi_array(data)
            offset = len(data) - values.nbytes
            return _Topic(name, len(data), offset, values.dtype, values.shape, stamps, tuple(labels))
        template, part = self._template(name)
        offset, dtype, shape = template.fields[part]
        return _Topic(name, len(template), offset, dtype, shape, stamps)

    def _template(self, name: str) -> tuple[Template, str]:
        """The message of a topic whose layout the description fixes, and the name of its array."""
        kind = name.partition("/")[0]
        if kind == "nodes":
            return encoders.pose_array_template(len(node_order(self.description))), "poses"
        if kind == "points":
            return encoders.point_cloud_template(self.description.node_count), "points"
        return encoders.stamped_template({"com": 3, "body_pose": 7}.get(kind, 6)), "data"


_OF_SHAPES = ("positions", "contact_forces", "material_frames", "strain", "curvature")


def _group(entry: Entry) -> str:
    return SHAPE_TIME if entry.of_shape else TIME


def _taken(queues: Iterable[_Queue], rows: int) -> dict[str, Array]:
    """The next rows of all quantities that are wanted."""
    found = {}
    for queue in queues:
        whole = queue.topic.stack(queue.messages[:rows])
        del queue.messages[:rows]
        for entry in queue.wanted:
            found[entry.name] = whole[(slice(None), *entry.columns)]
    return found
