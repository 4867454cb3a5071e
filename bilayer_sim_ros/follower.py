"""``bilayer view --follow``: shows what a simulation node publishes, in rerun, as a node of its own."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path

from bilayer_core.errors import BilayerError, InputError
from bilayer_sim_ros.node.signals import Stop
from bilayer_sim_ros.node.without_ros import explain_missing_ros

PERIOD = 0.1
"""Between two times at which what has come is shown [s]."""
PATIENCE = 10.0
"""After which it is said that there is no such node [s]."""
DEPTH = 200
"""Frames that wait while something is drawn."""
NICENESS = 10
"""Of a follower beside a node: the simulation comes first."""

STANDARD_INPUT = 0
"""Its descriptor."""


def main(argv: list[str] | None = None) -> int:
    """Follow until a signal comes or the window is closed; the exit code."""
    options = _parse(sys.argv[1:] if argv is None else argv)
    stop = Stop()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    if options.beside_node:
        os.nice(NICENESS)
        threading.Thread(target=_wait_for_the_end, args=(stop,), daemon=True).start()
    try:
        _follow(options, stop)
    except ModuleNotFoundError as error:
        return explain_missing_ros("bilayer view --follow", error)
    except BilayerError as error:
        if options.debug:
            raise
        print(f"bilayer: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bilayer view --follow", allow_abbrev=False)
    parser.add_argument("--node", default="/bilayer_sim")
    parser.add_argument("--bind", default="127.0.0.1")
    parser.add_argument("--port", type=int)
    parser.add_argument("--save", type=Path)
    parser.add_argument("--colour", default="strain")
    for flag in ("--serve", "--web", "--debug"):
        parser.add_argument(flag, action="store_true")
    parser.add_argument("--beside-node", action="store_true", help="end with the standard input")
    return parser.parse_args(arguments)


def _wait_for_the_end(stop: Stop) -> None:
    """Wait until the node closes the standard input, of which it holds the other end, then stop."""
    while os.read(STANDARD_INPUT, 1024):  # past Python's buffer, which would be in use where the program ends
        pass
    stop.set()


def _follow(options: argparse.Namespace, stop: Stop) -> None:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions

    from bilayer_core.view.follow import Serving, open_for
    from bilayer_core.view.rerun_view import require_rerun

    require_rerun()
    from bilayer_core.view.live import LiveView
    from bilayer_core.view.server import ViewServer

    serving = Serving(options.bind, options.port, not options.serve, options.web, options.save, options.colour)
    with ExitStack() as ending:
        server = ending.enter_context(ViewServer(serving.bind, serving.port))
        view = LiveView(server, serving.colour, serving.save)
        ending.callback(view.close)
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        ending.callback(rclpy.try_shutdown)
        listener = Listener(options.node, view)
        executor = SingleThreadedExecutor()
        executor.add_node(listener.node)
        ending.callback(executor.shutdown)
        window = open_for(server, serving, _say, ending)
        begun, told, there = time.monotonic(), False, False
        shown = 0.0
        while not stop.is_set() and (window is None or window.poll() is None):
            executor.spin_once(timeout_sec=PERIOD)
            now = time.monotonic()
            if now - shown >= PERIOD:
                view.show()
                shown = now
            if listener.connected != there:
                there = listener.connected
                if not there:  # what it sent may still wait to be taken
                    listener.take_the_rest(executor)
                    view.show()
                what = f"following {options.node}: {server.address}" if there else f"{options.node} has ended"
                _say(what if there else f"{what}; what it showed is served until Ctrl-C")
            if not there and not told and now - begun > PATIENCE:
                told = True
                _say(f"no node {options.node} publishes {listener.topic} yet; waiting for it until Ctrl-C")
        view.show()


def _say(line: str) -> None:
    print(line, flush=True)


class Listener:
    """Hands what a node publishes to a view.

    `name`: full name of the node. Raises InputError if there can be no node of this name.
    """

    def __init__(self, name: str, view):
        from rclpy.exceptions import InvalidTopicNameException
        from rclpy.node import Node
        from rclpy.qos import QoSProfile, ReliabilityPolicy
        from std_msgs.msg import String, UInt8MultiArray

        from bilayer_core.log.messages.topics import DESCRIPTION, LIVE
        from bilayer_sim_ros.publishing.live_topic import KEPT

        name = name if name.startswith("/") else f"/{name}"
        self.topic = LIVE.full_name(name)  # Full name of the topic of frames
        self._view, self._last, self._begun = view, -1, False
        self._description, self._taken = None, 0
        self.node = Node(f"bilayer_view_{os.getpid()}")
        try:
            self.node.create_subscription(String, DESCRIPTION.full_name(name), self._take_description, KEPT)
            lossy = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
            self._frames = self.node.create_subscription(UInt8MultiArray, self.topic, self._take_frame, lossy)
        except (InvalidTopicNameException, ValueError) as error:
            raise InputError(f"--node: {name!r} is no name of a node: {error}") from error

    @property
    def connected(self) -> bool:
        """True if the node publishes frames and the description of its run is known."""
        return self._description is not None and self._frames.get_publisher_count() > 0

    def take_the_rest(self, executor) -> None:
        """Take what has arrived, until nothing comes any more."""
        quiet_since = time.monotonic()
        while time.monotonic() - quiet_since < PERIOD:
            before = self._taken
            executor.spin_once(timeout_sec=PERIOD / 2)
            if self._taken > before:
                quiet_since = time.monotonic()

    def _take_description(self, message) -> None:
        from bilayer_core.log.messages.description_text import from_json

        description = from_json(message.data)
        self._description, self._begun = description, False

    def _take_frame(self, message) -> None:
        from bilayer_core.log.messages.packing import unpack

        self._taken += 1
        if self._description is None:
            return  # it is on its way
        parts = unpack(message.layout.dim[0].label if message.layout.dim else "", bytes(message.data))
        stamp = _time_of(dict(parts))
        if not self._begun or stamp < self._last:
            self._view.show()
            self._view.begin(self._description)
            self._begun = True
        self._last = stamp
        for topic, data in parts:
            self._view.add(topic, stamp, data)


def _time_of(parts: dict[str, bytes]) -> int:
    """Return the time of a frame [ns], from the /clock among its messages."""
    from rclpy.serialization import deserialize_message
    from rosgraph_msgs.msg import Clock

    if "/clock" not in parts:
        raise InputError("a frame says no time: it is of another version")
    clock = deserialize_message(parts["/clock"], Clock).clock
    return clock.sec * 1_000_000_000 + clock.nanosec


if __name__ == "__main__":
    sys.exit(main())
