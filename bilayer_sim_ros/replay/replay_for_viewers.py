"""A replayed log for viewers: its description, and whole frames on ``~/live``, as a simulation node sends them."""

from __future__ import annotations

import math
import time
from pathlib import Path

from rclpy.node import Node
from std_msgs.msg import String, UInt8MultiArray

from bilayer_core.errors import InputError
from bilayer_core.log.file.log_head import read_head
from bilayer_core.log.messages.cdr import NANOSECONDS
from bilayer_core.log.messages.description_text import to_json
from bilayer_core.log.messages.encoders import clock_template
from bilayer_core.log.messages.topics import DESCRIPTION, EVENTS, LIVE, Rate, output_topics
from bilayer_core.observed.frame import Description
from bilayer_sim_ros.node.message_types import CLOCK_TOPIC
from bilayer_sim_ros.publishing.cheap_publishers import create_output
from bilayer_sim_ros.publishing.live_topic import KEPT, LARGE_PERIOD, LOSSY, PERIOD, UNSHOWN, live_message


def replayed_run(node: Node, path: Path, names: set[str]) -> ReplayedRun | None:
    """Return what publishes the run of a log for viewers.

    None if it is not the log of a run, or if messages of the log are published under one of these full names of topics.
    """
    if {node.resolve_topic_name(spec.full_name("~")) for spec in (DESCRIPTION, LIVE)} & names:
        return None
    try:
        return ReplayedRun(node, read_head(path).description)
    except InputError:
        return None


class ReplayedRun:
    """Publishes ``~/description`` once, and the frames of a log on ``~/live`` while somebody subscribes to it."""

    def __init__(self, node: Node, description: Description):
        specs = {spec.full_name(): spec for spec in output_topics(description) if spec.name not in UNSHOWN}
        self._topics = specs.keys() - {CLOCK_TOPIC}
        self._large = {topic for topic, spec in specs.items() if spec.rate is Rate.DISPLAY}
        self._clock = clock_template()
        self._descriptions = create_output(node, String, DESCRIPTION.full_name("~"), KEPT)
        self._descriptions.publish(String(data=to_json(description)))
        self._publisher = create_output(node, UInt8MultiArray, LIVE.full_name("~"), LOSSY)
        self._frame: list[tuple[str, bytes]] = []
        self._events: list[tuple[str, bytes]] = []
        self._sent_at = self._large_sent_at = -math.inf

    def add(self, topic: str, stamp: int, data: bytes) -> None:
        """Take a message that was sent: the topic in the log, log time [ns] and bytes."""
        if topic in self._topics:
            if not self._frame:
                self._clock.set_time(stamp / NANOSECONDS)
                self._frame.append((CLOCK_TOPIC, self._clock.to_bytes()))
            self._frame.append((topic, data))
        elif topic == EVENTS.full_name():
            self._events.append((topic, data))

    def finish_instant(self) -> None:
        """Send the frame, if it is whole, somebody subscribes, and the last one is long enough ago to be seen."""
        frame, self._frame = self._frame, []
        if not frame:
            return
        if self._publisher.get_subscription_count() == 0:
            self._events.clear()
            return
        now = time.monotonic()
        large = now - self._large_sent_at >= LARGE_PERIOD and any(topic in self._large for topic, _ in frame)
        if large or now - self._sent_at >= PERIOD:
            self._publisher.publish(live_message([*frame, *self._events]))
            self._events.clear()
            self._sent_at, self._large_sent_at = now, now if large else self._large_sent_at
