"""Python and the command line in processes of their own."""

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parent
TIMEOUT = 240
"""Longest time that a command may take, compilation of all kernels included [s]."""


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
