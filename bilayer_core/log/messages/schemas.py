"""Definitions of the ROS 2 messages in a log, as the ``ros2msg`` schemas of MCAP want them.

Interface definitions of ROS 2 (common_interfaces and rcl_interfaces, Apache License 2.0), without comments, are in
``ros_messages.txt``; a test holds the assembled schemas against those that the ``rosbags`` package generates.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

FILE = Path(__file__).with_name("ros_messages.txt")
_SEPARATOR, _HEADING = "=" * 80 + "\n", "MSG: "


@cache
def _definitions() -> dict[str, str]:
    """Return the definition of each type, such as ``std_msgs/Header``."""
    parts = FILE.read_text(encoding="utf-8").split(_SEPARATOR)
    return dict(part.removeprefix(_HEADING).split("\n", 1) for part in parts)


def _dependencies(name: str) -> list[str]:
    """Return the types that `name` needs, itself first, each once, in the order in which they are met."""
    found: list[str] = []
    for field_type in (line.split()[0].removesuffix("[]") for line in _definitions()[name].splitlines()):
        if field_type in _definitions():
            found += _dependencies(field_type)
    return list(dict.fromkeys([name, *found]))


def schema_text(ros_type: str) -> str:
    """Return the definition of ``package/msg/Type`` followed by those of all types that it needs."""
    known = _definitions()
    first, *others = _dependencies(ros_type.replace("/msg/", "/"))
    return known[first] + "".join(f"{_SEPARATOR}{_HEADING}{name}\n{known[name]}" for name in others)
