"""Publishers for the topics of a log."""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from bilayer_core.errors import InputError
from bilayer_core.log.file.indexed_log import Channel, IndexedLog, Message
from bilayer_core.log.messages.cdr import HEADER, NANOSECONDS
from bilayer_core.log.messages.markers import delete_all, deleting_all_first
from bilayer_core.log.messages.topics import LOG_NAMESPACE
from bilayer_core.printable import printable, shortened
from bilayer_sim_ros.node.message_types import CLOCK_TOPIC, installed_message_class
from bilayer_sim_ros.replay.player import Playback
from bilayer_sim_ros.replay.replay_for_viewers import replayed_run
from bilayer_sim_ros.replay.stored_qos import DEPTH, offered_profile

CDR = "cdr"
MARKER_ARRAY = "visualization_msgs/msg/MarkerArray"
OF_RUNNING_NODES = ("/rosout", "/parameter_events")
"""Topics on which every node that runs speaks of itself."""
_PLAIN_NAME = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)
"""Without substitutions, and without parts that begin with ``_``, which are of actions and services."""
ACKNOWLEDGEMENT = 1.0
"""Longest wait for subscribers at the end, of all topics together [s]."""


def replayed_name(topic: str) -> str:
    """Return the name under which a topic of a log is published: those of the simulation node become the player's."""
    return f"~{topic.removeprefix(LOG_NAMESPACE)}" if topic.startswith(f"{LOG_NAMESPACE}/") else topic


class ReplayTopics:
    """Publishes messages as the bytes that they are in the log.

    The first markers of each pass begin with one that deletes all: viewers keep those of another time otherwise.

    `playback`: which clock is published, if any. `warn`: called once for each type that cannot be published, and once
    for each other fault of a topic. Raises InputError if the log's own clock is asked for, and it holds none.
    """

    def __init__(self, node: Node, log: IndexedLog, playback: Playback, warn: Callable[[str], None]):
        self._node, self._warn = node, warn
        self._topics = {channel.number: channel.topic for channel in log.channels}
        self._publishers: dict[int, Publisher] = {}
        self.latched: dict[int, int] = {}  # Channel -> depth, of those that are transient local
        self._markers = {channel.number for channel in log.channels if channel.type == MARKER_ARRAY}
        self._stale: set[int] = set()
        self._unsendable: set[int] = set()
        reserved = OF_RUNNING_NODES if playback.stored_clock else (CLOCK_TOPIC, *OF_RUNNING_NODES)
        self._reserved = {node.resolve_topic_name(name) for name in reserved}
        refused: dict[str, list[str]] = defaultdict(list)
        for channel in log.channels:
            if channel.topic == CLOCK_TOPIC and not playback.stored_clock:
                continue
            try:
                self._add(channel)
            except InputError as error:
                refused[str(error)].append(channel.topic)
        for reason, topics in refused.items():
            warn(f"left out, as {printable(reason)}: {', '.join(map(shortened, topics))}")
        names = {publisher.topic_name for publisher in self._publishers.values()}
        if playback.stored_clock and node.resolve_topic_name(CLOCK_TOPIC) not in names:
            raise InputError(
                f"parameter 'play.clock_from_log' is true, and {log.path} holds no {CLOCK_TOPIC} to publish"
            )
        self.channels = set(self._publishers)  # Those that can be published
        made = playback.clock_rate > 0.0 or playback.clock_on_publish
        self._clock = node.create_publisher(Clock, CLOCK_TOPIC, QoSProfile(depth=1)) if made else None
        self._run = replayed_run(node, log.path, names)

    def _add(self, channel: Channel) -> None:
        """Make the publisher of a channel; InputError if there can be none."""
        name = replayed_name(channel.topic)
        if not _PLAIN_NAME.fullmatch(channel.topic):
            raise InputError("names of topics have parts of letters, digits and '_' that begin with a letter")
        if self._node.resolve_topic_name(name) in self._reserved:
            raise InputError("the nodes that run now publish there")
        if channel.encoding != CDR:
            raise InputError(f"messages in the encoding {channel.encoding!r} are not those of ROS 2, which are {CDR!r}")
        ros_class = installed_message_class(channel.type)
        try:
            profile = offered_profile(channel.qos)
        except InputError as error:
            profile = QoSProfile(depth=DEPTH)
            self._warn(f"topic {shortened(channel.topic)}: {error}; it is offered reliable and volatile")
        try:
            publisher = self._node.create_publisher(ros_class, name, profile)
        except Exception as error:  # of many kinds: names, types without support, what the middleware refuses
            raise InputError(" ".join(str(error).split())) from error
        self._publishers[channel.number] = publisher
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self.latched[channel.number] = profile.depth

    def restart(self) -> None:
        """Let the next markers of each topic delete those before them."""
        self._stale = set(self._markers)

    def send(self, message: Message) -> None:
        """Publish a message."""
        channel, data = message.channel, message.data
        if channel in self._stale:
            self._stale.discard(channel)
            if data.startswith(HEADER):
                data = deleting_all_first(data)
            else:
                self._publish(channel, delete_all())
        self._publish(channel, data)
        if self._run is not None:
            self._run.add(self._topics[channel], message.time, message.data)

    def _publish(self, channel: int, data: bytes) -> None:
        try:
            self._publishers[channel].publish(data)
        except Exception as error:  # rclpy does not export the class of what the middleware refuses
            if channel not in self._unsendable:
                self._unsendable.add(channel)
                reason = " ".join(str(error).split())
                self._warn(
                    f"topic {shortened(self._topics[channel])}: a message that cannot be sent is left out ({reason})"
                )

    def finish_instant(self) -> None:
        """Publish what viewers of the run get of a time, all messages of which were sent."""
        if self._run is not None:
            self._run.finish_instant()

    def forget(self, channel: int) -> None:
        """Delete what was published on a latched channel until now, so that nobody gets it."""
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
