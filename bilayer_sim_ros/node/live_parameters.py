"""Parameters that change what a running node does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.parameters import NodeParameter, Value


class LiveParameters:
    """Has what a parameter is set to done, and refuses with the reason what cannot be done.

    `changes`: name of a live parameter -> what asks for a new value, and returns the future of what came of it, which
    must not need the node's executor.
    """

    def __init__(self, node: Node, table: Sequence[NodeParameter], changes: Mapping[str, Callable[[Value], Future]]):
        self._node = node
        self._table = {parameter.name: parameter for parameter in table}
        self._changes = changes
        self._showing = False
        node.add_on_set_parameters_callback(self._change)

    def show(self, values: Mapping[str, Value]) -> None:
        """Let parameters say what there is; called in the executor's thread."""
        parameters = [
            Parameter(name, value=value)
            for name, value in values.items()
            if self._node.get_parameter(name).value != value
        ]
        self._showing = True
        try:
            self._node.set_parameters(parameters)
        finally:
            self._showing = False

    def _change(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        if self._showing:
            return SetParametersResult(successful=True)
        try:
            wished = [
                (self._changes[parameter.name], self._table[parameter.name].accept(parameter.value))
                for parameter in parameters
                if parameter.name in self._changes
            ]
            for change, value in wished:
                change(value).result()
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)
