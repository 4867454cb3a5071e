"""Executable `replay_node`: plays a log as a ROS 2 node, `bilayer_replay` by default."""

from __future__ import annotations

import sys

from bilayer_sim_ros.node.signals import Signals


def main(argv: list[str] | None = None) -> int:
    """Run the node; the exit code, 0 also after SIGINT and SIGTERM."""
    signals = Signals("replay_node")  # before what takes long to import
    try:
        from bilayer_sim_ros.node.executable import run_task
        from bilayer_sim_ros.node.parameters import REPLAY_NODE
        from bilayer_sim_ros.replay.log_replay import play
    except ModuleNotFoundError as error:
        from bilayer_sim_ros.node.without_ros import explain_missing_ros

        return explain_missing_ros("replay_node", error)
    return run_task(signals, "replay_node", "bilayer_replay", REPLAY_NODE, play, argv, argument="log")


if __name__ == "__main__":
    sys.exit(main())
