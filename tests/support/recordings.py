"""What rerun recordings hold, read by rerun's own reader."""

import signal
import subprocess
import time
import warnings
from collections import defaultdict

import numpy as np
import psutil

LIMIT = 60.0
"""Longest wait for a viewer to start, or to end [s]."""
EMPTY = 1000
"""A recording without data is smaller [B]."""


def times_of(path) -> dict[str, np.ndarray]:
    """Times of the rows of each entity that changes [s], in order."""
    from rerun.chunk import RrdReader

    found = defaultdict(list)
    for chunk in RrdReader(path).stream():
        if not chunk.is_static:
            assert chunk.timeline_names == ["sim_time"], chunk.entity_path
            assert chunk.num_rows > 0, f"{chunk.entity_path}: a viewer ends where it meets a part without rows"
            column = chunk.to_record_batch().column("sim_time").cast("int64")
            found[chunk.entity_path] += column.to_pylist()
    return {entity: np.sort(np.array(times)) * 1e-9 for entity, times in found.items()}


def seen_late(address, path, seconds) -> dict[str, np.ndarray]:
    """The same of what a viewer gets that connects now and stays for some time from the first data on, in a file that
    it writes.
    """
    from bilayer_core.view.viewer_process import viewer_environment, viewer_executable

    command = [viewer_executable(), address, "--save", path, "--bind", "127.0.0.1", "--port", "auto"]
    viewer = subprocess.Popen(
        command,
        env=viewer_environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored in what shells run in the background
    )
    try:
        deadline = time.monotonic() + LIMIT
        while not (path.exists() and path.stat().st_size > EMPTY):
            assert viewer.poll() is None and time.monotonic() < deadline, "the viewer gets nothing"
            time.sleep(0.05)
        time.sleep(seconds)
    finally:
        viewer.send_signal(signal.SIGINT)
        viewer.wait(LIMIT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it has no index
        return times_of(path)


def listening(process: psutil.Process) -> set[tuple[str, int]]:
    """Addresses and ports at which a process and its children listen."""
    found = set()
    for of in (process, *process.children(recursive=True)):
        for connection in of.net_connections(kind="tcp"):
            if connection.status == psutil.CONN_LISTEN:
                found.add((connection.laddr.ip, connection.laddr.port))
    return found
