"""Classes of ROS messages by name."""

from __future__ import annotations

import importlib

CLOCK_TOPIC = "/clock"


def message_class(ros_type: str) -> type:
    """Class of a message type such as ``std_msgs/msg/Float64``."""
    package, name = ros_type.split("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), name)
