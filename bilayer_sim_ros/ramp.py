"""A controller that takes one stimulus channel from one value to another at a constant rate."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from bilayer_core.errors import InputError
from bilayer_sim_ros.parameters import Value

BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
POLL_PERIOD = 0.05
"""Real time between two looks at whether something is connected [s]."""
FINAL_MESSAGES = 5
"""How often the end value is sent."""


def ramp(elapsed: float, duration: float, start_value: float, end_value: float) -> float:
    """Value after `elapsed` of `duration` [s]; constant before and after."""
    part = min(max(elapsed / duration, 0.0), 1.0)
    return (1.0 - part) * start_value + part * end_value


def control(node: Node, parameters: Mapping[str, Value], stop: threading.Event) -> None:
    """Connect, ramp in simulated time or, if `simulated_time` is false, in that of the node's own clock, and end.

    Which of the two is never guessed from what has been discovered so far: a publisher of /clock may be found
    later than the subscriber of the stimulus in the same process.
    """
    target, channel = parameters["node"].rstrip("/"), parameters["channel"]
    topic = f"{target}/stimulus/{channel}"
    publisher = node.create_publisher(Float64, topic, 10)
    limit = parameters["connection_timeout"]
    node.get_logger().info(f"waiting for a subscriber of {topic}")
    if not _wait(lambda: publisher.get_subscription_count() > 0, stop, limit, f"nobody subscribes to {topic}"):
        return
    clock = node.get_clock()
    if parameters["simulated_time"]:
        node.set_parameters([Parameter("use_sim_time", value=True)])
        heard: deque[Clock] = deque(maxlen=1)
        node.create_subscription(Clock, "/clock", lambda message: heard.append(message), BEST_EFFORT)
        # A paused simulation repeats its time once a second.
        if not _wait(lambda: heard, stop, limit, "/clock is silent, and simulated_time is true"):
            return
        start = Time.from_msg(heard[-1].clock, clock_type=clock.clock_type)
    else:
        start = clock.now()
    final = 0

    def send() -> None:
        nonlocal final
        elapsed = (clock.now() - start).nanoseconds * 1e-9
        duration = parameters["duration"]
        publisher.publish(Float64(data=ramp(elapsed, duration, parameters["start_value"], parameters["end_value"])))
        final += elapsed >= duration
        if final >= FINAL_MESSAGES:
            stop.set()

    node.get_logger().info(f"ramping {topic}")
    send()
    node.create_timer(1.0 / parameters["rate"], send)
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
