"""Play a log: `ros2 launch bilayer_sim_ros replay.launch.py log:=run.mcap name:=first rate:=2.0 loop:=true`.

`ros2 launch bilayer_sim_ros replay.launch.py --show-args` lists the arguments, one for each parameter.
"""

from launch import LaunchDescription

from bilayer_sim_ros.node.launch_description import node_description
from bilayer_sim_ros.node.parameters import REPLAY_NODE


def generate_launch_description() -> LaunchDescription:
    """Return a description of one node, under whose name the log's topics are published."""
    return node_description("replay_node", "bilayer_replay", REPLAY_NODE)
