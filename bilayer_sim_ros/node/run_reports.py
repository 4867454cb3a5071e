"""How a run is doing: on /diagnostics once a second, on the console where something is wrong, and as events."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from bilayer_core.log.messages.events import Event, late_stimulus
from bilayer_core.printable import shortened
from bilayer_sim_ros.control.pacing import cause_of_delay
from bilayer_sim_ros.control.stimulus import StimulusInputs
from bilayer_sim_ros.node.parameters import Value
from bilayer_sim_ros.node.run_status import Status
from bilayer_sim_ros.publishing.cheap_publishers import create_output
from bilayer_sim_ros.publishing.conversions import PATIENCE, status_without_run, to_diagnostics

FALLBACKS = {"hold": "the last value stays", "zero": "zero acts", "schedule": "the scene's schedule acts"}
"""What is said of each `stimulus_fallback`."""
TIMERS = (
    "; a timer on simulated time does not fire at t = 0. Answer in the callback of /clock, "
    "or set the parameter 'lockstep_timeout'"
)
"""Follows the warning that nobody answers the start."""
COMPILATION_PERIOD = 5.0
"""Real time between two messages about compilation [s]."""
WARNING_PERIOD = 10.0
"""Real time between two warnings about the same thing [s]."""


class Announcer:
    """Says how a run is doing; called in the thread that simulates.

    `inputs`: whose late and missing messages are said too. `parameters`: of the node. `tell`: publishes and logs an
    event.
    """

    def __init__(
        self,
        node: Node,
        inputs: StimulusInputs,
        parameters: Mapping[str, Value],
        tell: Callable[[Event], None],
    ):
        self._node, self._inputs, self._tell = node, inputs, tell
        self._publisher = create_output(node, DiagnosticArray, "/diagnostics", 10)
        self._name = node.get_fully_qualified_name()
        self._timeout, self._wait = parameters["stimulus_timeout"], parameters["lockstep_timeout"]
        self._fallback = FALLBACKS[parameters["stimulus_fallback"]]
        self._missed, self._failure = False, ""
        inputs.late, inputs.missed = self._say_late, self._say_missing

    def report(self, status: Status) -> None:
        """Say how it is doing."""
        self._say_log(status)
        self._say_delay(status)
        self._say_waiting(status)
        if self._publisher.get_subscription_count() > 0:
            self._publisher.publish(to_diagnostics(status, self._name, self._inputs.ignored))

    def say_compiling(self, done: int, total: int) -> None:
        """Say how many pieces of the engine are compiled; called before the run, in the main thread."""
        text = f"compiling kernels, once for this version on this machine: {done} of {total} pieces"
        self._node.get_logger().info(text, throttle_duration_sec=COMPILATION_PERIOD)
        self._publisher.publish(status_without_run(text, self._name))

    def _say_log(self, status: Status) -> None:
        if status.log.failure and status.log.failure != self._failure:
            self._node.get_logger().error(f"{status.log.failure}; the simulation goes on without it")
        elif status.dropped and not status.log.failure:
            self._node.get_logger().warning(
                f"the disk is slower than the log: {status.log.dropped} frames are left out so far, but no input",
                throttle_duration_sec=WARNING_PERIOD,
            )
        self._failure = status.log.failure

    def _say_delay(self, status: Status) -> None:
        if status.lost > 0.0:
            self._node.get_logger().warning(
                f"behind: simulated time goes at {status.real_time_factor:.3g} of real time, asked for is "
                f"{status.asked_factor:g}; what is lost is not made up for. "
                f"Cause: {cause_of_delay(status.spent, status.real)}",
                throttle_duration_sec=WARNING_PERIOD,
            )

    def _say_waiting(self, status: Status) -> None:
        if status.waited >= PATIENCE and not self._missed:
            timers = "" if status.time else TIMERS
            self._node.get_logger().warning(
                f"lockstep: simulated time stands still at t = {status.time:.6g} s: no controller has answered this "
                f"tick for {status.waited:.0f} s. Controllers must answer each time on /clock{timers}"
            )
            text = f"no answer for {status.waited:.0f} s"
            self._tell(late_stimulus(status.time, text, "simulated time stands still"))
        self._missed = status.waited >= PATIENCE

    def _say_late(self, time: float, name: str) -> None:
        self._tell(late_stimulus(time, f"none on {name} for {self._timeout:g} s", self._fallback))

    def _say_missing(self, time: float, names: Sequence[str]) -> None:
        text = f"no answer of {shortened(', '.join(names))} within {self._wait:g} s of real time"
        self._tell(late_stimulus(time, text, self._fallback))
        self._node.get_logger().warning(
            f"lockstep: {text} at t = {time:.6g} s; {self._fallback}", throttle_duration_sec=WARNING_PERIOD
        )
