"""Contents of this package's launch files: one node, with an argument for each of its parameters."""

from __future__ import annotations

import json
from collections.abc import Sequence

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.logging import get_logger
from launch_ros.actions import Node

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.launch_arguments import (
    NODE_ARGUMENTS,
    argument_name,
    arguments_of,
    describe,
    near_misses,
    parameters_of,
)
from bilayer_sim_ros.node.parameters import NodeParameter

PACKAGE = "bilayer_sim_ros"


def node_description(executable: str, node_name: str, table: Sequence[NodeParameter]) -> LaunchDescription:
    """Return a description of one node of this package; arguments override what its file of parameters says.

    `node_name`: the default name. `table`: its parameters.
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
        read = [argument for parameter in table for argument, _ in arguments_of(parameter)]
        for text in near_misses([*NODE_ARGUMENTS, *read], given):
            get_logger(PACKAGE).warning(text)
        try:
            values = parameters_of(table, given)
        except InputError as error:
            raise RuntimeError(f"{executable}: {error}") from None
        return [
            Node(
                package=PACKAGE,
                executable=executable,
                name=given["name"],
                namespace=given["namespace"],
                parameters=[given["params_file"]] if given["params_file"] else [],
                # On the command line, where they go before the file; JSON is YAML.
                ros_arguments=[
                    word
                    for name, value in values.items()
                    for word in ("-p", f"{name}:={json.dumps(value, ensure_ascii=False)}")
                ],
                output="screen",
                emulate_tty=True,
            )
        ]

    return LaunchDescription([*arguments.values(), OpaqueFunction(function=node)])
