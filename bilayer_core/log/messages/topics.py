"""The topics of a run: one table that the log and the ROS node share.

Names are relative to the node's private namespace (``/bilayer_sim`` in a log) unless they begin with a slash.
Stamps are simulation time, the frame is ``world`` with z up, units are SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from bilayer_core.observed.frame import Description

LOG_NAMESPACE = "/bilayer_sim"
FRAME_ID = "world"
QOS = "offered_qos_profiles"
"""Metadata of a channel: the quality of service that its topic is offered with, in the form of rosbag2."""
_INFINITE = "{sec: 9223372036, nsec: 854775807}"


class Rate(Enum):
    """How often a topic is sent."""

    OUTPUT = "output"
    """Every frame: small messages, and the state."""
    DISPLAY = "display"
    """At the rate of markers: large messages, made to be looked at."""
    EVENT = "event"
    """Whenever its value changes from outside: inputs."""


@dataclass(frozen=True)
class TopicSpec:
    """One topic."""

    name: str  # Relative to the node's namespace, or absolute with a leading slash
    type: str  # ROS type, for example ``"geometry_msgs/msg/PoseArray"``
    rate: Rate  # How often it is sent
    depth: int = 10  # History depth of its quality of service; all topics are reliable and volatile

    def full_name(self, namespace: str = LOG_NAMESPACE) -> str:
        """Return the absolute name under `namespace`."""
        return self.name if self.name.startswith("/") else f"{namespace}/{self.name}"

    @property
    def offered_profile(self) -> str:
        """Its quality of service as rosbag2 stores it, with the numbers of `rmw`: the last messages kept, reliable,
        volatile.
        """
        policies = {
            "history": 1,
            "depth": self.depth,
            "reliability": 1,
            "durability": 2,
            "deadline": _INFINITE,
            "lifespan": _INFINITE,
            "liveliness": 1,
            "liveliness_lease_duration": _INFINITE,
            "avoid_ros_namespace_conventions": "false",
        }
        lines = [f"{key}: {value}" for key, value in policies.items()]
        return "- " + "\n  ".join(lines) + "\n"


MULTI_ARRAY = "std_msgs/msg/Float64MultiArray"
MARKERS = "markers"
"""Name of the topic for RViz and Foxglove (`log.messages.markers`)."""
TF = TopicSpec("/tf", "tf2_msgs/msg/TFMessage", Rate.OUTPUT, depth=100)
"""Frames of bodies and ends of rods (`log.messages.tf_frames`), where they are asked for; the depth is that of tf2
itself. They come with every frame: who looks one up by the stamp of a pose, a wrench or `com` finds just that time.
"""


CONTACT_PAIRS, JOINTS = (TopicSpec(name, MULTI_ARRAY, Rate.OUTPUT) for name in ("contact_pairs", "joints"))
SECTION_POINTS = TopicSpec("section_points", "sensor_msgs/msg/PointCloud2", Rate.DISPLAY)


def output_topics(description: Description, tf: bool = False) -> tuple[TopicSpec, ...]:
    """Return all topics that a run of this model sends, with `TF` if that is asked for.

    ================================ ==================================================================================
    ``/clock``                       simulation time
    ``stimulus_applied``             value of each channel; the label of its layout has the channels, commas between
    ``com``                          mass centre of the robot [m]
    ``energy``                       energy of each term [J]; the label has the terms
    ``solver``                       iterations, residual [m/s], substeps, min_gap [m], cpu_time [s]: see `Frame`
    ``body_pose/<body>``             mass centre and orientation
    ``contact_wrench/<body>``        contact force [N] and moment about the mass centre [N m], world frame
    ``clamp_wrench/<body>``          likewise of the rods that the body holds, for bodies that hold some
    ``contact_pairs``                sum of the normal forces between two that can touch [N]; the label has their names
    ``joints``                       wrench, angle [rad] and way [m] of joints; the label has their names
    ``state``                        all that a restart needs; the label has ``name:shape`` of each part
    ``nodes``                        pose of every node, strand by strand; the axes x, y, z of a pose are the material
                                     frame: m1 (through the thickness), m2 (along the width), m3 (tangent)
    ``points``                       x y z strain curvature fx fy fz of the same nodes, then of contact points of bodies
    ``section_points``               x y z curvature of the same points: that across the width [1/m], 0 at those of
                                     beams; where a rod is a strip
    ``markers``                      layers coloured by their strain, bodies, obstacles, contact forces; the first array
                                     of a log deletes all markers that a viewer has
    ================================ ==================================================================================
    """
    output, display = Rate.OUTPUT, Rate.DISPLAY
    return (
        TopicSpec("/clock", "rosgraph_msgs/msg/Clock", output, depth=1),
        TopicSpec("stimulus_applied", MULTI_ARRAY, output),
        TopicSpec("com", "geometry_msgs/msg/PointStamped", output),
        TopicSpec("energy", MULTI_ARRAY, output),
        TopicSpec("solver", MULTI_ARRAY, output),
        *(TopicSpec(f"body_pose/{body.name}", "geometry_msgs/msg/PoseStamped", output) for body in description.bodies),
        *(
            TopicSpec(f"contact_wrench/{body.name}", "geometry_msgs/msg/WrenchStamped", output)
            for body in description.bodies
        ),
        *(
            TopicSpec(f"clamp_wrench/{body.name}", "geometry_msgs/msg/WrenchStamped", output)
            for body in description.bodies
            if body.holds_rods
        ),
        *((CONTACT_PAIRS,) if description.contact_pairs else ()),
        *((JOINTS,) if description.joint_figures else ()),
        TopicSpec("state", MULTI_ARRAY, output),
        *((TF,) if tf else ()),
        TopicSpec("nodes", "geometry_msgs/msg/PoseArray", display),
        TopicSpec("points", "sensor_msgs/msg/PointCloud2", display),
        *((SECTION_POINTS,) if any(strand.strip for strand in description.strands) else ()),
        TopicSpec(MARKERS, "visualization_msgs/msg/MarkerArray", display),
    )


INPUTS = TopicSpec("inputs", MULTI_ARRAY, Rate.EVENT)
"""What acted from outside, exactly: a message for each `observed.inputs.Input`, at the time from which on it acted.

The label is ``step,time,kind:name``: two numbers, time in [s], and then the values of that kind.
"""


OBSTACLE_POINTS = TopicSpec("obstacle_points", "sensor_msgs/msg/PointCloud2", Rate.EVENT)
BODY_POINTS = TopicSpec("body_points", "sensor_msgs/msg/PointCloud2", Rate.DISPLAY)
FORCE_POINTS = TopicSpec("contact_force_points", "sensor_msgs/msg/PointCloud2", Rate.DISPLAY)
"""Of a log, for viewers without markers: points x y z on surfaces and along contact forces (`log.messages.clouds`)."""


EVENTS = TopicSpec("events", "rcl_interfaces/msg/Log", Rate.EVENT)
"""What happened, in words (`log.messages.events`)."""


DESCRIPTION = TopicSpec("description", "std_msgs/msg/String", Rate.EVENT, depth=1)
"""What does not change in a run, as JSON (`log.messages.description_text`): sent once, and kept for who comes late."""


LIVE = TopicSpec("live", "std_msgs/msg/UInt8MultiArray", Rate.DISPLAY, depth=5)
"""All messages of a frame in one, for viewers (`log.messages.packing`); not in logs."""


def stimulus_topics(description: Description) -> tuple[TopicSpec, ...]:
    """Return the topics that set single channels; a log holds each value at the time from which it acted."""
    return tuple(TopicSpec(f"stimulus/{name}", "std_msgs/msg/Float64", Rate.EVENT) for name in description.channels)


def input_topics(description: Description) -> tuple[TopicSpec, ...]:
    """Return the topics that a log holds beside `output_topics`."""
    return (INPUTS, EVENTS, *stimulus_topics(description))


class DisplayGate:
    """Tells which frames carry the topics of `Rate.DISPLAY`: the first one in each period of their rate.

    `rate`: of frames [Hz]. `display_rate`: wished rate of those topics [Hz]; they cannot come more often than frames.
    """

    # Frames come at multiples of the time step, up to rounding; in periods.
    _ROUNDING = 1e-6

    def __init__(self, rate: float, display_rate: float):
        self.set_rates(rate, display_rate)

    def set_rates(self, rate: float, display_rate: float) -> None:
        """Go on with other rates [Hz]; the next frame carries them."""
        self._rate = min(rate, display_rate)
        self._period = -1

    def is_due(self, time: float) -> bool:
        """Return whether the frame at `time` [s] carries these topics; call it once a frame."""
        period = math.floor(time * self._rate + self._ROUNDING)
        due = period != self._period
        self._period = period
        return due
