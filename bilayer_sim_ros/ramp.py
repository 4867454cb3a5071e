"""A controller that takes one stimulus channel from one value to another at a constant rate."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from bilayer_core.errors import InputError
from bilayer_sim_ros.conversions import NANOSECONDS, nanoseconds_of
from bilayer_sim_ros.parameters import Value

CLOCK_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
POLL_PERIOD = 0.05
"""Real time between two looks at whether something is connected [s]."""
FINAL_MESSAGES = 5
"""How often the end value is sent."""


def ramp(elapsed: float, duration: float, start_value: float, end_value: float) -> float:
    """Value after `elapsed` of `duration` [s]; constant before and after."""
    part = min(max(elapsed / duration, 0.0), 1.0)
    return (1.0 - part) * start_value + part * end_value


class RampSender:
    """Sends the value of each new time; the ramp begins at the first one, and again when time goes back, as it does
    with a reset of the simulation, or where a log that is played begins again or is sought in.

    Parameters
    ----------
    send : callable
        Sends a value.
    finished : callable
        Called when the end value has been sent often enough.
    parameters : mapping
        Of `control`.
    """

    def __init__(self, send: Callable[[float], None], finished: Callable[[], None], parameters: Mapping[str, Value]):
        self._send = send
        self._finished = finished
        self._duration, self._hold = parameters["duration"], parameters["hold"]
        self._values = parameters["start_value"], parameters["end_value"]
        self._start: int | None = None
        self._last: int | None = None
        self._final = 0

    @property
    def begun(self) -> bool:
        """Whether there has been a time."""
        return self._start is not None

    def hear(self, now: int) -> None:
        """It is `now` [ns]; nothing is sent for the same time again."""
        if now == self._last:
            return
        if self._last is not None and now < self._last:
            self._start, self._final = None, 0
        self._last = now
        if self._start is None:
            self._start = now
        elapsed = (now - self._start) / NANOSECONDS
        self._send(ramp(elapsed, self._duration, *self._values))
        self._final += elapsed >= self._duration
        if self._final >= FINAL_MESSAGES and not self._hold:
            self._finished()


def control(node: Node, parameters: Mapping[str, Value], stop: threading.Event) -> None:
    """Connect, ramp in simulated time or, if `simulated_time` is false, in that of the node's own clock, and end.

    Which of the two is never guessed from what has been discovered so far: a publisher of /clock may be found
    later than the subscriber of the stimulus in the same process. In simulated time each time on /clock is answered
    once, as a simulation in lockstep expects it.
    """
    target, channel = parameters["node"].rstrip("/"), parameters["channel"]
    topic = f"{target}/stimulus/{channel}"
    publisher = node.create_publisher(Float64, topic, 10)
    limit = parameters["connection_timeout"]
    node.get_logger().info(f"waiting for a subscriber of {topic}")
    if not _wait(lambda: publisher.get_subscription_count() > 0, stop, limit, f"nobody subscribes to {topic}"):
        return
    sender = RampSender(lambda value: publisher.publish(Float64(data=value)), stop.set, parameters)
    if parameters["simulated_time"]:
        node.create_subscription(Clock, "/clock", lambda message: sender.hear(nanoseconds_of(message.clock)), CLOCK_QOS)
        # Where time stands still it is repeated once a second.
        if not _wait(lambda: sender.begun, stop, limit, "/clock is silent, and simulated_time is true"):
            return
    else:
        clock = node.get_clock()
        node.create_timer(1.0 / parameters["rate"], lambda: sender.hear(clock.now().nanoseconds))
    node.get_logger().info(f"ramping {topic}")
    if parameters["resume"] and not _resume(node, f"{target}/resume", stop, limit):
        return
    stop.wait()
    node.get_logger().info("done")


def _wait(condition: Callable[[], bool], stop: threading.Event, limit: float, failure: str) -> bool:
    """Wait until `condition` holds; False when stopped, InputError after `limit` [s]."""
    deadline = time.monotonic() + limit
    while not condition():
        if stop.wait(POLL_PERIOD):
            return False
        if time.monotonic() > deadline:
            raise InputError(f"{failure} (waited {limit:g} s)")
    return True


def _resume(node: Node, service: str, stop: threading.Event, limit: float) -> bool:
    """Let the simulation run; False when stopped."""
    client = node.create_client(Trigger, service)
    if not _wait(client.service_is_ready, stop, limit, f"there is no service {service}"):
        return False
    future = client.call_async(Trigger.Request())
    return _wait(future.done, stop, limit, f"{service} does not answer")
