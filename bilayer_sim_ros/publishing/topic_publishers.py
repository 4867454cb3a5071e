"""Publishers for the topics of a run."""

from __future__ import annotations

import math

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from bilayer_core.log.messages.encoders import FrameEncoder
from bilayer_core.log.messages.events import Event
from bilayer_core.log.messages.markers import deleting_all_first
from bilayer_core.log.messages.topics import MARKERS, DisplayGate, Rate, TopicSpec, output_topics
from bilayer_core.observed.frame import Description, Frame
from bilayer_sim_ros.node.message_types import CLOCK_TOPIC, message_class
from bilayer_sim_ros.publishing.cheap_publishers import create_output
from bilayer_sim_ros.publishing.conversions import to_time
from bilayer_sim_ros.publishing.event_topic import EventPublisher
from bilayer_sim_ros.publishing.live_topic import LivePublisher


def quality_of_service(spec: TopicSpec) -> QoSProfile:
    """Return the reliable and volatile, with the topic's depth."""
    return QoSProfile(depth=spec.depth, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)


class FramePublisher:
    """Publishes frames as ready-made bytes, and only topics that somebody subscribes to.

    Parameters
    ----------
    node : Node
    description : Description
    rate, marker_rate : float
        Of frames, and of the topics made to be looked at [Hz]; the smaller one counts for those.
    clock : bool
        Whether to publish /clock with every frame.
    tf : str
        What the names of frames on /tf begin with; empty: there is no such topic.
    """

    def __init__(
        self, node: Node, description: Description, rate: float, marker_rate: float, clock: bool, tf: str = ""
    ):
        self._encoder = FrameEncoder(description, tf)
        self._gate = DisplayGate(rate, marker_rate)
        self._topics: list[tuple[TopicSpec, Publisher]] = [
            (spec, create_output(node, message_class(spec.type), spec.full_name("~"), quality_of_service(spec)))
            for spec in self._encoder.topics
            if clock or spec.name != CLOCK_TOPIC
        ]
        self._viewers, self._shown = 0, -math.inf
        self._events = EventPublisher(node, description)
        self._live = LivePublisher(node, description, self._encoder, rate, marker_rate)

    def set_rates(self, rate: float, marker_rate: float) -> None:
        """Go on with other rates [Hz]."""
        self._gate.set_rates(rate, marker_rate)
        self._live.set_rates(rate, marker_rate)

    @property
    def wanted(self) -> bool:
        """True if anybody subscribes to anything."""
        if self._events.wanted or self._live.wanted:
            return True
        return any(of.get_subscription_count() > 0 for _, of in self._topics)

    def publish(self, frame: Frame, everything: bool = False) -> None:
        """Send `frame` on every topic that has a subscriber and is due, or on every one of them."""
        display = self._gate.is_due(frame.time) or everything
        for spec, publisher in self._topics:
            subscribers = publisher.get_subscription_count()
            if (display or spec.rate is not Rate.DISPLAY) and subscribers > 0:
                data = self._encoder.encode(spec.name, frame)
                if spec.name == MARKERS and self._is_first(frame.time, subscribers):
                    data = deleting_all_first(data)
                publisher.publish(data)
        self._events.publish(frame)
        self._live.publish(frame, everything)

    def _is_first(self, time: float, viewers: int) -> bool:
        """Return whether markers of a time [s] are the first of a run, or the first that one of the viewers gets."""
        first = time < self._shown or viewers > self._viewers
        self._viewers, self._shown = viewers, time
        return first

    def tell(self, event: Event) -> None:
        """Send an event that frames do not show."""
        self._events.tell(event)
        self._live.tell(event)

    def is_shown(self) -> bool:
        """Return whether anybody shows the run while it goes on."""
        return self._live.wanted

    def finish(self) -> None:
        """Send what was held back, after the last frame."""
        self._live.finish()


class ClockPublisher:
    """Publishes times on /clock that are not those of frames."""

    def __init__(self, node: Node, description: Description):
        (spec,) = (spec for spec in output_topics(description) if spec.name == CLOCK_TOPIC)
        self._publisher = create_output(node, Clock, spec.name, quality_of_service(spec))

    def publish(self, time: float) -> None:
        """Publish simulated time `time` [s]."""
        if self._publisher.get_subscription_count() > 0:
            self._publisher.publish(Clock(clock=to_time(time)))
