"""Programs that end with the process that started them."""

import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest
from support.processes import environment

from bilayer_core.view.bound_process import EXIT_LIMIT, BoundProcess

SLEEP = [sys.executable, "-c", "import time; print('up', flush=True); time.sleep(600)"]
DEAF = [sys.executable, "-c", f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); exec({SLEEP[2]!r})"]
PARENT = f"""
import os, time
from bilayer_core.view.bound_process import BoundProcess
process = BoundProcess({SLEEP}, dict(os.environ))
while not process.said():
    time.sleep(0.01)
print("up", flush=True)
time.sleep(600)
"""


def started(command):
    """A program that has begun."""
    process = BoundProcess(command, environment())
    deadline = time.monotonic() + 60
    while not process.said():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return process


def test_a_program_ends_with_the_process_that_started_it():
    with subprocess.Popen([sys.executable, "-c", PARENT], env=environment(), stdout=subprocess.PIPE) as parent:
        assert parent.stdout.readline() == b"up\n"
        below = psutil.Process(parent.pid).children(recursive=True)
        assert SLEEP in [process.cmdline() for process in below]
        parent.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + 10
    while any(process.is_running() and process.status() != psutil.STATUS_ZOMBIE for process in below):
        assert time.monotonic() < deadline, "the program is an orphan"
        time.sleep(0.05)


def test_a_program_outlives_the_thread_that_started_it():
    found = []
    thread = threading.Thread(target=lambda: found.append(started(SLEEP)))
    thread.start()
    thread.join()
    time.sleep(0.2)
    assert found[0].exit_code is None
    found[0].end()
    assert found[0].exit_code not in (None, 0)


def test_a_program_that_ends_by_itself_leaves_its_exit_code_and_what_it_said():
    process = started([sys.executable, "-c", "print('no port is free', flush=True); raise SystemExit(3)"])
    deadline = time.monotonic() + 60
    while process.exit_code is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert (process.exit_code, process.said()) == (3, "no port is free")
    process.end()


@pytest.mark.slow
def test_a_program_that_does_not_end_when_it_is_asked_to_is_killed():
    process = started(DEAF)
    begin = time.monotonic()
    process.end()
    assert process.exit_code is not None
    assert EXIT_LIMIT <= time.monotonic() - begin < EXIT_LIMIT + 10
