"""Programs that write a log and are killed at a random moment, and how much of it is missing then.

A program runs with an observer that writes, for each frame that was handed to the log, its time and the wall time into
a file of its own: these bytes outlive the process. A thread beside it notes when it could run at all, so that time in
which a busy machine let nothing of the process run is not taken for a loss.
"""

from __future__ import annotations

import os
import random
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from support.processes import environment

from bilayer_core.log.messages.topics import LOG_NAMESPACE
from bilayer_core.log.run.log_reader import read_info, read_log

SCENES = ("bending", "gripping", "swimming")
BEAT = 0.02
"""Between two beats of the thread that notes whether the process can run [s]."""
ENTRY = struct.Struct("<cdd")
LONGEST_START = 240.0
"""Until the first frame, compilation of kernels included [s]."""

WATCHED = """
import os, struct, sys, threading, time
from bilayer_core.log.file import mcap_log

diary = os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT | os.O_APPEND)
entry = struct.Struct("<cdd")
observe = mcap_log.McapRecorder.observe


def noted(self, frame):
    observe(self, frame)
    os.write(diary, entry.pack(b"f", frame.time, time.monotonic()))


def beat():
    while True:
        os.write(diary, entry.pack(b"b", 0.0, time.monotonic()))
        time.sleep({beat})


mcap_log.McapRecorder.observe = noted
threading.Thread(target=beat, daemon=True).start()
{program}
"""
RUN = """
from bilayer_core.cli import main
main(["run", {scene!r}, "--duration", "1000", "--log", {log!r}, "--quiet"])
"""
NODE = """
import sys
from bilayer_sim_ros.sim_node import main
sys.argv = ["sim_node", "--ros-args", "-p", "scene:={scene}", "-p", "log:={log}", "-p", "real_time_factor:=0.0"]
main()
"""


@dataclass(frozen=True)
class Loss:
    """What a kill cost.

    Attributes
    ----------
    frames : int
        That are in the log.
    missing : float
        Wall time between the first frame that is not in the log and the kill [s], 0 if none is missing.
    stalled : float
        Of that, time in which nothing of the process could run [s].
    """

    frames: int
    missing: float
    stalled: float


def kill(program: str, log: Path, diary: Path, after: float, domain: int | None = None) -> Loss:
    """Start a program, kill it some time after its first frame, and say what its log lacks.

    Parameters
    ----------
    program : str
        Python that writes `log`.
    log, diary : Path
    after : float
        [s].
    domain : int, optional
        ROS domain.
    """
    surroundings = environment() | ({} if domain is None else {"ROS_DOMAIN_ID": str(domain)})
    text = WATCHED.format(beat=BEAT, program=program)
    errors = diary.with_suffix(".err")
    with errors.open("wb") as told:
        process = subprocess.Popen([sys.executable, "-c", text, diary], env=surroundings, stdout=told, stderr=told)
    try:
        deadline = time.monotonic() + LONGEST_START
        while not any(kind == b"f" for kind, _, _ in entries(diary)):
            assert process.poll() is None, errors.read_text()
            assert time.monotonic() < deadline, "no frame came"
            time.sleep(0.01)
        time.sleep(after)
        assert process.poll() is None, errors.read_text()
    finally:
        process.send_signal(signal.SIGKILL)
        killed = time.monotonic()
        process.wait()
    return loss(log, diary, killed)


def entries(diary: Path) -> list[tuple[bytes, float, float]]:
    """What a program noted: kind, simulated time, wall time."""
    if not diary.exists():
        return []
    data = diary.read_bytes()
    return list(ENTRY.iter_unpack(data[: len(data) - len(data) % ENTRY.size]))


def loss(log: Path, diary: Path, killed: float) -> Loss:
    """What a log lacks of what its program noted until it was killed; AssertionError if it cannot be read."""
    info = read_info(log)
    assert (info.complete, info.termination) == (False, "cut off")
    run = read_log(log)
    frames = info.topics.get(f"{LOG_NAMESPACE}/com", {"count": 0})["count"]  # none before the first chunk
    assert len(run.com) == len(run.times) <= frames
    noted = entries(diary)
    last = info.last_time if frames else -1.0
    lost = [wall for kind, moment, wall in noted if kind == b"f" and moment > last + 1e-9]
    if not lost:
        return Loss(frames, 0.0, 0.0)
    moments = [lost[0], *(wall for kind, _, wall in noted if kind == b"b" and wall >= lost[0]), killed]
    pauses = [later - earlier for earlier, later in pairwise(moments)]
    return Loss(frames, killed - lost[0], sum(pause for pause in pauses if pause > 5 * BEAT))


def kills(count: int, directory: Path, seed: int, node_domain: int, longest: float = 1.5) -> Iterator:
    """Names and losses of some kills, of ``bilayer run`` and of a node by turns, two of them at a time."""
    generator = random.Random(seed)
    planned = [(k, generator.choice(SCENES), generator.uniform(0.0, longest)) for k in range(count)]

    def one(plan: tuple[int, str, float]) -> tuple[str, Loss]:
        number, scene, after = plan
        log, diary = directory / f"{number}.mcap", directory / f"{number}.diary"
        is_node = number % 2 == 1
        program = (NODE if is_node else RUN).format(scene=scene, log=str(log))
        found = kill(program, log, diary, after, node_domain if is_node else None)
        for path in (log, diary, diary.with_suffix(".err")):
            os.unlink(path)
        return f"{'node' if is_node else 'run'} of {scene}", found

    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(one, planned)
