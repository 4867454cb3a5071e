"""What the launch files of this package describe: one node, with an argument for each of its parameters."""

from __future__ import annotations

from collections.abc import Sequence

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.logging import get_logger
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from bilayer_core.errors import InputError
from bilayer_sim_ros.launch_arguments import NODE_ARGUMENTS, argument_name, describe, near_misses, parameters_of
from bilayer_sim_ros.parameters import NodeParameter

PACKAGE = "bilayer_sim_ros"


def node_description(executable: str, node_name: str, table: Sequence[NodeParameter]) -> LaunchDescription:
    """One node of this package; arguments override what its file of parameters says.

    Parameters
    ----------
    executable : str
    node_name : str
        By default.
    table : sequence of NodeParameter
        Its parameters.
    """
    defaults = dict.fromkeys(NODE_ARGUMENTS, "") | {"name": node_name}
    arguments = {
        name: DeclareLaunchArgument(name, default_value=defaults[name], description=text)
        for name, text in NODE_ARGUMENTS.items()
    }
    for parameter in table:
        name = argument_name(parameter)
        arguments[name] = DeclareLaunchArgument(name, default_value="", description=describe(parameter))

    def node(context: LaunchContext) -> list[Node]:
        given = context.launch_configurations
        for text in near_misses(arguments, given):
            get_logger(PACKAGE).warning(text)
        try:
            values = {
                name: ParameterValue(value, value_type=list[str] if isinstance(value, list) else type(value))
                for name, value in parameters_of(table, given).items()
            }
        except InputError as error:
            raise RuntimeError(f"{executable}: {error}") from None
        return [
            Node(
                package=PACKAGE,
                executable=executable,
                name=given["name"],
                namespace=given["namespace"],
                parameters=[part for part in (given["params_file"], values) if part],
                output="screen",
                emulate_tty=True,
            )
        ]

    return LaunchDescription([*arguments.values(), OpaqueFunction(function=node)])
