"""The topic /tf of a node: asked for by a parameter, as its message type is no part of common_interfaces."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping

from rclpy.node import Node

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.parameters import Value

PACKAGE = "tf2_msgs"


def tf_prefix(node: Node, parameters: Mapping[str, Value]) -> str:
    """Return the prefix of the names of frames, the node's own full name; empty if /tf is not asked for.

    Raises InputError if it is asked for and its message type is not installed.
    """
    if not parameters["tf"]:
        return ""
    if importlib.util.find_spec(PACKAGE) is None:
        raise InputError(
            f"parameter 'tf' is True, and the Python package '{PACKAGE}' of ROS 2 is not there. There is no wheel of "
            "it: source a ROS 2 environment that has it (apt install ros-$ROS_DISTRO-tf2-msgs); without it allowed is "
            "False. `bilayer run --log FILE.mcap --tf` writes the same frames into a log"
        )
    return node.get_fully_qualified_name().strip("/")
