"""A sweep of short runs, and programs of Dask's."""

import json
import os
import subprocess
import sys
import time

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
    """End programs of Dask at once: a worker whose scheduler is busy may take long over its farewell."""
    for process in processes:
        process.kill()
    for process in processes:
        process.wait(60)


def await_workers(address, count=1):
    """Wait until workers have joined a scheduler; a sweep waits for them no longer than a user would."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=120)


def start_scheduler(file, *options):
    """A scheduler that writes its address into a file."""
    quiet = "--port", "0", "--no-dashboard", "--scheduler-file", str(file)
    return dask("scheduler", "--host", "127.0.0.1", *quiet, *options)


def start_worker(address, folder, *options, **environment):
    """A worker that nothing watches, with one thread."""
    quiet = "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder)
    return dask("worker", address, *quiet, *options, **environment)


def address_in(file):
    """The address in that file, once it is there."""

    def address():
        try:
            return json.loads(file.read_text())["address"]
        except (OSError, ValueError):
            return None

    return wait_until(address)
