"""Executable `goal_controller`: moves a robot to a goal, one beat after another, with feedback from its centre of mass.

A feedback controller to copy: plain rclpy, and nothing of the simulator but its topics. Each beat raises one stimulus
channel from `low` part of the way to `high` and lowers it again. At the start of a beat the controller reads
`<node>/com`: the size of the beat depends on the distance that is left and on what earlier beats achieved. Near the
goal and beyond it the channel rests, until the robot moves back.

Topics have no order among each other: the frame of a time T may arrive before or after T on `/clock`. So the controller
waits until it has both, and answers T exactly once, with one `sensor_msgs/JointState` on `<node>/stimulus_stamped` that
has the stamp T. In lockstep the simulator waits for that answer, and the run is the same each time, bit for bit. The
controller also works while the simulation runs freely or is paused. It starts again when time goes back (`~/reset`).

    goal_controller --ros-args -p channel:=humidity -p period:=2.4 -p goal:="[0.1, 0.0, 0.0]"
"""

from __future__ import annotations

import math
import signal
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter

import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

SECOND = 10**9
SHARE = 0.8  # part of the distance to the goal that one beat should cover
ALIKE = 0.05  # beats whose sizes differ by less are treated as one


class GoalController(Node):
    """Answers each time on /clock once, with the value of the present beat."""

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
        self.now, self.seen, self.place = -1, -1, math.nan
        self.begin_anew()
        self.publisher = self.create_publisher(JointState, f"{node}/stimulus_stamped", 10)
        self.create_subscription(Clock, "/clock", self.hear, 10)
        self.create_subscription(PointStamped, f"{node}/com", self.see, 10)
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
        """Forget all answers and beats."""
        self.answered, self.start, self.size, self.before, self.rests = -1, None, 0.0, math.nan, False
        self.brought = {0.0: 0.0}

    def aim(self, message: PointStamped) -> None:
        """Take another goal for the beats after the present one."""
        self.goal, self.rests = [message.point.x, message.point.y, message.point.z], False

    def along(self, point) -> float:
        return sum(a * p for a, p in zip(self.axis, point, strict=True)) / math.hypot(*self.axis)  # [m]

    def hear(self, message: Clock) -> None:
        """Take a simulated time, and answer it if its frame is there."""
        before, self.now = self.now, message.clock.sec * SECOND + message.clock.nanosec
        if self.now < before:
            self.begin_anew()
        self.answer(message.clock)

    def see(self, message: PointStamped) -> None:
        """Take a frame, and answer its time if that is the time on /clock."""
        before, self.seen = self.seen, message.header.stamp.sec * SECOND + message.header.stamp.nanosec
        self.place = self.along((message.point.x, message.point.y, message.point.z))
        if self.seen < before:
            self.begin_anew()
        self.answer(message.header.stamp)

    def answer(self, stamp: Time) -> None:
        """Answer a time once; the simulator repeats clock and frame while it waits, for controllers that start late."""
        if self.now != self.seen or self.now == self.answered or self.publisher.get_subscription_count() == 0:
            return
        self.answered = self.now
        if self.start is None or self.now >= self.start + self.period * SECOND:
            self.begin_beat()
        elapsed = 1e-9 * (self.now - self.start)
        sine = 0.5 - 0.5 * math.cos(2.0 * math.pi * elapsed / self.period)
        part = sine if self.width == 0.0 else float(elapsed < self.width)
        answer = JointState(name=[self.channel], position=[self.low + self.size * part * (self.high - self.low)])
        answer.header.stamp = stamp
        self.publisher.publish(answer)

    def begin_beat(self) -> None:
        """Choose the size of the next beat by the distance that is left."""
        if self.size > 0.0:
            others = {size: way for size, way in self.brought.items() if size == 0.0 or abs(size - self.size) > ALIKE}
            self.brought = others | {self.size: self.place - self.before}
        self.start, self.before = self.now, self.place
        left = self.along(self.goal) - self.place  # NaN without a goal
        self.size = self.size_for(SHARE * left) if left > 0.5 * self.tolerance else 0.0
        rested, self.rests = self.rests, left <= 0.5 * self.tolerance
        if self.rests and not rested:
            self.get_logger().info(f"rests at t = {1e-9 * self.now:g} s, {1e3 * left:.2f} mm before the goal")

    def size_for(self, way: float) -> float:
        """Return the size, as a part of the largest beat, that covers a distance [m]."""
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
        steady = rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME)  # with use_sim_time others may stand
        node.create_timer(0.1, lambda: ended.set_result(None) if signals else None, clock=steady)
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
