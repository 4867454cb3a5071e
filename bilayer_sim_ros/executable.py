"""What all executables of the package share: command line, parameters, signals, exit codes."""

from __future__ import annotations

import argparse
import math
import signal
import sys
import threading
from collections.abc import Callable, Mapping, Sequence

import rclpy
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from bilayer_core.errors import BilayerError, InputError
from bilayer_sim_ros.parameters import NodeParameter, Value, accept_all

Work = Callable[[Node, Mapping[str, Value], threading.Event], None]


def run(
    executable: str,
    node_name: str,
    table: Sequence[NodeParameter],
    work: Work,
    argv: list[str] | None,
    *,
    argument: str | None = None,
) -> int:
    """Run `work` as a ROS 2 executable.

    `work(node, parameters, stop)` runs on the main thread, beside an executor that serves the node's topics and
    services; it returns when it is done, or soon after `stop` is set. Signals only set `stop`, however many come.
    The parameter that is called `argument` may be given without its name.

    Returns
    -------
    int
        0 done, also after SIGINT or SIGTERM, which are how nodes end; 2 bad input; 3 the simulation could not go on, or
        its log is not whole.
    """
    argv = sys.argv if argv is None else [executable, *argv]
    try:
        arguments = remove_ros_args(argv)[1:]
    except RuntimeError as error:
        print(f"{executable}: {_not_understood(error)}", file=sys.stderr)
        return InputError.exit_code
    options = _parse(executable, table, arguments, argument)
    given = {argument: options.argument} if argument is not None and options.argument is not None else {}
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    try:
        _run_node(node_name, table, work, stop, argv, given)
    except BilayerError as error:
        if options.debug:
            raise
        print(f"{executable}: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def _parse(
    executable: str, table: Sequence[NodeParameter], arguments: list[str], argument: str | None
) -> argparse.Namespace:
    """The command line without its ROS part; refuses arguments that nobody would read."""
    width = max(18, *(len(parameter.name) for parameter in table)) + 2
    lines = [f"  {p.name:{width}}{p.description} (default: {p.default!r})" for p in table]
    taken = f"[{argument.upper()}] " if argument else ""
    parser = argparse.ArgumentParser(
        prog=executable,
        usage=f"{executable} {taken}[--debug] [--ros-args -p NAME:=VALUE ... --params-file FILE]",
        epilog="parameters:\n" + "\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    if argument:
        (parameter,) = (parameter for parameter in table if parameter.name == argument)
        parser.add_argument("argument", metavar=argument.upper(), nargs="?", help=parameter.description)
    parser.add_argument("--debug", action="store_true", help="show where an error comes from")
    return parser.parse_args(arguments)


def _run_node(
    name: str,
    table: Sequence[NodeParameter],
    work: Work,
    stop: threading.Event,
    argv: list[str],
    given: Mapping[str, str],
) -> None:
    try:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise _not_understood(error) from error
    executor = SingleThreadedExecutor()
    thread = threading.Thread(target=_spin, args=(executor,), name="executor", daemon=True)
    try:
        try:
            node = Node(name, automatically_declare_parameters_from_overrides=True)
        except ValueError as error:  # "Cannot declare a statically typed parameter ... of type PARAMETER_NOT_SET"
            raise InputError(
                'a parameter has no value: allowed is one of its type, and [""] for a list of nothing'
            ) from error
        values = declare(node, table, given)
        executor.add_node(node)
        thread.start()
        work(node, values, stop)
    finally:
        rclpy.try_shutdown()
        if thread.ident is not None:
            thread.join()


def _not_understood(error: RuntimeError) -> InputError:
    """What rclpy says of its arguments, without the places in its sources."""
    reason = str(error).partition(", at ")[0].removeprefix("Failed to parse ROS arguments: ")
    return InputError(f"ROS arguments are not understood: {reason}")


def _spin(executor: SingleThreadedExecutor) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


def declare(node: Node, table: Sequence[NodeParameter], given: Mapping[str, str] | None = None) -> dict[str, Value]:
    """Declare the parameters in `table`; their values, with those that were `given` in another way.

    The node declares overrides by itself, so that a mistyped name is seen; the others are declared here.
    Parameters that are not live are read at the start only, and an integer will do for a number.
    """
    given = given or {}
    overrides = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
    for name in given.keys() & overrides.keys():
        raise InputError(f"'{name}' is given twice: {given[name]!r}, and as a parameter {overrides[name]!r}")
    values = accept_all(table, {**overrides, **given})
    for parameter in table:
        descriptor = ParameterDescriptor(
            description=parameter.description,
            additional_constraints=parameter.allowed,
            read_only=not parameter.live,
            dynamic_typing=True,
            floating_point_range=_range_of(parameter),
        )
        if node.has_parameter(parameter.name):
            node.set_descriptor(parameter.name, descriptor)
        else:
            node.declare_parameter(parameter.name, values[parameter.name], descriptor)
    return values


def _range_of(parameter: NodeParameter) -> list[FloatingPointRange]:
    """The range of a number that has one with a first value; tools show it."""
    if not isinstance(parameter.default, float) or math.isinf(parameter.minimum) or parameter.above_minimum:
        return []
    if parameter.default < parameter.minimum:
        return []
    return [FloatingPointRange(from_value=parameter.minimum, to_value=sys.float_info.max)]
