"""Executable `gait_controller`: the same wave on any number of stimulus channels, each with a phase of its own.

A controller to copy: plain rclpy, and nothing of the simulator but its topics. It hears simulated time on `/clock` and
answers each time, once, with one `sensor_msgs/JointState` on `<node>/stimulus_stamped`: the time that it answers, the
channels, their values. So it works while the simulation runs freely, is paused, or waits for it in lockstep. What it
says depends on the time alone, so a reset needs nothing.

    gait_controller --ros-args -p channels:="[left, right]" -p phases:="[0.0, 0.5]" -p period:=1.0
"""

from __future__ import annotations

import math
import signal
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

SHAPES = ("sine", "square", "triangle")


def wave(shape: str, phase: float, duty: float) -> float:
    """Return a wave that goes from 0 at a whole phase to 1 and back; `duty` is the part of a period in which it rises,
    or a square is high.
    """
    phase %= 1.0
    if shape == "square":
        return 1.0 if phase < duty else 0.0
    part = phase / duty if phase < duty else (1.0 - phase) / (1.0 - duty)
    return part if shape == "triangle" else 0.5 - 0.5 * math.cos(math.pi * part)


class GaitController(Node):
    """Answers each time on /clock with the gait's values."""

    def __init__(self) -> None:
        super().__init__("gait_controller", automatically_declare_parameters_from_overrides=True)
        self.known = {"use_sim_time", "start_type_description_service"}
        self.simulator = self.parameter("node", "/bilayer_sim", "full name of the simulation node").rstrip("/")
        self.channels = list(self.parameter("channels", ["humidity"], "stimulus channels"))
        self.phases = list(self.parameter("phases", [0.0], "delay of each channel, in periods"))
        self.period = self.parameter("period", 2.4, "of the gait [s]")
        self.low = self.parameter("low", 0.0, "least value, in the channels' unit")
        self.high = self.parameter("high", 1.0, "largest value")
        self.shape = self.parameter("shape", "sine", f"one of {', '.join(SHAPES)}")
        self.duty = self.parameter("duty", 0.5, "part of a period in which it rises, or in which a square is high")
        self.periods = self.parameter("periods", 0, "after so many periods it rests at `low`; 0 = it goes on")
        for name in self.get_parameters_by_prefix("").keys() - self.known:
            raise ValueError(f"there is no parameter '{name}'; there are {', '.join(sorted(self.known))}")
        if len(self.phases) == 1:
            self.phases *= len(self.channels)
        self.refuse_nonsense()
        self.answered: int | None = None
        self.publisher = self.create_publisher(JointState, f"{self.simulator}/stimulus_stamped", 10)
        self.create_subscription(Clock, "/clock", self.hear, 10)

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

    def refuse_nonsense(self) -> None:
        """Refuse parameters that cannot be: a ValueError names the first."""
        faults = {
            "channels": (self.channels, bool(self.channels) and len(set(self.channels)) == len(self.channels)),
            "phases": (self.phases, len(self.phases) == len(self.channels)),
            "period": (self.period, self.period > 0.0),
            "shape": (self.shape, self.shape in SHAPES),
            "duty": (self.duty, 0.0 < self.duty < 1.0),
            "periods": (self.periods, self.periods >= 0),
        }
        for name, (value, good) in faults.items():
            if not good:
                raise ValueError(f"parameter '{name}' cannot be {value!r}")

    def values(self, now: float) -> list[float]:
        """Return the values of all channels at a simulated time [s]."""
        rests = self.periods and now >= self.periods * self.period
        parts = [0.0 if rests else wave(self.shape, now / self.period - phase, self.duty) for phase in self.phases]
        return [self.low + (self.high - self.low) * part for part in parts]

    def hear(self, message: Clock) -> None:
        """Answer a time; one that stands still is repeated, and needs no other answer."""
        now = message.clock.sec * 10**9 + message.clock.nanosec
        if now == self.answered or self.publisher.get_subscription_count() == 0:
            return
        self.answered = now
        answer = JointState(name=self.channels, position=self.values(1e-9 * now))
        answer.header.stamp = message.clock
        self.publisher.publish(answer)


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; the exit code."""
    signals: list[int] = []  # noted here, they interrupt nothing; rclpy's own handlers do, and may leave it asleep
    signal.signal(signal.SIGINT, lambda number, _: signals.append(number))
    signal.signal(signal.SIGTERM, lambda number, _: signals.append(number))
    parser = ArgumentParser("gait_controller", description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.parse_args(rclpy.utilities.remove_ros_args(sys.argv if argv is None else argv)[1:])
    try:
        rclpy.init(args=argv, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        node, ended = GaitController(), rclpy.task.Future()
        steady = rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME)  # with use_sim_time others may stand
        node.create_timer(0.1, lambda: ended.set_result(None) if signals else None, clock=steady)
        rclpy.spin_until_future_complete(node, ended)
    except (ValueError, ParameterException) as error:
        print(f"gait_controller: {error}", file=sys.stderr)
        return 2
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
