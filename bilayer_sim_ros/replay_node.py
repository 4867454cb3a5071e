"""Executable `replay_node`: plays a log as a ROS 2 node, `bilayer_replay` by default."""

from __future__ import annotations

import signal
import sys

from bilayer_sim_ros.missing import explain_missing_ros
from bilayer_sim_ros.parameters import REPLAY_NODE


def main(argv: list[str] | None = None) -> int:
    """Run the node; the exit code, 0 also after SIGINT and SIGTERM."""
    for number in (signal.SIGINT, signal.SIGTERM):  # until `run` has handlers of its own
        signal.signal(number, lambda *_: sys.exit(0))
    try:
        from bilayer_sim_ros.executable import run
        from bilayer_sim_ros.replay import play
    except ModuleNotFoundError as error:
        return explain_missing_ros("replay_node", error)
    return run("replay_node", "bilayer_replay", REPLAY_NODE, play, argv, argument="log")


if __name__ == "__main__":
    sys.exit(main())
