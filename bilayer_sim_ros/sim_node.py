"""Executable `sim_node`: a `SimulationNode` alone in its process, `bilayer_sim` by default."""

from __future__ import annotations

import sys

from bilayer_sim_ros.node.signals import Signals, Stop


def main(argv: list[str] | None = None) -> int:
    """Run the node; the exit code, 0 also after SIGINT and SIGTERM."""
    signals = Signals("sim_node")  # before what takes long to import
    try:
        from bilayer_sim_ros.node.executable import leave, run
        from bilayer_sim_ros.node.graph_watch import warn_of_unused_remaps
        from bilayer_sim_ros.node.parameters import SIM_NODE
        from bilayer_sim_ros.simulation_node import SimulationNode
    except ModuleNotFoundError as error:
        from bilayer_sim_ros.node.without_ros import explain_missing_ros

        return explain_missing_ros("sim_node", error)
    nodes = []

    def work(node: SimulationNode, stop: Stop) -> None:
        nodes.append(node)
        warn_of_unused_remaps(node, sys.argv if argv is None else argv)
        node.simulate(stop)

    code = run(signals, "sim_node", SIM_NODE, lambda _: SimulationNode(arguments=argv), work, argv)
    if any(node.compiling for node in nodes):
        leave(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
