"""The run for who shows it while it goes on: what it is, once, and whole frames, thinned in real time."""

from __future__ import annotations

import array
import math
import time
from collections import deque
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import MultiArrayDimension, MultiArrayLayout, String, UInt8MultiArray

from bilayer_core.log.messages.description_text import to_json
from bilayer_core.log.messages.encoders import FrameEncoder
from bilayer_core.log.messages.event_messages import encode_event
from bilayer_core.log.messages.events import Event, EventDetector
from bilayer_core.log.messages.packing import pack
from bilayer_core.log.messages.topics import DESCRIPTION, EVENTS, LIVE, DisplayGate, Rate
from bilayer_core.observed.frame import Description, Frame
from bilayer_sim_ros.publishing.cheap_publishers import create_output

PERIOD = 0.01
"""Least real time between two messages: nobody sees more, however fast simulated time goes [s]."""
LARGE_PERIOD = 0.03
"""Likewise between two with shapes of rods [s]."""
UNSHOWN = ("state", "markers")
"""Topics that are not drawn."""
MOST_EVENTS = 1000
"""That wait for the next message, at most."""

KEPT = QoSProfile(
    depth=DESCRIPTION.depth, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Of the description."""
LOSSY = QoSProfile(depth=LIVE.depth, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
"""Of frames: nobody who is slow, or has stopped, is waited for."""


class LivePublisher:
    """Publishes ``~/description`` once, and ``~/live`` while somebody subscribes to it.

    `rate`, `marker_rate`: of frames, and of shapes of rods [Hz]; fewer come where simulated time is fast.
    """

    def __init__(self, node: Node, description: Description, encoder: FrameEncoder, rate: float, marker_rate: float):
        self._encoder = encoder
        self._small = [spec for spec in encoder.topics if spec.rate is Rate.OUTPUT and spec.name not in UNSHOWN]
        self._large = [spec for spec in encoder.topics if spec.rate is Rate.DISPLAY and spec.name not in UNSHOWN]
        self._gate = DisplayGate(rate, marker_rate)
        self._description = description
        self._descriptions = create_output(node, String, DESCRIPTION.full_name("~"), KEPT)
        self._descriptions.publish(String(data=to_json(description)))
        self._publisher = create_output(node, UInt8MultiArray, LIVE.full_name("~"), LOSSY)
        self._forget()

    def _forget(self) -> None:
        """Begin anew: whoever comes gets a whole frame first."""
        self._detector = EventDetector(self._description)
        self._events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self._sent_at = self._large_sent_at = -math.inf
        self._large_due = True
        self._last_time = -math.inf
        self._held: Frame | None = None

    @property
    def wanted(self) -> bool:
        """True if anybody subscribes."""
        return self._publisher.get_subscription_count() > 0

    def set_rates(self, rate: float, marker_rate: float) -> None:
        """Go on with other rates [Hz]."""
        self._gate.set_rates(rate, marker_rate)

    def publish(self, frame: Frame, everything: bool = False) -> None:
        """Send a frame if it is time to; the first one of a run always, and with `everything` each."""
        if not self.wanted:
            if self._last_time > -math.inf:
                self._forget()
            return
        if frame.time < self._last_time:
            self._forget()
        self._events.extend(self._detector.see(frame))
        self._large_due |= self._gate.is_due(frame.time) or everything
        self._last_time, self._held = frame.time, frame
        now = time.monotonic()
        if everything or now - self._sent_at >= PERIOD:
            self._send(frame, now, everything)

    def tell(self, event: Event) -> None:
        """Send an event that frames do not show, with the next frame."""
        if self.wanted:
            self._events.append(event)

    def finish(self) -> None:
        """Send the last frame, if it was held back."""
        if self._held is not None and self.wanted:
            self._large_due = True
            self._send(self._held, time.monotonic(), True)

    def _send(self, frame: Frame, now: float, everything: bool) -> None:
        specs = list(self._small)
        if self._large_due and (everything or now - self._large_sent_at >= LARGE_PERIOD):
            specs += self._large
            self._large_due, self._large_sent_at = False, now
        parts = [(spec.full_name(), self._encoder.encode(spec.name, frame)) for spec in specs]
        parts += [(EVENTS.full_name(), encode_event(event)) for event in self._events]
        self._events.clear()
        self._publisher.publish(live_message(parts))
        self._sent_at, self._held = now, None


def live_message(parts: Sequence[tuple[str, bytes]]) -> UInt8MultiArray:
    """Return the message on ``~/live`` that has the messages of a frame, by their topics in a log."""
    label, data = pack(parts)
    dimension = MultiArrayDimension(label=label, size=len(data), stride=len(data))
    return UInt8MultiArray(layout=MultiArrayLayout(dim=[dimension]), data=array.array("B", data))
