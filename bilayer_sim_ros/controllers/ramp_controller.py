"""Executable `ramp_controller`: takes one stimulus channel from one value to another at a constant rate.

A controller to copy: plain rclpy, and nothing of the simulator but its topics. It hears simulated time on `/clock` and
answers each time, once, with one `sensor_msgs/JointState` on `<node>/stimulus_stamped`: the time that it answers, the
channel, its value. So it works while the simulation runs freely, is paused, or waits for it in lockstep. The ramp
begins at the first time that it hears, and anew where time goes back, as it does with a reset. It ends when the end
value has been sent a few times; with `hold` it goes on answering, as a simulation in lockstep needs it.

    ramp_controller --ros-args -p channel:=humidity -p end_value:=0.5 -p duration:=13.3
"""

from __future__ import annotations

import math
import signal
import sys
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter

import rclpy
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

SECOND = 10**9
LOOK_PERIOD = 0.05
"""Real time between two looks for signals, and whether all is connected [s]."""
FINAL_MESSAGES = 5  # how often the end value is sent


def ramp(elapsed: float, duration: float, start_value: float, end_value: float) -> float:
    """Return the value after `elapsed` of `duration` [s]; constant before and after."""
    part = min(max(elapsed / duration, 0.0), 1.0)
    return (1.0 - part) * start_value + part * end_value


class RampController(Node):
    """Answers each time with the ramp's value; `done` ends it, with an exception if it cannot be connected."""

    def __init__(self) -> None:
        super().__init__("ramp_controller", automatically_declare_parameters_from_overrides=True)
        self.known = {"use_sim_time", "start_type_description_service"}
        node = self.parameter("node", "/bilayer_sim", "full name of the simulation node").rstrip("/")
        self.channel = self.parameter("channel", "humidity", "stimulus channel")
        self.values = [
            self.parameter("start_value", 0.0, "value at the start, in the channel's unit"),
            self.parameter("end_value", 1.0, "value at the end, in the channel's unit"),
        ]
        self.duration = self.parameter("duration", 1.0, "time from the start value to the end value [s]")
        self.simulated = self.parameter("simulated_time", True, "ramp in the time of /clock; false = in real time")
        rate = self.parameter("rate", 50.0, "messages per second in real time [Hz]")
        self.hold = self.parameter("hold", False, "go on sending the end value until interrupted")
        self.wants_resume = self.parameter("resume", False, "call the simulation's service ~/resume once connected")
        self.limit = self.parameter("connection_timeout", 180.0, "longest wait for the simulation node [s]")
        for name in self.get_parameters_by_prefix("").keys() - self.known:
            raise ValueError(f"there is no parameter '{name}'; there are {', '.join(sorted(self.known))}")
        for name, value in {"duration": self.duration, "rate": rate, "connection_timeout": self.limit}.items():
            if not 0.0 < value < math.inf:
                raise ValueError(f"parameter '{name}' cannot be {value!r}; allowed is a finite number > 0")
        if not all(map(math.isfinite, self.values)):
            raise ValueError(f"start_value and end_value cannot be {self.values}; allowed are finite numbers")
        self.done = Future()
        self.start: int | None = None
        self.answered, self.final, self.since = -1, 0, time.monotonic()
        self.topic, self.service = f"{node}/stimulus/{self.channel}", self.create_client(Trigger, f"{node}/resume")
        self.publisher = self.create_publisher(JointState, f"{node}/stimulus_stamped", 10)
        self.get_logger().info(f"waiting for a subscriber of {self.topic}")
        # Not the node's clock: with use_sim_time that stands still until somebody publishes /clock.
        self.steady, real = rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME), rclpy.clock.Clock()
        self.looks = self.create_timer(LOOK_PERIOD, self.look, clock=self.steady)
        if self.simulated:
            self.create_subscription(Clock, "/clock", lambda message: self.hear(message.clock), 10)
        else:
            self.create_timer(1.0 / rate, lambda: self.hear(real.now().to_msg()), clock=self.steady)

    def parameter(self, name: str, default, description: str):
        """Declare a parameter and return its value; whole numbers will do for numbers."""
        self.known.add(name)
        value = default
        if self.has_parameter(name):  # as it was given, with any type
            value = self.get_parameter(name).value
            self.undeclare_parameter(name)
        kind, wanted = map(Parameter.Type.from_parameter_value, (value, default))
        if kind != wanted and kind.name.replace("INTEGER", "DOUBLE") == wanted.name:
            value = float(value) if wanted == Parameter.Type.DOUBLE else list(map(float, value))
        elif kind != wanted:
            allowed = wanted.name.lower().replace("_", " ")
            raise ValueError(f"parameter '{name}' is {str(value)[:100]!r}; allowed is a value of the type {allowed}")
        descriptor = ParameterDescriptor(description=description, read_only=True)
        return self.declare_parameter(name, value, descriptor, ignore_override=True).value

    @property
    def connected(self) -> bool:
        """True if the channel is there, and answers will be heard."""
        return self.count_subscribers(self.topic) > 0 and self.publisher.get_subscription_count() > 0

    def look(self) -> None:
        """Resume the simulation once all is there, or give up."""
        missing = "" if self.connected else f"nobody subscribes to {self.topic}"
        if not missing and self.start is None:
            missing = "/clock is silent, and simulated_time is true"
        if not missing and self.wants_resume and not self.service.service_is_ready():
            missing = f"there is no service {self.service.srv_name}"
        if not missing:
            self.looks.cancel()
            self.get_logger().info(f"ramping {self.topic}")
            if self.wants_resume:
                self.service.call_async(Trigger.Request())
        elif time.monotonic() - self.since > self.limit and not self.done.done():
            self.done.set_exception(TimeoutError(f"{missing} (waited {self.limit:g} s)"))

    def hear(self, stamp: Time) -> None:
        """Answer a time; one that stands still is repeated, and needs no other answer."""
        now = stamp.sec * SECOND + stamp.nanosec
        if now == self.answered or not self.connected:
            return
        if self.start is None or now < self.answered:
            self.start, self.final = now, 0
        self.answered = now
        elapsed = (now - self.start) / SECOND
        answer = JointState(name=[self.channel], position=[ramp(elapsed, self.duration, *self.values)])
        answer.header.stamp = stamp
        self.publisher.publish(answer)
        self.final += elapsed >= self.duration
        if self.final >= FINAL_MESSAGES and not (self.hold or self.done.done()):
            self.done.set_result(None)


def main(argv: list[str] | None = None) -> int:
    """Run the node until its ramp has ended or it is interrupted; the exit code."""
    signals: list[int] = []  # noted here, they interrupt nothing; rclpy's own handlers do, and may leave it asleep
    signal.signal(signal.SIGINT, lambda number, _: signals.append(number))
    signal.signal(signal.SIGTERM, lambda number, _: signals.append(number))
    parser = ArgumentParser("ramp_controller", description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv if argv is None else argv)[1:])
    try:
        rclpy.init(args=argv, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        node = RampController()
        node.create_timer(LOOK_PERIOD, lambda: node.done.set_result(signals[0]) if signals else None, clock=node.steady)
        rclpy.spin_until_future_complete(node, node.done)
        if node.done.result() is None:  # no signal
            node.get_logger().info("done")
    except (ValueError, ParameterException, TimeoutError) as error:
        print(f"ramp_controller: {error}", file=sys.stderr)
        return 2
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
