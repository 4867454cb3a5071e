"""A node with the parameters of a table, each checked, typed and described."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.parameters import NodeParameter, Value, accept_all
from bilayer_sim_ros.node.ros_arguments import Given, given_parameters, in_order


class ConfiguredNode(Node):
    """A node whose parameters are those of a table; mistyped names and bad values are refused.

    A value on the command line goes before those in parameter files, in whichever order and with whichever type they
    are given; values in code (`parameter_overrides`) go before both.

    Parameters
    ----------
    node_name : str
    table : sequence of NodeParameter
    given : mapping, optional
        Values that were given in another way than as parameters.
    arguments : sequence of str, optional
        What `rclpy.init` got; by default the command line of the process, as for `rclpy.init`.
    **of_node
        As for `rclpy.node.Node`.

    Raises
    ------
    InputError
        For a name that the table does not have, and for a value that is not allowed.
    """

    def __init__(
        self,
        node_name: str,
        table: Sequence[NodeParameter],
        given: Mapping[str, Value] | None = None,
        arguments: Sequence[str] | None = None,
        **of_node: Any,
    ):
        try:
            super().__init__(node_name, automatically_declare_parameters_from_overrides=True, **of_node)
        except ValueError as error:  # "Cannot declare a statically typed parameter ... of type PARAMETER_NOT_SET"
            raise InputError(
                'a parameter has no value: allowed is one of its type, and [""] for a list of nothing'
            ) from error
        of_process = sys.argv if arguments is None else arguments
        sources = [
            given_parameters(of_process if of_node.get("use_global_arguments", True) else ()),
            given_parameters(of_node.get("cli_args") or ()),
        ]
        in_code = {parameter.name for parameter in of_node.get("parameter_overrides") or ()}
        try:
            overrides = overrides_of(self, table, sources, in_code)
            self.values = declare(self, table, overrides, given)  # Value of each parameter at the start, by its name
        except InputError:
            self.destroy_node()
            raise


def overrides_of(
    node: Node, table: Sequence[NodeParameter], sources: Sequence[Sequence[Given]], in_code: Collection[str]
) -> dict[str, Any]:
    """Return the values that a node was given, by the present names of parameters; warns of former names.

    Parameters
    ----------
    node : Node
        Has declared its overrides by itself.
    table : sequence of NodeParameter
    sources : sequence of sequence of Given
        What arguments say; later ones go before earlier ones.
    in_code : collection of str
        Names of parameters that the program itself sets.

    Raises
    ------
    InputError
        For a parameter that is given by both of its names.
    """
    present = {parameter.formerly: parameter.name for parameter in table if parameter.formerly}
    several: dict[str, list[Given]] = {}
    for source in sources:
        renamed = (replace(given, name=present.get(given.name, given.name)) for given in source)
        for name, values in in_order(renamed, node.get_fully_qualified_name()).items():
            several.setdefault(name, []).extend(values)
    overrides: dict[str, Any] = {}
    for given_name, parameter in node.get_parameters_by_prefix("").items():
        name, value = present.get(given_name, given_name), parameter.value
        candidates = [given.value for given in several.get(name, ())]
        if len(candidates) > 1 and given_name not in in_code and value in candidates:
            value = candidates[-1]
        elif name in overrides:
            former = next(old for old, new in present.items() if new == name)
            both = f"{overrides[name]!r} and {value!r}, one of them by the former name '{former}'"
            raise InputError(f"parameter '{name}' is given twice: {both}; leave one out")
        overrides[name] = value
        if given_name in present:
            node.undeclare_parameter(given_name)
            text = f"parameter '{given_name}' is now called '{name}'; the old name works at the start only"
            node.get_logger().warning(text)
    return overrides


def declare(
    node: Node, table: Sequence[NodeParameter], overrides: Mapping[str, Any], given: Mapping[str, Value] | None = None
) -> dict[str, Value]:
    """Declare the parameters in `table`, and return their values with those that were `given` in another way.

    The node has declared its overrides by itself, which shows mistyped names. They are declared again with their types:
    an integer will do for a number. Parameters that are not live are read at the start only.
    """
    given = given or {}
    for name in given.keys() & overrides.keys():
        raise InputError(f"'{name}' is given twice: {given[name]!r}, and as a parameter {overrides[name]!r}")
    values = accept_all(table, {**overrides, **given})
    for parameter in table:
        if node.has_parameter(parameter.name):
            node.undeclare_parameter(parameter.name)
        node.declare_parameter(parameter.name, values[parameter.name], descriptor_of(parameter), ignore_override=True)
    return values


def descriptor_of(parameter: NodeParameter) -> ParameterDescriptor:
    """Return the description of a parameter for tools, with the limits that the node enforces by itself.

    A live number is typed dynamically: its first value says that it is a number, and an integer will do later too.
    """
    return ParameterDescriptor(
        description=parameter.description,
        additional_constraints=parameter.allowed,
        read_only=not parameter.live,
        dynamic_typing=parameter.live,
        floating_point_range=_range_of(parameter),
    )


def _range_of(parameter: NodeParameter) -> list[FloatingPointRange]:
    """Return the range of a number that has a minimum which its default meets; the range of others is in words."""
    has_least = isinstance(parameter.default, float) and -math.inf < parameter.minimum <= parameter.default
    if not has_least or parameter.above_minimum:
        return []
    return [FloatingPointRange(from_value=parameter.minimum, to_value=sys.float_info.max)]
