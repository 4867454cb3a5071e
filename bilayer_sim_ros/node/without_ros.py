"""Message that is shown where ROS 2 is not installed."""

from __future__ import annotations

import sys

from bilayer_core.errors import InputError

ROS_PACKAGES = (
    "rclpy",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "visualization_msgs",
)


def explain_missing_ros(executable: str, error: ModuleNotFoundError) -> int:
    """Say how to get ROS 2 and return the exit code; raises `error` if it is about something else."""
    if (error.name or "").partition(".")[0] not in ROS_PACKAGES:
        raise error
    print(
        f"{executable}: the Python package '{error.name}' of ROS 2 is not there. "
        "Source a ROS 2 environment, or: pip install 'bilayer_sim_ros[ros]' (Linux, x86-64)",
        file=sys.stderr,
    )
    return InputError.exit_code
