"""A real scheduler and two worker processes on loopback, for all tests of this folder."""

import json
import os
import subprocess
import sys
import time

import pytest

STRIP = {
    "schema": 1,
    "scene": "bending",
    "set": {"duration": "0.3 s"},
    "parameters": {
        "gain": {"path": "rods.strip.layers.active.eigenstrain.gain", "from": "0.5 %", "to": "2 %", "count": 4},
        "length": {"path": "rods.strip.path.length", "values": ["80 mm", "100 mm"]},
    },
    "metrics": {"curvature": "max_curvature", "height": {"quantity": "com.z", "take": "largest_magnitude"}},
}


@pytest.fixture
def strip():
    """Content of a sweep of eight short runs."""
    return json.loads(json.dumps(STRIP))


def dask(*arguments, **environment):
    """A program of Dask's, whose output goes nowhere."""
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"} | environment,
    )


def wait_until(what, seconds=60.0):
    """Wait until a function gives something true; what it gave."""
    end = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < end, "it did not come about"
        time.sleep(0.02)
    return found


def end(processes):
    """End programs, and wait for them."""
    for process in processes:
        process.terminate()
    for process in processes:
        process.wait(20)


@pytest.fixture(scope="session")
def scheduler(tmp_path_factory):
    """Address of a scheduler that has no workers yet."""
    file = tmp_path_factory.mktemp("dask") / "scheduler.json"
    process = dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))

    def address():
        try:
            return json.loads(file.read_text())["address"]
        except (OSError, ValueError):
            return None

    yield wait_until(address)
    end([process])


@pytest.fixture(scope="session")
def cluster(scheduler, tmp_path_factory):
    """Address of that scheduler, with two worker processes."""
    folder = str(tmp_path_factory.mktemp("workers"))
    options = "--nthreads", "1", "--no-dashboard", "--local-directory", folder, "--host", "127.0.0.1"
    workers = [dask("worker", scheduler, *options) for _ in range(2)]
    from distributed import Client

    with Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    yield scheduler
    end(workers)
