"""Play a log: `ros2 launch bilayer_sim_ros replay.launch.py log:=run.mcap name:=first rate:=2.0 loop:=true`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "rate": ("play.rate", "1.0", float, "Seconds of the log per second"),
    "loop": ("play.loop", "false", bool, "Begin again at the end"),
    "start_paused": ("play.start_paused", "false", bool, "Wait for the service ~/resume"),
    "start_offset": ("play.start_offset", "0.0", float, "Part of the beginning that is left out [s]"),
    "clock": ("play.clock_publish_frequency", "0.0", float, "Messages on /clock per second [Hz]; 0 = none"),
    "services": ("services", "std_srvs", str, "std_srvs or rosbag2"),
}


def generate_launch_description() -> LaunchDescription:
    """One node, under whose name the log's topics are published."""
    parameters = {"log": ParameterValue(LaunchConfiguration("log"), value_type=str)}
    for argument, (parameter, _, kind, _) in ARGUMENTS.items():
        parameters[parameter] = ParameterValue(LaunchConfiguration(argument), value_type=kind)
    return LaunchDescription(
        [
            DeclareLaunchArgument("log", description="MCAP log"),
            DeclareLaunchArgument("name", default_value="bilayer_replay", description="Name of the node"),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace of the node"),
            *(
                DeclareLaunchArgument(argument, default_value=default, description=description)
                for argument, (_, default, _, description) in ARGUMENTS.items()
            ),
            Node(
                package="bilayer_sim_ros",
                executable="replay_node",
                name=LaunchConfiguration("name"),
                namespace=LaunchConfiguration("namespace"),
                parameters=[parameters],
                output="screen",
                emulate_tty=True,
            ),
        ]
    )
