"""Classes of ROS messages by name."""

from __future__ import annotations

import importlib
import os
import re
from pathlib import Path

import rclpy

from bilayer_core.errors import InputError

CLOCK_TOPIC = "/clock"
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)")
_INDEX = Path("share/ament_index/resource_index/rosidl_interfaces")
"""Below a prefix: for each package with interfaces a file that lists them, such as ``msg/Float64.msg``."""


def message_class(ros_type: str) -> type:
    """Return the class of a message type such as ``std_msgs/msg/Float64``, by importing its package.

    The name comes from this package, never from a file: see `installed_message_class`.
    """
    package, name = ros_type.split("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def installed_message_class(ros_type: str) -> type:
    """Return the class of a message type that a file names, of an installed package of ROS messages alone.

    Raises InputError if it is no name of a type, or no installed package has such a message. Nothing was imported then.
    """
    match = _TYPE.fullmatch(ros_type)
    if match is None:
        raise InputError(f"{ros_type!r} is no type of a message, such as 'std_msgs/msg/Float64'")
    package, name = match.groups()
    if not any(f"msg/{name}.{kind}" in _interfaces(package) for kind in ("msg", "idl")):
        raise InputError(f"the type {ros_type} is in no installed package of ROS messages")
    try:
        return message_class(ros_type)
    except (ImportError, AttributeError) as error:
        raise InputError(f"the type {ros_type} cannot be imported ({error})") from error


def _interfaces(package: str) -> set[str]:
    """Return what the index of installed packages lists of one: of each prefix of the environment, and of rclpy's own,
    which wheels do not put into the environment.
    """
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)), _prefix_of_rclpy()]
    files = (Path(prefix) / _INDEX / package for prefix in prefixes)
    return {line.strip() for file in files if file.is_file() for line in file.read_text().splitlines()}


def _prefix_of_rclpy() -> Path:
    """Return the directory above ``lib/python3.x/site-packages/rclpy/__init__.py``."""
    return Path(rclpy.__file__).parents[4]
