"""Events of a run, as the topic ``~/events``."""

from __future__ import annotations

from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bilayer_core.log.messages.event_messages import encode_event
from bilayer_core.log.messages.events import Event, EventDetector
from bilayer_core.log.messages.topics import EVENTS
from bilayer_core.observed.frame import Description, Frame
from bilayer_sim_ros.publishing.cheap_publishers import create_output

DEPTH = 100
"""Several things may happen in one frame, and none is to be lost."""


class EventPublisher:
    """Publishes events as ready-made bytes while somebody subscribes to them."""

    def __init__(self, node: Node, description: Description):
        quality = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
        self._publisher = create_output(node, Log, EVENTS.full_name("~"), quality)
        self._detector = EventDetector(description)

    @property
    def wanted(self) -> bool:
        """True if anybody subscribes."""
        return self._publisher.get_subscription_count() > 0

    def publish(self, frame: Frame) -> None:
        """Publish what happened since the last frame that was looked at."""
        if self.wanted:
            for event in self._detector.see(frame):
                self.tell(event)

    def tell(self, event: Event) -> None:
        """Publish an event that frames do not show."""
        if self.wanted:
            self._publisher.publish(encode_event(event))
