"""Nodes that verbs start: this process becomes the node, so that signals and exit codes are the node's."""

from __future__ import annotations

import math
import os
import sys
from typing import NoReturn

from bilayer_core.errors import InputError

REPLAY_NODE = "bilayer_sim_ros.replay_node"
"""Module that is run; the core does not import it. It says itself where ROS 2 is missing."""


def become_replay_node(log: str, rate: float | None, loop: bool) -> NoReturn:
    """Play a log on ROS topics, in place of this program.

    Raises
    ------
    InputError
        For a rate that is not above 0.
    """
    if rate is not None and not (math.isfinite(rate) and rate > 0.0):
        raise InputError(f"--rate: {rate:g} is not allowed; it must be a finite number > 0")
    named = f"./{log}" if log.startswith("-") else log  # no option
    command = [sys.executable, "-m", REPLAY_NODE, named, "--ros-args", "-p", f"play.loop:={str(loop).lower()}"]
    if rate is not None:
        command += ["-p", f"play.rate:={rate!r}"]
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os.execv(sys.executable, command)
