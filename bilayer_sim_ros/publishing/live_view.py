"""``rerun: serve``: the viewers' server and who feeds it, in a process beside the node, which never waits for it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import Protocol

from rclpy.node import Node

from bilayer_core.errors import InputError
from bilayer_core.view.rerun_view import require_rerun
from bilayer_sim_ros.node.parameters import Value

SERVE = "serve"
"""Value of the parameter ``rerun``."""
FOLLOWER = "bilayer_sim_ros.follower"
READY = "following"
"""How the line begins that the follower prints once frames reach it."""
START_LIMIT = 30.0
"""Longest wait for that before the simulation begins [s]; its beginning is then not shown."""
EXIT_LIMIT = 10.0
"""Longest wait for the process to end before it is killed [s]."""
_LOOK = 0.05
"""Between two looks whether it is there [s]."""


class Viewers(Protocol):
    """Viewers of the run while it goes on."""

    def wait(self, stop: threading.Event, seen: Callable[[], bool]) -> None:
        """Return once the first frame would be `seen`, or the node is to end."""

    def end(self) -> None:
        """Note that the run is over."""


class Nobody:
    """No live view was asked for."""

    def wait(self, stop: threading.Event, seen: Callable[[], bool]) -> None:
        """Return at once."""

    def end(self) -> None:
        """Do nothing."""


def live_view(node: Node, parameters: Mapping[str, Value]) -> Viewers:
    """Return the live view that the parameters select.

    Raises InputError if rerun is not installed, or the port is not valid.
    """
    if parameters["rerun"] != SERVE:
        return Nobody()
    require_rerun()
    port = parameters["rerun_port"]
    if port != int(port) or port > 65535:
        raise InputError(f"parameter 'rerun_port' is {port!r}; allowed is a whole number from 0 to 65535")
    return LiveView(node, str(parameters["rerun_bind"]), int(port))


class LiveView:
    """A follower of the node as a process of its own.

    It is served at a lower priority than the simulation, hears of frames by a lossy topic, and ends when the node does,
    however that ends. If it ends before, the node says so once and goes on. `port`: 0 for the first free one.
    """

    def __init__(self, node: Node, bind: str, port: int):
        self._logger = node.get_logger()
        command = [sys.executable, "-m", FOLLOWER, f"--node={node.get_fully_qualified_name()}", "--serve"]
        command += [f"--bind={bind}", "--beside-node"] + ([f"--port={port}"] if port else [])
        self._ready = threading.Event()
        self._ending, self._said = False, ""
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,  # its end tells the process that the node is gone
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "ROS_DOMAIN_ID": str(node.context.get_domain_id())},
            start_new_session=True,  # Ctrl-C is for the node, which ends it
        )
        self._listener = threading.Thread(target=self._listen, name="live view", daemon=True)
        self._listener.start()

    def wait(self, stop: threading.Event, seen: Callable[[], bool]) -> None:
        """Return once the first frame would be `seen`, or nobody is there to see it.

        Raises InputError if it cannot be served where it was asked for.
        """
        deadline = time.monotonic() + START_LIMIT
        while not (self._ready.is_set() and seen()) and not stop.wait(_LOOK):
            if self._process.poll() is not None:
                self._listener.join(EXIT_LIMIT)
                if self._process.returncode == InputError.exit_code:
                    raise InputError(f"rerun: {SERVE}: {self._said.removeprefix('bilayer: ')}")
                return
            if time.monotonic() > deadline:
                self._logger.warning(f"the live view has not begun for {START_LIMIT:g} s; the simulation begins")
                return

    def end(self) -> None:
        """End the process."""
        self._ending = True
        self._process.stdin.close()
        try:
            self._process.wait(EXIT_LIMIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listener.join(EXIT_LIMIT)

    def _listen(self) -> None:
        """Repeat what it says, until it ends."""
        for line in self._process.stdout:
            self._said = line.rstrip()
            self._logger.info(f"live view: {self._said}")
            if line.startswith(READY):
                self._ready.set()
        code = self._process.wait()
        if not self._ending and code != InputError.exit_code:  # which `wait` tells
            self._logger.error(f"the live view has ended with exit code {code}; the simulation goes on without it")
