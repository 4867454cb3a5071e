"""Programs in processes that fork from one which has imported the packages: a node starts in 0.3 s of CPU, not 2 s."""

import os
import sys
from multiprocessing import get_context
from pathlib import Path

IMPORTED = [
    "bilayer_core.log.file.mcap_log",
    "bilayer_core.simulation.simulator",
    "bilayer_sim_ros.node.graph_watch",
    "bilayer_sim_ros.replay.log_replay",
    "bilayer_sim_ros.simulation_node",
]
"""Modules that take long to import; none of them starts a thread or makes a node."""


def start(program: str, arguments: list[str], domain: int, directory: Path, output: Path):
    """Start ``python -c program`` with arguments, as a process of `multiprocessing`; what it prints goes to a file."""
    context = get_context("forkserver")
    context.set_forkserver_preload(IMPORTED)
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    process = context.Process(target=_run, args=(program, arguments, environment, directory, output))
    process.start()
    return process


def _run(program, arguments, environment, directory, output):
    file = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for descriptor in (1, 2):
        os.dup2(file, descriptor)
    os.chdir(directory)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["-c", *arguments]
    exec(compile(program, "<string>", "exec"), {"__name__": "__main__"})
