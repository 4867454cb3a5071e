"""Valid names of parts of scenes, and so of rods, bodies, channels and topics in logs."""

from __future__ import annotations

import re

LONGEST_NAME = 100
"""Characters."""
NAME = r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*"
"""Fit for key paths, for ROS topics and for file names."""


def is_name(text: str) -> bool:
    """Return whether a text is a name that a part may have."""
    return len(text) <= LONGEST_NAME and re.fullmatch(NAME, text) is not None
