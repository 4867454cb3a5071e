"""The quality of service with which topics of a log were offered, as rosbag2 notes it beside a channel."""

from __future__ import annotations

from enum import IntEnum

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

from bilayer_core.errors import InputError, SceneError
from bilayer_core.scene.limits import check_content
from bilayer_core.scene.text import read_yaml

DEPTH = 10
"""Where a log does not say it, as in rosbag2."""
LARGEST_DEPTH = 1000
"""Of topics that were to keep all messages, which a log of any length cannot, or thousands [messages]."""


def offered_profile(text: str) -> QoSProfile:
    """Return the quality of service to offer a topic with.

    It is reliable, volatile, with the last ten messages, where the log says nothing else.

    Of several publishers in the log, the strongest offers count, so that who could listen to any of them can listen;
    each of them kept its own last messages, so that the depths add up. Names stay those of ROS topics: without its
    conventions (``avoid_ros_namespace_conventions``) a log could publish what looks like requests to services.

    `text`: a YAML list of profiles, with policies as numbers of `rmw` or by name. Raises InputError if that cannot be
    understood.
    """
    try:
        content = read_yaml(text, "YAML")
        check_content(content, "YAML")
        profiles = [_profile(dict(entry)) for entry in content or []]
    except (SceneError, TypeError, ValueError, LookupError, OverflowError) as error:
        reason = f"there is no {error}" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise InputError(f"its quality of service is not in the form of rosbag2: {reason}") from error
    if not profiles:
        return QoSProfile(depth=DEPTH)
    offered = profiles[0]
    for other in profiles[1:]:
        offered.depth = min(offered.depth + other.depth, LARGEST_DEPTH)
        if other.reliability == ReliabilityPolicy.RELIABLE:
            offered.reliability = other.reliability
        if other.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            offered.durability = other.durability
        for name in ("deadline", "lifespan", "liveliness", "liveliness_lease_duration"):
            if getattr(other, name) != getattr(offered, name):
                setattr(offered, name, getattr(QoSProfile(depth=DEPTH), name))
    return offered


def _profile(entry: dict) -> QoSProfile:
    history = _policy(HistoryPolicy, entry.get("history"))
    depth = LARGEST_DEPTH if history == HistoryPolicy.KEEP_ALL else int(entry.get("depth", 0))
    return QoSProfile(
        depth=min(depth, LARGEST_DEPTH) if depth > 0 else DEPTH,
        reliability=_policy(ReliabilityPolicy, entry.get("reliability")) or ReliabilityPolicy.RELIABLE,
        durability=_policy(DurabilityPolicy, entry.get("durability")) or DurabilityPolicy.VOLATILE,
        liveliness=_policy(LivelinessPolicy, entry.get("liveliness")) or LivelinessPolicy.AUTOMATIC,
        deadline=_duration(entry.get("deadline")),
        lifespan=_duration(entry.get("lifespan")),
        liveliness_lease_duration=_duration(entry.get("liveliness_lease_duration")),
    )


def _policy(kind: type[IntEnum], value: object) -> IntEnum | None:
    """Return a policy by its number or name; None where the log leaves it to the system, or does not know it."""
    if value is None:
        return None
    known = {policy.name.lower(): policy for policy in kind} | {str(policy.value): policy for policy in kind}
    name = str(value).lower()
    if name not in known:
        raise ValueError(f"{value!r} is none of {', '.join(policy.name.lower() for policy in kind)}")
    found = known[name]
    return None if found.name in ("SYSTEM_DEFAULT", "UNKNOWN") else found


def _duration(value: dict | None) -> Duration:
    if value is None:
        return Duration()
    return Duration(seconds=int(value["sec"]), nanoseconds=int(value["nsec"]))
