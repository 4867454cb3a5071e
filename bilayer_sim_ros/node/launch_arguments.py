"""Parameters of a node as arguments of a launch file, whose values are texts; nothing of `launch` is imported here."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import yaml

from bilayer_sim_ros.node.near_misses import nearest
from bilayer_sim_ros.node.parameters import NodeParameter, Value

NODE_ARGUMENTS = {
    "name": "name of the node",
    "namespace": "namespace of the node",
    "params_file": "file of parameters, such as config/sim_node.yaml; arguments that are not empty override it",
}
"""Arguments that are no parameters."""
RENAMED = {"play.clock_publish_frequency": "clock"}
"""Parameters whose argument has another name."""
PREFIX = "play."
"""Left out of the names of arguments."""


def argument_name(parameter: NodeParameter) -> str:
    """Return the name of the argument for a parameter."""
    return RENAMED.get(parameter.name, parameter.name.removeprefix(PREFIX))


def describe(parameter: NodeParameter) -> str:
    """Return the text that `ros2 launch --show-args` shows for the argument of a parameter."""
    default = parameter.default
    shown = ", ".join(default) if isinstance(default, list) else str(default)
    shown = shown.lower() if isinstance(default, bool) else shown or "none"
    return f"{parameter.description} [{parameter.allowed}; default: {shown}]"


def parameters_of(table: Iterable[NodeParameter], given: Mapping[str, str]) -> dict[str, Value]:
    """Return the values of parameters whose arguments are not empty.

    `given`: text of each argument. Raises InputError for a text that says no value of the parameter's type.
    """
    texts = [
        (name, parameter, given.get(argument, "")) for parameter in table for argument, name in arguments_of(parameter)
    ]
    return {name: value_of(parameter, text) for name, parameter, text in texts if text}


def arguments_of(parameter: NodeParameter) -> list[tuple[str, str]]:
    """Return the names of arguments for a parameter, each with the name by which the node gets it: also a former one,
    of which the node warns.
    """
    former = [(parameter.formerly, parameter.formerly)] if parameter.formerly else []
    return [(argument_name(parameter), parameter.name), *former]


def value_of(parameter: NodeParameter, text: str) -> Value:
    """Return a text as a value of a parameter; a list is ``[a, b]`` or ``a, b``."""
    if isinstance(parameter.default, str):
        return parameter.accept(text)
    try:
        if isinstance(parameter.default, list):
            listed = text.lstrip().startswith("[")
            value = yaml.safe_load(text) if listed else [part.strip() for part in text.split(",")]
        elif isinstance(parameter.default, bool):
            value = {"true": True, "false": False}[text.lower()]
        else:
            value = float(text)
    except (ValueError, KeyError, yaml.YAMLError):
        value = text
    return parameter.accept(value)


def near_misses(declared: Collection[str], given: Iterable[str]) -> list[str]:
    """Return a warning for each argument that is not declared but nearly named like one that is.

    Other files of a launch have arguments of their own.
    """
    meant = {name: nearest(name, declared) for name in given if name not in declared}
    return [f"launch argument '{name}' is not read: did you mean '{close}'?" for name, close in meant.items() if close]
