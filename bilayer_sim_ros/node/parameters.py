"""Parameters of the nodes: one table for each executable, checked before anything starts."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from bilayer_core.errors import InputError
from bilayer_core.printable import shortened

Value = bool | float | int | str | list[str]

# Parameters that every rclpy node has of itself.
BUILT_IN = ("use_sim_time", "start_type_description_service")
BUILT_IN_PREFIX = "qos_overrides."
OFF = "off"
"""What a parameter file, and ``-p NAME:=off``, understand as false."""


@dataclass(frozen=True)
class NodeParameter:
    """One parameter of a node; the type of `default` is that of the parameter."""

    name: str
    default: bool | float | str | list[str]
    """A list is ``[""]`` for none: the parameter files of ROS have no empty lists."""
    description: str
    """`name`, `description`: the description states the unit."""
    minimum: float = -math.inf  # Smallest value of a number; a default below it is allowed too
    above_minimum: bool = False  # Whether `minimum` itself is excluded
    choices: tuple[str, ...] = ()  # All values of a text parameter; empty when any text will do
    live: bool = False  # Whether it may be set while the node runs; others are read once, at the start
    formerly: str = ""  # A name that it had, by which it may still be given at the start

    @property
    def allowed(self) -> str:
        """Values that may be given, in words."""
        if isinstance(self.default, bool):
            return "true or false"
        if isinstance(self.default, list):
            return "a list of texts"
        if isinstance(self.default, str):
            return "one of " + ", ".join(self.choices) if self.choices else "a text"
        if math.isinf(self.minimum):
            return "a finite number"
        below = f", or {self.default:g}" if self.default < self.minimum else ""
        return f"a finite number {'>' if self.above_minimum else '>='} {self.minimum:g}{below}"

    def accept(self, value: object) -> Value:
        """Return `value` as the parameter's type, or InputError; an integer will do for a number, and for a choice."""
        if self.choices and isinstance(value, int) and not isinstance(value, bool):
            value = str(value)
        if isinstance(self.default, list) and isinstance(value, str):
            value = [value]
        if value is False and self.default == OFF:
            value = OFF
        if self._is_allowed(value):
            return float(value) if isinstance(self.default, float) else value
        found = shortened(repr(value))
        raise InputError(f"parameter '{self.name}' is {found}; allowed is {self.allowed} ({self.description})")

    def _is_allowed(self, value: object) -> bool:
        if isinstance(self.default, bool) or isinstance(value, bool):
            return isinstance(value, type(self.default))
        if isinstance(self.default, list):
            return isinstance(value, list) and all(isinstance(part, str) for part in value)
        if isinstance(self.default, str):
            return isinstance(value, str) and (not self.choices or value in self.choices)
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            return False
        return value == self.default or (value > self.minimum if self.above_minimum else value >= self.minimum)


def accept_all(table: Iterable[NodeParameter], overrides: Mapping[str, object]) -> dict[str, Value]:
    """Return the values of all parameters in `table`: the default, or what `overrides` says.

    Raises InputError for a name that is not in the table, or a value that is not allowed.
    """
    known = {parameter.name: parameter for parameter in table}
    for name in overrides:
        if name not in known and name not in BUILT_IN and not name.startswith(BUILT_IN_PREFIX):
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean '{close[0]}'? " if close else ""
            raise InputError(f"there is no parameter '{shortened(name)}': {hint}There are: {', '.join(known)}")
    return {name: parameter.accept(overrides.get(name, parameter.default)) for name, parameter in known.items()}


FRICTION_OF_SCENE = -1.0
FRICTION = ("friction.coefficient", "friction.forward", "friction.backward", "friction.sideways")
"""Coefficients of friction, by the keys of `contact.friction` of scenes."""

SIM_NODE = (
    NodeParameter("scene", "gripping", "scene file, or name of a bundled scene"),
    NodeParameter(
        "rate",
        0.0,
        "frames published and logged per simulated second [Hz]; 0 = as the scene says; adaptive steps also end at the "
        "times of a larger rate than the scene's",
        0.0,
        live=True,
    ),
    NodeParameter(
        "marker_rate",
        0.0,
        "frames per simulated second that carry nodes, points and markers [Hz], at most `rate`; 0 = as the scene says",
        0.0,
        live=True,
    ),
    NodeParameter(
        "real_time_factor", 1.0, "simulated seconds per second, at most; 0 = as fast as possible", 0.0, live=True
    ),
    *(
        NodeParameter(
            name,
            FRICTION_OF_SCENE,
            f"`contact.{name}` of the scene, from the next tick on; -1 = as the scene says",
            0.0,
            live=True,
            formerly="friction" if name == FRICTION[0] else "",
        )
        for name in FRICTION
    ),
    NodeParameter("duration", 0.0, "simulated time after which the node ends [s]; 0 = until it is stopped", 0.0),
    NodeParameter("publish_clock", True, "publish simulated time on /clock"),
    NodeParameter("tf", False, "publish and log frames of bodies and of the ends of rods on /tf; needs tf2_msgs"),
    NodeParameter("start_paused", False, "wait for the service ~/resume at the start"),
    NodeParameter(
        "stimulus_timeout", 0.0, "simulated time without a message after which the fallback acts [s]; 0 = never", 0.0
    ),
    NodeParameter(
        "stimulus_fallback",
        "hold",
        "what acts before the first message and after the timeout: the value there is, zero, or the scene's schedule",
        choices=("hold", "zero", "schedule"),
    ),
    NodeParameter(
        "stimulus_interpolation",
        "linear",
        "how a stimulus or a load gets to its new value: linear, or smooth (at the end of the control period; it rests "
        "there), or hold (it jumps)",
        choices=("linear", "smooth", "hold"),
    ),
    NodeParameter(
        "control_period",
        0.02,
        "simulated time between two ticks, at which stimuli are taken [s]; 0 = that between two frames",
        0.0,
    ),
    NodeParameter("lockstep", False, "simulated time goes on only when controllers have answered the tick on /clock"),
    NodeParameter(
        "lockstep_answers",
        [""],
        "channels, and mount_pose/<body>, whose answers complete a tick; none = any stimulus does",
    ),
    NodeParameter(
        "lockstep_timeout",
        0.0,
        "real time after which the fallback acts on channels that have not answered a tick [s]; 0 = never",
        0.0,
    ),
    NodeParameter("log", "", "MCAP file to write; empty = none"),
    NodeParameter(
        "rerun", OFF, "off, serve (show the run while it goes on, at 127.0.0.1), or an .rrd file to write at the end"
    ),
    NodeParameter(
        "rerun_bind", "127.0.0.1", "with rerun: serve, where to listen; 0.0.0.0 = for all who reach this machine"
    ),
    NodeParameter("rerun_port", 0.0, "with rerun: serve, the port for viewers; 0 = the first free one from 9876", 0.0),
    NodeParameter("model", "auto", "auto, or a model's name"),
    NodeParameter("dimension", "auto", "2 in a plane, 3 in space", choices=("auto", "2", "3")),
    NodeParameter("dt", 0.0, "fixed steps of this length, with `tolerance` the first [s]; 0 = as the scene says", 0.0),
    NodeParameter(
        "tolerance", 0.0, "largest error per adaptive step, over the longest rod; 0 = as the scene says", 0.0
    ),
)

REPLAY_NODE = (
    NodeParameter("log", "", "MCAP log to play, with an index; may also be the command's argument"),
    NodeParameter(
        "services",
        "std_srvs",
        "types of the services: std_srvs (Trigger), or rosbag2 (those of rosbag2_interfaces, where they are installed)",
        choices=("std_srvs", "rosbag2"),
    ),
    NodeParameter("play.rate", 1.0, "seconds of the log per second", 0.0, above_minimum=True, live=True),
    NodeParameter(
        "play.position",
        0.0,
        "time since the log's first message [s], about once a second; setting it seeks, and keeps paused",
        live=True,
    ),
    NodeParameter("play.loop", False, "begin again at the end"),
    NodeParameter("play.start_paused", False, "wait for the service ~/resume at the start"),
    NodeParameter("play.start_offset", 0.0, "part of the log's beginning that is left out [s]", 0.0),
    NodeParameter("play.playback_duration", -1.0, "how much of the log is played [s]; negative = to its end"),
    NodeParameter(
        "play.playback_until_timestamp",
        -1.0,
        "time of the log at which playing ends [s]; negative = at its end; with a duration as well, the later of both",
    ),
    NodeParameter(
        "play.clock_publish_frequency",
        0.0,
        "messages on /clock per second [Hz]; 0 = none",
        0.0,
    ),
    NodeParameter("play.clock_publish_on_topic_publish", False, "a message on /clock right before each that is played"),
    NodeParameter("play.clock_from_log", False, "publish the messages on /clock that the log holds"),
)
