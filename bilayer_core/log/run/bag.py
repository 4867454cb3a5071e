"""A run of a node in a bag of ``ros2 bag record``, read as a log is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.file.bag_files import BagFiles
from bilayer_core.log.file.bag_index import NodeTracks, Track, index_bag, unknown_run
from bilayer_core.log.file.log_head import Head
from bilayer_core.log.messages import encoders
from bilayer_core.log.messages.cdr import HEADER, NANOSECONDS, decoded, read_float64_multi_array
from bilayer_core.log.messages.description_text import from_json
from bilayer_core.names import is_name
from bilayer_core.observed.frame import BodyInfo, Description, Strand
from bilayer_core.printable import shortened

_ADDRESS = re.compile(r"(?P<path>.+?):(?P<node>(?:/\w+)*)(?:@(?P<run>\d+))?")
MOST_LISTED = 8
"""Runs that an error names."""


@dataclass(frozen=True)
class BagRun:
    """A run that a bag holds."""

    node: str  # Full name of the node
    number: int  # Of the run, from 1: a reset of the node begins another one
    of: int  # How many of them there are
    start_time: float
    last_time: float
    """`start_time`, `last_time`: simulated [s]."""
    described: bool  # Whether the bag holds the node's description
    stamped: bool  # Whether it holds messages with stamps; otherwise times are those since the first message
    certain: bool  # Whether messages without stamps have the times of their frames for certain

    @property
    def address(self) -> str:
        """Suffix that, added to the name of the bag, names the run."""
        return f":{self.node}@{self.number}" if self.of > 1 else f":{self.node}"


def split_address(path: str | Path) -> tuple[Path, str, int]:
    """Return the path, the node and the number of the run of a name such as ``bag:/lab/robot1@2``.

    The node is empty and the number 0 where the name does not say.
    """
    match = None if Path(path).exists() else _ADDRESS.fullmatch(str(path))
    if match is None or not (match["node"] or match["run"]):
        return Path(path), "", 0
    return Path(match["path"]), match["node"], int(match["run"] or 0)


class Bag:
    """Runs of this package's nodes in a bag.

    `path`: of an MCAP file, or of the bag's directory. `node`: the full name of the only node that counts; empty: all.
    Raises InputError if it is no bag in MCAP, or is damaged.
    """

    def __init__(self, path: Path, node: str = ""):
        self.node, self.files = node, BagFiles(path)
        self._nodes, self._unreadable = index_bag(self.files, node)
        self.runs = [
            BagRun(
                node=name,
                number=k + 1,
                of=len(of.runs),
                start_time=begin / NANOSECONDS,
                last_time=end / NANOSECONDS,
                described=bool(of.descriptions),
                stamped=of.stamped,
                certain=of.certain,
            )
            for name, of in sorted(self._nodes.items())
            for k, (begin, end) in enumerate(of.runs)
        ]

    @property
    def problem(self) -> str:
        """Which topics of the nodes cannot be read, and why; empty if all can."""
        if not self._unreadable:
            return ""
        first, *others = self._unreadable
        return (
            f"{first}{f' and {len(others)} more' if others else ''}: the messages do not begin as ROS 2 encodes "
            "them; those that `ros2 bag record --compression-mode message` compressed are not read: record without it"
        )

    def opened(self, run: BagRun) -> tuple[Head, BaggedRun]:
        """Return what one of the runs is, and its messages."""
        bagged = BaggedRun(self.files, self._nodes[run.node], run)
        return Head(bagged.description, {}, bagged.description.settings, {}), bagged


class BaggedRun:
    """The messages of one run by simulated time: what `LogSource` asks of a file."""

    def __init__(self, files: BagFiles, held: NodeTracks, run: BagRun):
        self.namespace = run.node  # Full name of the node
        self._files = files
        number = run.number - 1
        self._kept: dict[str, np.ndarray] = {}
        self._stamps: dict[str, np.ndarray] = {}
        for name, track in held.tracks.items():
            kept = track.of_run(number)
            if kept.any():
                self._kept[f"{run.node}/{name}"] = kept
                self._stamps[f"{run.node}/{name}"] = track.stamps[kept]
        self.topics = {topic: files.topics[topic] for topic in self._kept}  # Full name of each topic -> ROS type
        text = held.description_of(number)
        place = str(files.path)
        self.description = (
            _description(f"{place}: {run.node}/description", text) if text else _unknown(place, held.tracks, run.node)
        )  # The node's own; without one, what the topics say

    def times(self, topic: str) -> np.ndarray:
        """Return the simulated time of each message of a topic [ns], in the order of the files."""
        return self._stamps.get(topic, np.empty(0, np.int64))

    def count(self, topic: str) -> int:
        """Return how many messages of a topic there are."""
        return len(self.times(topic))

    def messages(self, topics: set[str] | None = None, begin: int = 0) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, simulated time [ns] and data of each message of some topics, in the order of the files."""
        wanted = self.topics.keys() if topics is None else topics & self.topics.keys()
        seen, given = dict.fromkeys(wanted, 0), dict.fromkeys(wanted, 0)
        for topic, _, _, data in self._files.records(set(wanted)):
            kept = self._kept[topic][seen[topic]]
            seen[topic] += 1
            if kept:
                time = int(self._stamps[topic][given[topic]])
                given[topic] += 1
                if time >= begin:
                    yield topic, time, data


def choose_run(bag: Bag, number: int = 0) -> BagRun:
    """Return the only run of a bag, or that of a number.

    Raises InputError if there is none, or more than one, with what to say.
    """
    path = bag.files.path
    runs = [run for run in bag.runs if number in (0, run.number)]
    if not bag.runs and bag.problem:
        raise InputError(f"{path}: {bag.problem}")
    if not bag.runs:
        raise InputError(
            f"{path}: holds no messages of {bag.node or 'a node sim_node'}; `bilayer info {path}` lists its topics. To "
            "read a run, record NODE/description, NODE/com, NODE/nodes, NODE/points, and NODE/body_pose/BODY of each "
            "body"
        )
    if len(runs) != 1:
        every = runs or bag.runs
        listed = [f"{path}{run.address} ({run.start_time:g} to {run.last_time:g} s)" for run in every[:MOST_LISTED]]
        more = f" and {len(every) - MOST_LISTED} more" if len(every) > MOST_LISTED else ""
        found = f"{len(runs)} runs" if runs else f"no run {number}"
        back = any(run.of > 1 for run in every)
        why = " (its time goes back: by a reset, a new start of the node, or two nodes of one name)" if back else ""
        raise InputError(f"{path}: holds {found}{why}; name one: {', '.join(listed)}{more}")
    return runs[0]


def _description(place: str, message: bytes) -> Description:
    """Return what a ``std_msgs/String`` describes."""
    start = len(HEADER) + 4
    try:
        return from_json(message[start : start + int.from_bytes(message[len(HEADER) : start], "little") - 1].decode())
    except (InputError, UnicodeDecodeError) as error:
        raise InputError(f"{place}: {error}") from error


def _unknown(place: str, tracks: dict[str, Track], node: str) -> Description:
    """Return what the topics say of a run: names of bodies and channels, and how many nodes rods have."""
    bodies = dict.fromkeys(name.partition("/")[2] for name in tracks if "/" in name)
    infos = tuple(BodyInfo(body, None, False, holds_rods=f"clamp_wrench/{body}" in tracks) for body in bodies)
    channels: list[str] = []
    if "stimulus_applied" in tracks:
        topic, first = f"{node}/stimulus_applied", tracks["stimulus_applied"]
        channels, _ = decoded(place, topic, int(first.stamps[0]), first.first, read_float64_multi_array)
        if not all(map(is_name, channels)):
            raise InputError(
                f"{place}: {topic}: its label has {shortened(', '.join(channels))!r}, which are no channels"
            )
    template, points = encoders.point_cloud_template, 0
    if "points" in tracks:
        points = _count(tracks["points"].first, len(template(1)), 4 * len(encoders.POINT_FIELDS))
    description = unknown_run(node.rpartition("/")[2], infos, tuple(channels), points)
    if "nodes" not in tracks:
        return description
    nodes = _count(tracks["nodes"].first, len(encoders.pose_array_template(1)), 56)
    none = np.zeros(nodes)
    strand = Strand("all/nodes", "all", "nodes", slice(0, nodes), slice(0, 0), none, none, none, none)
    return Description(**{**vars(description), "strands": (strand,), "node_count": max(points, nodes)})


def _count(message: bytes, of_one: int, step: int) -> int:
    """Return how many elements a message has, from its length and that of a message with one."""
    return max(0, 1 + (len(message) - of_one) // step)
