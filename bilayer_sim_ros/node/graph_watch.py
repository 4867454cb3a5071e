"""Watches the graph for others who miss a node by a letter, a type or a quality of service, and for a second clock."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible

from bilayer_core.printable import shortened
from bilayer_sim_ros.control.subscriptions import LONGEST_WARNING
from bilayer_sim_ros.node.message_types import CLOCK_TOPIC
from bilayer_sim_ros.node.near_misses import nearest, of_topics
from bilayer_sim_ros.node.ros_arguments import remap_sources

PERIOD = 1.0
"""Real time between two looks [s]."""
MOST_WARNINGS = 100
"""Of one node about topics: each is remembered, so that it is given once."""


class GraphWatch:
    """Warns, once for each topic, while the node's executor spins. `node`: with all its topics."""

    def __init__(self, node: Node):
        self._node = node
        self._prefix = node.get_fully_qualified_name() + "/"
        self._inputs = {own.topic_name: _type_name(own.msg_type) for own in node.subscriptions}
        self._outputs = {own.topic_name for own in node.publishers}
        # The others are watched by rclpy.
        self._watched = {own.topic_name: _type_name(own.msg_type) for own in node.publishers if not own.event_handlers}
        self._told: set[str] = set()
        steady = NodeClock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD, self.look, callback_group=MutuallyExclusiveCallbackGroup(), clock=steady)

    def look(self) -> None:
        """Say what has not been said."""
        if len(self._told) >= MOST_WARNINGS:
            return
        published, subscribed = {}, set()
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self._told or not (topic.startswith(self._prefix) or topic in self._inputs):
                continue
            if topic in self._inputs and types == [self._inputs[topic]]:
                continue
            if publishers := self._node.get_publishers_info_by_topic(topic):
                published[topic] = {publisher.topic_type for publisher in publishers}
            elif topic not in self._outputs:
                subscribed.add(topic)
        said = of_topics(self._prefix, self._inputs, self._outputs, published, subscribed)
        if CLOCK_TOPIC in self._outputs and CLOCK_TOPIC not in self._told:
            others = self._node.count_publishers(CLOCK_TOPIC) - 1
            if others > 0:
                said[CLOCK_TOPIC] = (
                    f"{CLOCK_TOPIC} is published by {others} more: who hears it hears several times. "
                    "Set publish_clock to false for all but one, or remap it"
                )
        for topic, sent in self._watched.items():
            if topic not in self._told and (text := self._unheard(topic, sent)):
                said[topic] = text
        for topic, text in list(said.items())[: MOST_WARNINGS - len(self._told)]:
            self._told.add(topic)
            self._node.get_logger().warning(shortened(text, LONGEST_WARNING))
        if len(self._told) >= MOST_WARNINGS:
            self._node.get_logger().warning(f"{MOST_WARNINGS} warnings about topics were given; no more follow")

    def _unheard(self, topic: str, sent: str) -> str:
        """Return a warning of a subscriber that cannot receive a topic, sent as type `sent`; empty without one."""
        others = self._node.get_subscriptions_info_by_topic(topic)
        offered = [of.qos_profile for of in self._node.get_publishers_info_by_topic(topic)] if others else []
        for other in others:
            if other.topic_type != sent:
                return f"{topic} is listened to as {other.topic_type}, which is not sent: it is {sent}"
            # As the graph has both: what a profile leaves open has been decided there.
            checked = [qos_check_compatible(profile, other.qos_profile) for profile in offered]
            if checked and all(compatibility == QoSCompatibility.ERROR for compatibility, _ in checked):
                why = checked[0][1].removeprefix("ERROR: ").rstrip(";")
                return f"{topic} is listened to by somebody who cannot hear it: {why}"
        return ""


def warn_of_unused_remaps(node: Node, argv: Sequence[str]) -> None:
    """Warn about remappings of names that a node does not have but almost has."""
    topics = {own.topic_name for own in (*node.subscriptions, *node.publishers)}
    services = {own.service_name for own in node.services}
    prefix = node.get_fully_qualified_name() + "/"
    for source in remap_sources(argv):
        if node.resolve_topic_name(source) in topics or node.resolve_service_name(source) in services:
            continue
        meant = nearest(node.resolve_topic_name(source, only_expand=True), topics | services, prefix)
        if meant:
            text = f"{shortened(source)} is remapped, but is no name of this node: did you mean {meant}?"
            node.get_logger().warning(text)


def _type_name(message_type: type) -> str:
    """Return the name of a message type as graphs have it."""
    return f"{message_type.__module__.partition('.')[0]}/msg/{message_type.__name__}"
