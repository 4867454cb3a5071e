"""A node with the parameters of a table, each checked, typed and described."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node

from bilayer_core.errors import InputError
from bilayer_sim_ros.parameters import NodeParameter, Value, accept_all


class ConfiguredNode(Node):
    """A node whose parameters are those of a table; mistyped names and bad values are refused.

    Parameters
    ----------
    node_name : str
    table : sequence of NodeParameter
    given : mapping, optional
        Values that were given in another way than as parameters.
    **of_node
        As for `rclpy.node.Node`.

    Attributes
    ----------
    values : dict
        Value of each parameter at the start, by its name.

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
        **of_node: Any,
    ):
        try:
            super().__init__(node_name, automatically_declare_parameters_from_overrides=True, **of_node)
        except ValueError as error:  # "Cannot declare a statically typed parameter ... of type PARAMETER_NOT_SET"
            raise InputError(
                'a parameter has no value: allowed is one of its type, and [""] for a list of nothing'
            ) from error
        try:
            self.values = declare(self, table, given)
        except InputError:
            self.destroy_node()
            raise


def declare(node: Node, table: Sequence[NodeParameter], given: Mapping[str, Value] | None = None) -> dict[str, Value]:
    """Declare the parameters in `table`; their values, with those that were `given` in another way.

    The node has declared overrides by itself, so that a mistyped name is seen. They are declared anew, with their
    types: an integer will do for a number. Parameters that are not live are read at the start only.
    """
    given = given or {}
    overrides = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
    for name in given.keys() & overrides.keys():
        raise InputError(f"'{name}' is given twice: {given[name]!r}, and as a parameter {overrides[name]!r}")
    values = accept_all(table, {**overrides, **given})
    for parameter in table:
        if node.has_parameter(parameter.name):
            node.undeclare_parameter(parameter.name)
        node.declare_parameter(parameter.name, values[parameter.name], descriptor_of(parameter), ignore_override=True)
    return values


def descriptor_of(parameter: NodeParameter) -> ParameterDescriptor:
    """What tools show of a parameter, and what the node refuses by itself.

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
    """The range of a number that has a least one, which the default keeps to as well; that of others is in words."""
    has_least = isinstance(parameter.default, float) and -math.inf < parameter.minimum <= parameter.default
    if not has_least or parameter.above_minimum:
        return []
    return [FloatingPointRange(from_value=parameter.minimum, to_value=sys.float_info.max)]
