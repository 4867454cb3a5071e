"""Topics on which controllers send; what is refused is said in a warning and changes nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from bilayer_core.errors import InputError
from bilayer_core.model.model import Model
from bilayer_sim_ros.commands import Commands
from bilayer_sim_ros.conversions import nanoseconds_of
from bilayer_sim_ros.stimulus import StimulusInputs

DEPTH = 10
REFUSAL_PERIOD = 1.0
"""Real time between two warnings about refused messages [s]."""
IGNORED_PERIOD = 10.0
"""Real time between two warnings about answers that are ignored [s]."""


def subscribe_stimuli(node: Node, inputs: StimulusInputs, channels: Sequence[str]) -> None:
    """Take stimuli: all channels, one, or those that a message names beside the tick that it answers."""

    def all_channels(message: Float64MultiArray) -> None:
        inputs.receive_all(message.data)

    def one(channel: str, message: Float64) -> None:
        inputs.receive(channel, message.data)

    def stamped(message: JointState) -> None:
        tick = nanoseconds_of(message.header.stamp)
        fault = inputs.receive_stamped(tick, message.name, message.position)
        if fault:
            counts = ", ".join(f"{count} {why}" for why, count in inputs.ignored.items() if count)
            node.get_logger().warning(
                f"lockstep: an answer of {', '.join(message.name)} to t = {tick * 1e-9:.9g} s is {fault} and is "
                f"ignored (so far: {counts})",
                throttle_duration_sec=IGNORED_PERIOD,
            )

    _subscribe(node, Float64MultiArray, "~/stimulus", all_channels)
    for channel in channels:
        _subscribe(node, Float64, f"~/stimulus/{channel}", partial(one, channel))
    _subscribe(node, JointState, "~/stimulus_stamped", stamped)


def subscribe_commands(node: Node, commands: Commands, model: Model) -> None:
    """Take the poses of bodies that controllers may move, and factors of loads."""
    for index in model.bodies.controlled:
        body = model.bodies.names[index]
        _subscribe(node, PoseStamped, f"~/mount_pose/{body}", partial(commands.ask_pose, body))
    for load in model.scene.loads:
        _subscribe(
            node, Float64, f"~/load/{load.name}", lambda message, name=load.name: commands.ask_load(name, message.data)
        )


def warn_of_refusal(node: Node, reason: str) -> None:
    """Say why something is refused, if that has not been said just now."""
    node.get_logger().warning(f"refused: {reason}; the last good value stays", throttle_duration_sec=REFUSAL_PERIOD)


def _subscribe(node: Node, kind: type, topic: str, take: Callable[[Any], None]) -> None:
    def callback(message: Any) -> None:
        try:
            take(message)
        except InputError as error:
            warn_of_refusal(node, str(error))

    node.create_subscription(kind, topic, callback, DEPTH)
