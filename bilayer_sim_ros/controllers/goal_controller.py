"""Executable `goal_controller`: takes a robot to a goal, one beat after the other, by where its centre of mass is.

A controller to copy: plain rclpy, and nothing of the simulator but its topics. Each beat takes one stimulus channel
from `low` up and back, by a part of the way to `high`; then it looks at `<node>/com`. The next beat is as large as what
is left asks for, by what earlier ones have brought. Near the goal and beyond it rests, until the robot is moved back.

It answers each time on `/clock`, once, with one `sensor_msgs/JointState` on `<node>/stimulus_stamped`, so it works
while the simulation runs freely, is paused, or waits for it in lockstep. Where time goes back it begins anew.

    goal_controller --ros-args -p channel:=humidity -p period:=2.4 -p goal:="[0.1, 0.0, 0.0]"
"""

from __future__ import annotations

import math
import signal
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections import deque

import rclpy
from geometry_msgs.msg import PointStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

SECOND = 10**9
LOOK = 40_000_000  # before the end of a beat [ns]: what was published then has come, each time in lockstep
SHARE = 0.8  # of what is left, that one beat is to bring
ALIKE = 0.05  # sizes of beats that differ by less count as one


class GoalController(Node):
    """Answers each time on /clock with the value of the present beat."""

    def __init__(self) -> None:
        super().__init__("goal_controller", automatically_declare_parameters_from_overrides=True)
        self.known = {"use_sim_time", "start_type_description_service"}
        node = self.parameter("node", "/bilayer_sim", "full name of the simulation node").rstrip("/")
        self.channel = self.parameter("channel", "humidity", "stimulus channel")
        self.period = self.parameter("period", 2.4, "of a beat [s]")
        self.width = self.parameter("width", 0.0, "of a rectangular pulse at its start [s]; 0 = a sine, up and down")
        self.low = self.parameter("low", 0.0, "at rest, in the channel's unit")
        self.high = self.parameter("high", 1.0, "of the largest beat")
        self.axis = self.parameter("axis", [1.0, 0.0, 0.0], "direction in which beats move the robot")
        self.goal = self.parameter("goal", [math.nan] * 3, "of the centre of mass [m]; also by the topic ~/goal")
        self.tolerance = self.parameter("tolerance", 0.005, "distance along the axis that is good enough [m]")
        for name in self.get_parameters_by_prefix("").keys() - self.known:
            raise ValueError(f"there is no parameter '{name}'; there are {', '.join(sorted(self.known))}")
        vectors = len(self.axis) == len(self.goal) == 3 and any(self.axis)
        if not (vectors and self.period > self.width >= 0.0 and self.tolerance > 0.0):
            raise ValueError("allowed are period > width >= 0, tolerance > 0, goal and axis of 3 numbers, axis not 0")
        self.begin_anew()
        self.publisher = self.create_publisher(JointState, f"{node}/stimulus_stamped", 10)
        self.create_subscription(Clock, "/clock", self.hear, 10)
        self.create_subscription(PointStamped, f"{node}/com", self.see, 50)
        self.create_subscription(PointStamped, "~/goal", self.aim, 1)

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

    def begin_anew(self) -> None:
        """Forget time, places and beats."""
        self.answered, self.start, self.size, self.before, self.rests = -1, None, 0.0, None, False
        self.seen: deque[tuple[int, float]] = deque(maxlen=200)
        self.brought = {0.0: 0.0}

    def aim(self, message: PointStamped) -> None:
        """Take another goal; the present beat goes on to its end."""
        self.goal, self.rests = [message.point.x, message.point.y, message.point.z], False

    def see(self, message: PointStamped) -> None:
        """Remember how far along the axis the centre of mass is."""
        now = message.header.stamp.sec * SECOND + message.header.stamp.nanosec
        self.seen.append((now, self.along((message.point.x, message.point.y, message.point.z))))

    def along(self, point) -> float:
        return sum(a * p for a, p in zip(self.axis, point, strict=True)) / math.hypot(*self.axis)  # [m]

    def hear(self, message: Clock) -> None:
        """Answer a time; one that stands still is repeated, and needs no other answer."""
        now = message.clock.sec * SECOND + message.clock.nanosec
        if now == self.answered or self.publisher.get_subscription_count() == 0:
            return
        if now < self.answered:
            self.begin_anew()
        self.answered = now
        if self.start is None or now >= self.start + self.period * SECOND:
            self.begin_beat(now)
        elapsed = 1e-9 * (now - self.start)
        sine = 0.5 - 0.5 * math.cos(2.0 * math.pi * elapsed / self.period)
        part = sine if self.width == 0.0 else float(elapsed < self.width)
        answer = JointState(name=[self.channel], position=[self.low + self.size * part * (self.high - self.low)])
        answer.header.stamp = message.clock
        self.publisher.publish(answer)

    def begin_beat(self, now: int) -> None:
        """Choose the size of the next beat by where the robot is."""
        here = next((place for time, place in reversed(self.seen) if time <= now - LOOK), None)
        if here is not None and self.before is not None and self.size > 0.0:
            others = {size: way for size, way in self.brought.items() if size == 0.0 or abs(size - self.size) > ALIKE}
            self.brought = others | {self.size: here - self.before}
        self.start, self.before = now, here
        left = math.nan if here is None else self.along(self.goal) - here
        self.size = 0.0 if math.isnan(left) or left <= 0.5 * self.tolerance else self.size_for(SHARE * left)
        rested, self.rests = self.rests, not math.isnan(left) and self.size == 0.0
        if self.rests and not rested:
            self.get_logger().info(f"rests at t = {1e-9 * now:g} s, {1e3 * left:.2f} mm before the goal")

    def size_for(self, way: float) -> float:
        """Part of the largest beat that is to bring a way [m]."""
        known = sorted(self.brought.items())
        for (small, less), (large, more) in zip(known[:-1], known[1:], strict=True):
            if less <= way < more:
                return small + (large - small) * (way - less) / (more - less)
        return 1.0


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; the exit code."""
    signals: list[int] = []  # noted here, they interrupt nothing; rclpy's own handlers do, and may leave it asleep
    signal.signal(signal.SIGINT, lambda number, _: signals.append(number))
    signal.signal(signal.SIGTERM, lambda number, _: signals.append(number))
    parser = ArgumentParser("goal_controller", description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv if argv is None else argv)[1:])
    try:
        rclpy.init(args=argv, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        node, ended = GoalController(), rclpy.task.Future()
        node.create_timer(0.1, lambda: ended.set_result(None) if signals else None)
        rclpy.spin_until_future_complete(node, ended)
    except (ValueError, ParameterException) as error:
        print(f"goal_controller: {error}", file=sys.stderr)
        return 2
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
