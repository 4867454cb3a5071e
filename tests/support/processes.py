"""Python and the command line in processes of their own."""

import os
import random
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
TIMEOUT = 240
"""Longest time that a command may take, compilation of all kernels included [s]."""

# A test holds the TCP port of its ROS domain's number above this one.
FIRST_LOCK_PORT = 21000


@contextmanager
def claimed_domain():
    """A ROS domain that no other test of this machine uses, those of other test runs included."""
    for domain in random.sample(range(1, 101), 100):
        with socket.socket() as lock:
            try:
                lock.bind(("127.0.0.1", FIRST_LOCK_PORT + domain))
            except OSError:
                continue
            yield domain
            return
    raise RuntimeError("all ROS domains are in use by tests")


def environment() -> dict[str, str]:
    """Environment in which this checkout is imported."""
    return {**os.environ, "PYTHONPATH": f"{TESTS.parent}{os.pathsep}{TESTS}"}


def command(*arguments) -> list[str]:
    """The command ``bilayer`` with arguments."""
    return [sys.executable, "-m", "bilayer_core", *map(str, arguments)]


def python(program: str) -> str:
    """What a program prints."""
    run = [sys.executable, "-c", program]
    return subprocess.run(
        run, env=environment(), capture_output=True, text=True, check=True, timeout=TIMEOUT
    ).stdout.strip()


def bilayer(*arguments) -> subprocess.CompletedProcess:
    """Run ``bilayer`` to its end."""
    return subprocess.run(command(*arguments), env=environment(), capture_output=True, text=True, timeout=TIMEOUT)
