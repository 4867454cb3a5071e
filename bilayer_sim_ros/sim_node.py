"""Executable `sim_node`: the simulation as a ROS 2 node, `bilayer_sim` by default."""

from __future__ import annotations

import sys

from bilayer_sim_ros.missing import explain_missing_ros
from bilayer_sim_ros.parameters import SIM_NODE


def main(argv: list[str] | None = None) -> int:
    """Run the node; the exit code."""
    try:
        from bilayer_sim_ros.executable import run
        from bilayer_sim_ros.simulation import simulate
    except ModuleNotFoundError as error:
        return explain_missing_ros("sim_node", error)
    return run("sim_node", "bilayer_sim", SIM_NODE, simulate, argv)


if __name__ == "__main__":
    sys.exit(main())
