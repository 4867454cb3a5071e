"""Executable `gait_controller`: the same wave on any number of stimulus channels, each with a phase of its own.

A controller to copy: plain rclpy, and nothing of the simulator but its topics. It hears simulated time on `/clock` and
answers each time, once, with one `sensor_msgs/JointState` on `<node>/stimulus_stamped`: the time that it answers, the
channels, their values. So it works while the simulation runs freely, is paused, or waits for it in lockstep. What it
says depends on the time alone, so a reset needs nothing.

    gait_controller --ros-args -p channels:="[left, right]" -p phases:="[0.0, 0.5]" -p period:=1.0
"""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

SHAPES = ("sine", "square", "triangle")


def wave(shape: str, phase: float, duty: float) -> float:
    """From 0 at a whole phase to 1 and back; `duty` is the part of a period in which it rises, or a square is high."""
    phase %= 1.0
    if shape == "square":
        return 1.0 if phase < duty else 0.0
    part = phase / duty if phase < duty else (1.0 - phase) / (1.0 - duty)
    return part if shape == "triangle" else 0.5 - 0.5 * math.cos(math.pi * part)


class GaitController(Node):
    """Answers each time on /clock with the gait's values."""

    def __init__(self) -> None:
        super().__init__("gait_controller")
        self.simulator = self.parameter("node", "/bilayer_sim", "full name of the simulation node").rstrip("/")
        self.channels = list(self.parameter("channels", ["humidity"], "stimulus channels"))
        self.phases = list(self.parameter("phases", [0.0], "delay of each channel, in periods"))
        self.period = self.parameter("period", 2.4, "of the gait [s]")
        self.low = self.parameter("low", 0.0, "least value, in the channels' unit")
        self.high = self.parameter("high", 1.0, "largest value")
        self.shape = self.parameter("shape", "sine", f"one of {', '.join(SHAPES)}")
        self.duty = self.parameter("duty", 0.5, "part of a period in which it rises, or in which a square is high")
        self.periods = self.parameter("periods", 0, "after so many periods it rests at `low`; 0 = it goes on")
        if len(self.phases) == 1:
            self.phases *= len(self.channels)
        self.refuse_nonsense()
        self.answered: int | None = None
        self.publisher = self.create_publisher(JointState, f"{self.simulator}/stimulus_stamped", 10)
        self.create_timer(1.0, lambda: None)  # wakes it up where rclpy has slept through a signal
        self.create_subscription(Clock, "/clock", self.hear, 10)

    def parameter(self, name: str, default, description: str):
        """Declare a parameter; its value."""
        descriptor = ParameterDescriptor(description=description, read_only=True)
        value = self.declare_parameter(name, default, descriptor).value
        if value is None:
            raise ValueError(f"parameter '{name}' is empty")
        return value

    def refuse_nonsense(self) -> None:
        """ValueError with the parameter that cannot be."""
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
        """Of all channels at a simulated time [s]."""
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
    parser = ArgumentParser("gait_controller", description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.parse_args(remove_ros_args(sys.argv if argv is None else argv)[1:])
    try:
        rclpy.init(args=argv)
        rclpy.spin(GaitController())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (ValueError, ParameterException) as error:
        print(f"gait_controller: {error}", file=sys.stderr)
        return 2
    except RuntimeError:  # of rclpy, where a signal came while the node was being made
        if rclpy.ok():
            raise
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
