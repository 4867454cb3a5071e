"""Nodes of this package in a bag: their topics, and their runs, which a reset or a new start of the node begins.

A recorder stores when a message came, not its simulated time. That is taken from the stamps of the messages; those
without one get that of the frame that they were sent with (`log.file.frame_matching`).
"""

from __future__ import annotations

import struct
from array import array
from dataclasses import dataclass, field

import numpy as np

from bilayer_core.log.file.bag_files import BagFiles
from bilayer_core.log.file.frame_matching import match_frames
from bilayer_core.log.messages.cdr import HEADER, NANOSECONDS
from bilayer_core.log.messages.topics import DESCRIPTION, EVENTS, MULTI_ARRAY, output_topics
from bilayer_core.names import is_name
from bilayer_core.observed.frame import BodyInfo, Description

Array = np.ndarray
UNREAD = ("/clock", "state", "markers")
"""Topics that quantities are not made of."""
VAGUE = ("nodes", "points", "body_pose", "description")
"""Kinds of topics that nodes of others may have as well."""
_STAMP = struct.Struct("<iI")


def unknown_run(name: str, bodies: tuple[BodyInfo, ...], channels: tuple[str, ...], nodes: int = 0) -> Description:
    """Return the description of a run of which nothing is known but the names of its topics."""
    return Description(
        scene_name=name,
        title="without a description",
        scene_text="",
        node_count=nodes,
        edge_count=0,
        strands=(),
        bodies=bodies,
        obstacles=(),
        channels=channels,
        channel_ranges=((-np.inf, np.inf),) * len(channels),
        state_layout=(),
        channel_units=("",) * len(channels),
    )


_ANY = unknown_run("", (BodyInfo("any", None, False, holds_rods=True),), ())
_SPECS = [spec for spec in output_topics(_ANY) if spec.name not in UNREAD]
_TYPES = {spec.name.partition("/")[0]: spec.type for spec in (*_SPECS, EVENTS, DESCRIPTION)}
"""Kind of topic, such as ``body_pose``, to ROS type."""
_OF_BODIES = {spec.name.partition("/")[0] for spec in _SPECS if "/" in spec.name}


def split_topic(topic: str, ros_type: str) -> tuple[str, str] | None:
    """Return the node that a topic is of and its name there, such as ``body_pose/ball``; None for those of others."""
    owner, _, last = topic.rpartition("/")
    node, _, kind = owner.rpartition("/")
    if node and kind in _OF_BODIES and _TYPES[kind] == ros_type and is_name(last):
        return node, f"{kind}/{last}"
    return (owner, last) if owner and last not in _OF_BODIES and _TYPES.get(last) == ros_type else None


@dataclass
class Track:
    """The messages of one topic, in the order of the files."""

    sent: Array
    stamps: Array
    """`sent`, `stamps`: when each was sent, and its simulated time [ns], shape (messages,)."""
    runs: Array  # Number of the run that it is of, from 0; -1: of none. Shape (messages,).
    first: bytes  # The first message

    def of_run(self, number: int) -> Array:
        """Return which messages are those of a run: in it, time only grows."""
        kept = self.runs == number
        stamps = self.stamps[kept]
        kept[kept] = stamps > np.concatenate([stamps[:1] - 1, np.maximum.accumulate(stamps)[:-1]])
        return kept


@dataclass
class NodeTracks:
    """Messages and runs of one node in a bag."""

    node: str  # Full name of the node
    tracks: dict[str, Track] = field(default_factory=dict)
    """Name of a topic under the node's -> its messages; those of topics without any are left out."""
    descriptions: list[tuple[int, bytes]] = field(default_factory=list)  # When each description was sent [ns], and it
    runs: list[tuple[int, int]] = field(default_factory=list)
    """Simulated time of the first and the last message of each run [ns]."""
    stamped: bool = True  # Whether any messages have stamps; otherwise times are those since the first one came
    certain: bool = True  # Whether the frames of messages without stamps are certain, see `match_frames`

    def description_of(self, number: int) -> bytes | None:
        """Return the last description that was sent before a run began, or the first one; None without any."""
        begun = min(int(of.sent[of.runs == number].min()) for of in self.tracks.values() if (of.runs == number).any())
        before = [data for sent, data in self.descriptions if sent <= begun]
        return before[-1] if before else self.descriptions[0][1] if self.descriptions else None


def index_bag(files: BagFiles, wanted: str = "") -> tuple[dict[str, NodeTracks], list[str]]:
    """Read a bag once for the nodes whose topics it holds.

    Parameters
    ----------
    files : BagFiles
    wanted : str
        The full name of a node that is looked for by its name, whatever it has; by default, those that are recognised
        by their topics.

    Returns
    -------
    nodes : dict
        Full name -> `NodeTracks`.
    unreadable : list of str
        Topics whose messages are not encoded as ROS 2 encodes them.
    """
    named: dict[str, dict[str, str]] = {}
    for topic, ros_type in files.topics.items():
        found = split_topic(topic, ros_type)
        if found and files.encodings(topic) == {"cdr"}:
            named.setdefault(found[0], {})[found[1]] = topic
    nodes = {node: names for node, names in named.items() if node == wanted or not wanted and _is_ours(names)}
    read = {topic: _Reading(files, topic) for names in nodes.values() for topic in names.values()}
    for topic, _, sent, data in files.records(set(read)):
        read[topic].add(sent, data)
    tracks = {
        node: _tracks_of(node, {name: read[topic] for name, topic in of.items() if read[topic].readable})
        for node, of in nodes.items()
    }
    return tracks, [topic for topic, of in read.items() if not of.readable]


def _is_ours(names: dict[str, str]) -> bool:
    kinds = {name.partition("/")[0] for name in names}
    return bool(kinds - {*VAGUE, EVENTS.name}) or DESCRIPTION.name in kinds and bool(kinds & {"nodes", "points"})


class _Reading:
    """The times of one topic, as it is read."""

    def __init__(self, files: BagFiles, topic: str):
        self.readable = True
        self._stamped = files.topics[topic] not in (MULTI_ARRAY, DESCRIPTION.type)
        self._least = len(HEADER) + _STAMP.size * self._stamped
        self._kept = files.topics[topic] == DESCRIPTION.type
        self.sent, self.stamps = array("q"), array("q")
        self.messages: list[bytes] = []

    def add(self, sent: int, data: bytes) -> None:
        """Note the times of a message."""
        if data[:2] != HEADER[:2] or len(data) < self._least:
            self.readable = False
            return
        self.sent.append(min(sent, 2**63 - 1))
        if self._stamped:
            seconds, rest = _STAMP.unpack_from(data, len(HEADER))
            self.stamps.append(seconds * NANOSECONDS + rest)
        if self._kept or not self.messages:
            self.messages.append(data)

    def track(self) -> Track:
        """Return what was noted; without stamps all are zero."""
        sent = np.array(self.sent, np.int64)
        stamps = np.array(self.stamps, np.int64) if self._stamped else np.zeros_like(sent)
        return Track(sent, stamps, np.zeros_like(sent), self.messages[0])


def _tracks_of(node: str, read: dict[str, _Reading]) -> NodeTracks:
    held = NodeTracks(node)
    if described := read.pop(DESCRIPTION.name, None):
        held.descriptions = list(zip(described.sent, described.messages, strict=True))
    held.tracks = {name: of.track() for name, of in read.items() if len(of.sent)}
    events = held.tracks.get(EVENTS.name)
    stamped = {name: of for name, of in held.tracks.items() if _type(name) != MULTI_ARRAY and of is not events}
    bare = [of for name, of in held.tracks.items() if _type(name) == MULTI_ARRAY]
    held.stamped = bool(stamped)
    starts = _separate_runs(list(stamped.values()))
    if events is not None:
        events.runs = np.searchsorted(starts, events.sent, side="right")
    held.certain = _give_stamps(list(stamped.values()), bare)
    for number in range(len(starts) + 1):
        kept = [of.stamps[of.runs == number] for of in (*stamped.values(), *bare)]
        kept = [of for of in kept if len(of)]
        if kept:
            held.runs.append((min(int(of.min()) for of in kept), max(int(of.max()) for of in kept)))
    return held


def _type(name: str) -> str:
    return _TYPES[name.partition("/")[0]]


def _separate_runs(stamped: list[Track]) -> Array:
    """Assign a number to each run, and return when the second and later ones begin [ns].

    A run begins where a topic's stamps go back.
    """
    if not stamped:
        return np.empty(0, np.int64)
    back = [np.flatnonzero(np.diff(of.stamps) < 0) + 1 for of in stamped]
    longest = max(range(len(stamped)), key=lambda k: len(stamped[k].sent))
    starts = np.maximum.accumulate(stamped[longest].sent[back[longest]])
    for of, places in zip(stamped, back, strict=True):
        if len(places) == len(starts):
            of.runs[places] = 1
            of.runs = np.cumsum(of.runs)
        else:  # it was not recorded in each run
            of.runs = np.searchsorted(starts, of.sent, side="right")
    return starts


def _give_stamps(stamped: list[Track], bare: list[Track]) -> bool:
    """Give messages without stamps those of their frames, or where none has a stamp, the time since the first one came;
    returns whether they are certain.
    """
    if not stamped:
        if not bare:
            return True
        longest = max(bare, key=lambda of: len(of.sent))
        longest.stamps = longest.sent - longest.sent.min()
        stamped, bare = [longest], [of for of in bare if of is not longest]
    runs, stamps, sent = (np.concatenate(of) for of in zip(*((t.runs, t.stamps, t.sent) for t in stamped), strict=True))
    order = np.lexsort((sent, stamps, runs))
    runs, stamps, sent = runs[order], stamps[order], sent[order]
    begins = np.flatnonzero(np.r_[True, (np.diff(runs) != 0) | (np.diff(stamps) != 0)])
    first, last = (np.maximum.accumulate(of) for of in (sent[begins], np.maximum.reduceat(sent, begins)))
    certain = True
    for of in bare:
        frames, sure = match_frames(of.sent, first, last)
        certain &= sure
        of.runs = np.where(frames < 0, -1, runs[begins][frames])
        of.stamps = np.where(frames < 0, 0, stamps[begins][frames])
    return certain
