"""Common parts of all executables of the package: command line, signals, exit codes."""

from __future__ import annotations

import argparse
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from bilayer_core.errors import BilayerError, InputError
from bilayer_sim_ros.node.configured_node import ConfiguredNode
from bilayer_sim_ros.node.parameters import NodeParameter, Value
from bilayer_sim_ros.node.signals import Signals, Stop
from bilayer_sim_ros.node.unread_arguments import refuse_bare_parameters, unread_arguments

SomeNode = TypeVar("SomeNode", bound=Node)
Make = Callable[[Mapping[str, Value]], SomeNode]
Work = Callable[[SomeNode, Stop], None]
Task = Callable[[Node, Mapping[str, Value], Stop], None]


def run(
    signals: Signals,
    executable: str,
    table: Sequence[NodeParameter],
    make: Make[SomeNode],
    work: Work[SomeNode],
    argv: list[str] | None,
    *,
    argument: str | None = None,
) -> int:
    """Run one node as a ROS 2 executable.

    `make(given)` makes the node, with what was given on the command line beside its ROS part. `work(node, stop)` runs
    on the main thread, beside an executor that serves the node's topics and services; it returns when it is done, or
    soon after `stop` is set. The parameter that is called `argument` may be given without its name.

    Returns 0 when done, also after SIGINT or SIGTERM, which are how nodes end; 2 bad input; 3 the simulation could not
    go on, or its log is not whole.
    """
    stop = signals.take()
    argv = sys.argv if argv is None else [executable, *argv]
    try:
        refuse_bare_parameters(argv, [parameter.name for parameter in table])
        arguments = remove_ros_args(argv)[1:]
    except InputError as error:
        print(f"{executable}: {error}", file=sys.stderr)
        return InputError.exit_code
    except RuntimeError as error:
        print(f"{executable}: {_not_understood(error)}", file=sys.stderr)
        return InputError.exit_code
    options = _parse(executable, table, arguments, argument)
    given = {argument: options.argument} if argument is not None and options.argument is not None else {}
    try:
        _run_node(signals, table, make, work, stop, argv, given)
    except BilayerError as error:
        if options.debug:
            raise
        print(f"{executable}: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def run_task(
    signals: Signals,
    executable: str,
    node_name: str,
    table: Sequence[NodeParameter],
    task: Task,
    argv: list[str] | None,
    *,
    argument: str | None = None,
) -> int:
    """Run `task(node, parameters, stop)` as a ROS 2 executable, with a node that has no life of its own; see `run`."""

    def make(given: Mapping[str, Value]) -> ConfiguredNode:
        return ConfiguredNode(node_name, table, given, argv)

    def work(node: ConfiguredNode, stop: Stop) -> None:
        task(node, node.values, stop)
        if stop.reason:
            node.get_logger().info(stop.reason)

    return run(signals, executable, table, make, work, argv, argument=argument)


def leave(code: int) -> None:
    """End the process at once, with all that was printed: for threads that cannot be ended, as the compiler's."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _parse(
    executable: str, table: Sequence[NodeParameter], arguments: list[str], argument: str | None
) -> argparse.Namespace:
    """Parse the command line without its ROS part; refuse unknown arguments."""
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
    signals: Signals,
    table: Sequence[NodeParameter],
    make: Make[SomeNode],
    work: Work[SomeNode],
    stop: Stop,
    argv: list[str],
    given: Mapping[str, Value],
) -> None:
    try:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise _not_understood(error) from error
    executor = SingleThreadedExecutor()
    ended = Future()
    thread = threading.Thread(target=_spin, args=(executor, ended), name="executor", daemon=True)
    try:
        node = make(given)
        for text in unread_arguments(argv, node.get_fully_qualified_name(), [parameter.name for parameter in table]):
            node.get_logger().warning(text)
        executor.add_node(node)
        thread.start()
        work(node, stop)
    finally:
        signals.end()
        ended.set_result(None)
        if thread.ident is not None:
            thread.join()  # a context that is shut down under an executor makes it raise where it is about to wait
        rclpy.try_shutdown()


def _not_understood(error: RuntimeError) -> InputError:
    """Return an error with rclpy's complaint about its arguments, without the places in its sources."""
    reason = str(error).partition(", at ")[0].removeprefix("Failed to parse ROS arguments: ")
    return InputError(f"ROS arguments are not understood: {reason}")


def _spin(executor: SingleThreadedExecutor, ended: Future) -> None:
    try:
        executor.spin_until_future_complete(ended)
    except ExternalShutdownException:
        return
