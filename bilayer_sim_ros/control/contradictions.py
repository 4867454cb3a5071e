"""Controllers that contradict each other on a channel, where the last message before a tick acts."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rclpy.node import Node

from bilayer_core.printable import shortened
from bilayer_sim_ros.control.stimulus import Channel

ALIKE = 0.01
"""Part of the range of a channel by which two controllers may differ and still agree."""
NEAR = 1.0
"""Real time within which messages are looked at together, where control periods are shorter [s]."""
MOST_SOURCES = 8
"""Controllers of a channel that are remembered."""
UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""Name of a node until it is discovered, and of publishers that belong to none (rmw)."""


@dataclass(frozen=True)
class Source:
    """Where a message comes from: its topic, and its publisher where the middleware tells it (`publisher_gid`)."""

    topic: str
    publisher: bytes = b""


@dataclass
class _Sent:
    """The last message of a source."""

    value: float
    tick: int
    time: float


@dataclass
class _Heard:
    """Last messages of the sources of a channel, the latest one last."""

    sources: dict[Source, _Sent] = field(default_factory=dict)
    told: bool = False


class Contradictions:
    """Notices two controllers that take turns on a channel with values that differ.

    One controller that follows another is none, and neither are two that send the same: a second one contradicts if it
    speaks between two messages of the first, within a control period or a second, and its value is not between theirs.

    `ticks`: returns how many control periods have begun. `tell`: called once for each channel, with its name and the
    value of each of the two sources. `clock`: steady clock [s].
    """

    def __init__(
        self,
        channels: Sequence[Channel],
        ticks: Callable[[], int],
        tell: Callable[[str, Mapping[Source, float]], None],
        clock: Callable[[], float] = time.monotonic,
    ):
        self._widths = {channel.name: channel.maximum - channel.minimum for channel in channels}
        self._heard = {channel.name: _Heard() for channel in channels}
        self._ticks, self._tell, self._clock = ticks, tell, clock

    def note(self, values: Mapping[str, float], source: Source) -> None:
        """Note a message that was accepted, with its value of each channel."""
        tick, now = self._ticks(), self._clock()
        for name, value in values.items():
            heard = self._heard[name]
            if heard.told:
                continue
            before = heard.sources.pop(source, None)
            if before is not None and (tick - before.tick <= 1 or now - before.time <= NEAR):
                low, high = sorted((before.value, value))
                margin = ALIKE * self._widths[name]
                for other, sent in heard.sources.items():
                    if sent.time >= before.time and not low - margin <= sent.value <= high + margin:
                        heard.told = True
                        self._tell(name, {source: value, other: sent.value})
                        break
            heard.sources[source] = _Sent(value, tick, now)
            if len(heard.sources) > MOST_SOURCES:
                del heard.sources[next(iter(heard.sources))]


def source_of(topic: str, info: Mapping[str, Any]) -> Source:
    """Return where a message comes from, by the information that rclpy hands over beside it."""
    return Source(topic, bytes((info.get("publisher_gid") or {}).get("data", b"")))


def warn_of_contradiction(node: Node, channel: str, values: Mapping[Source, float]) -> None:
    """Warn about two controllers of a channel, by their topics and nodes."""
    sides = " and ".join(f"{value:g} on {source.topic} ({_sender(node, source)})" for source, value in values.items())
    node.get_logger().warning(
        f"stimulus '{shortened(channel)}' gets {sides}: these controllers contradict each other. "
        "The last message before each tick acts; stop one of them, or give them different channels"
    )


def _sender(node: Node, source: Source) -> str:
    """Return the full names of the nodes that may have sent a message, one where the publisher is known."""
    publishers = node.get_publishers_info_by_topic(source.topic)
    known = [publisher for publisher in publishers if bytes(publisher.endpoint_gid) == source.publisher]
    names = {f"{of.node_namespace.rstrip('/')}/{of.node_name}" for of in known or publishers}
    if any(UNKNOWN in name for name in names):
        return "a node whose name is not known"
    return shortened(", ".join(sorted(names)) or "a node that has left")
