"""Start the simulation: `ros2 launch bilayer_sim_ros simulation.launch.py scene:=gripping namespace:=lab`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    """One node; `scene` overrides what `params_file` says."""
    share = FindPackageShare("bilayer_sim_ros")
    return LaunchDescription(
        [
            DeclareLaunchArgument("scene", default_value="gripping", description="Scene file or bundled scene"),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace of the node"),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "sim_node.yaml"]),
                description="Parameters of the node",
            ),
            Node(
                package="bilayer_sim_ros",
                executable="sim_node",
                name="bilayer_sim",
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    LaunchConfiguration("params_file"),
                    {"scene": ParameterValue(LaunchConfiguration("scene"), value_type=str)},
                ],
                output="screen",
                emulate_tty=True,
            ),
        ]
    )
