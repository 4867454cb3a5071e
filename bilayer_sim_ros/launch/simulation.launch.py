"""Start the simulation: `ros2 launch bilayer_sim_ros simulation.launch.py scene:=gripping log:=run.mcap`.

`ros2 launch bilayer_sim_ros simulation.launch.py --show-args` lists the arguments, one for each parameter.
"""

from launch import LaunchDescription

from bilayer_sim_ros.node.launch_description import node_description
from bilayer_sim_ros.node.parameters import SIM_NODE


def generate_launch_description() -> LaunchDescription:
    """Return a description of one node."""
    return node_description("sim_node", "bilayer_sim", SIM_NODE)
