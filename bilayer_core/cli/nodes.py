"""Nodes that verbs start: this process becomes the node, so that signals and exit codes are the node's."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping
from typing import NoReturn

from bilayer_core.errors import InputError

REPLAY_NODE = "bilayer_sim_ros.replay_node"
"""Module that is run; the core does not import it. It says itself where ROS 2 is missing."""
FOLLOWER = "bilayer_sim_ros.follower"
"""Likewise."""


def become_replay_node(log: str, rate: float | None, loop: bool) -> NoReturn:
    """Play a log on ROS topics, in place of this program. Raises InputError for a rate that is not above 0."""
    if rate is not None and not (math.isfinite(rate) and rate > 0.0):
        raise InputError(f"--rate: {rate:g} is not allowed; it must be a finite number > 0")
    named = f"./{log}" if log.startswith("-") else log  # no option
    command = [sys.executable, "-m", REPLAY_NODE, named, "--ros-args", "-p", f"play.loop:={str(loop).lower()}"]
    if rate is not None:
        command += ["-p", f"play.rate:={rate!r}"]
    _become(command)


def become_follower(node: str, options: Mapping[str, object], flags: Mapping[str, bool]) -> NoReturn:
    """Show what a node publishes while it goes on, in place of this program.

    `node`: its full name. `options`, `flags`: by their names on the command line; those that are None or False are left
    out.
    """
    command = [sys.executable, "-m", FOLLOWER, f"--node={node}"]
    command += [f"{name}={value}" for name, value in options.items() if value is not None]
    command += [name for name, wanted in flags.items() if wanted]
    _become(command)


def _become(command: list[str]) -> NoReturn:
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os.execv(sys.executable, command)
