"""Publishers for the topics of a log."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterable

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from bilayer_core.errors import InputError
from bilayer_core.record.cdr import NANOSECONDS
from bilayer_core.record.indexed_log import Channel
from bilayer_core.record.topics import LOG_NAMESPACE
from bilayer_sim_ros.message_types import CLOCK_TOPIC, message_class
from bilayer_sim_ros.stored_qos import DEPTH, offered_profile

CDR = "cdr"
ACKNOWLEDGEMENT = 1.0
"""Longest wait for subscribers at the end, of all topics together [s]."""


def replayed_name(topic: str) -> str:
    """Name under which a topic of a log is published: what was the simulation node's own is the player's own."""
    return f"~{topic.removeprefix(LOG_NAMESPACE)}" if topic.startswith(f"{LOG_NAMESPACE}/") else topic


class ReplayTopics:
    """Publishes messages as the bytes that they are in the log.

    Parameters
    ----------
    node : Node
    channels : iterable of Channel
    clock : bool
        Whether `send_clock` will be called. A clock in the log is never published.
    warn : callable
        Called once for each type that cannot be published, and once for each other fault of a topic.

    Attributes
    ----------
    channels : set of int
        Those that can be published.
    latched : dict
        Channel -> depth, of those that are transient local.
    """

    def __init__(self, node: Node, channels: Iterable[Channel], clock: bool, warn: Callable[[str], None]):
        self._node = node
        self._publishers: dict[int, Publisher] = {}
        self.latched: dict[int, int] = {}
        refused: dict[str, list[str]] = defaultdict(list)
        for channel in channels:
            if channel.topic == CLOCK_TOPIC:
                continue
            try:
                ros_class = _class_of(channel)
            except InputError as error:
                refused[str(error)].append(channel.topic)
                continue
            try:
                profile = offered_profile(channel.qos)
            except InputError as error:
                profile = QoSProfile(depth=DEPTH)
                warn(f"topic {channel.topic}: {error}; it is offered reliable and volatile")
            try:
                publisher = node.create_publisher(ros_class, replayed_name(channel.topic), profile)
            except Exception as error:  # of many kinds: names, types without support, what the middleware refuses
                refused[" ".join(str(error).split())].append(channel.topic)
                continue
            self._publishers[channel.number] = publisher
            if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                self.latched[channel.number] = profile.depth
        for reason, topics in refused.items():
            warn(f"left out, as {reason}: {', '.join(topics)}")
        self.channels = set(self._publishers)
        self._clock = node.create_publisher(Clock, CLOCK_TOPIC, QoSProfile(depth=1)) if clock else None

    def send(self, channel: int, data: bytes) -> None:
        """Publish a message."""
        self._publishers[channel].publish(data)

    def forget(self, channel: int) -> None:
        """Have nobody get what was published on a latched channel until now."""
        old = self._publishers[channel]
        self._node.destroy_publisher(old)
        self._publishers[channel] = self._node.create_publisher(old.msg_type, old.topic, old.qos_profile)

    def send_clock(self, now: int) -> None:
        """Publish the time of the log [ns]."""
        seconds, rest = divmod(now, NANOSECONDS)
        self._clock.publish(Clock(clock=Time(sec=seconds, nanosec=rest)))

    def flush(self) -> None:
        """Wait a little until all that was sent has arrived."""
        deadline = time.monotonic() + ACKNOWLEDGEMENT
        for publisher in self._publishers.values():
            if publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE:
                publisher.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))


def _class_of(channel: Channel) -> type:
    """Class of a channel's messages, or InputError with what is wrong."""
    if channel.encoding != CDR:
        raise InputError(f"messages in the encoding {channel.encoding!r} are not those of ROS 2, which are {CDR!r}")
    package, separator, name = channel.type.partition("/msg/")
    if not (package.isidentifier() and separator and name.isidentifier()):
        raise InputError(f"{channel.type!r} is no type of a message, such as 'std_msgs/msg/Float64'")
    try:
        return message_class(channel.type)
    except (ImportError, AttributeError) as error:
        raise InputError(f"the type {channel.type} cannot be imported ({error})") from error
