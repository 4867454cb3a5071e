"""A node for a long time among controllers that send nonsense and subscribers that come and go; ten minutes of it:

SOAK_SECONDS=600 pytest -m "" -s tests/ros/test_soak.py
"""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
import yaml
from support import soak_clients
from support.acted_scenes import pushed
from support.processes import environment

from bilayer_core.log.run.log_reader import read_info, read_log

SECONDS = float(os.environ.get("SOAK_SECONDS", "12"))
SAMPLE_PERIOD = 0.25
"""Between two looks at the memory [s]."""
MOST_GROWTH = 6.0
"""From the middle fifth to the last one [MB]: of ten minutes about 1 MB per 100 subscriptions would be seen. What DDS
keeps for participants that have gone is freed within some 20 s, so that it is not flat to the last page."""
WARNINGS_A_SECOND = 1.5
"""Of each kind there is one at most, and refusals are one kind."""
BRAKING = 5e-4
"""How far beyond a pose the body may go that gets another one on its way, and brakes [m]."""


class Beside:
    """A helper process, which ends with its standard input."""

    def __init__(self, name, domain):
        self._process = subprocess.Popen(
            [sys.executable, soak_clients.__file__, name],
            env=environment() | {"ROS_DOMAIN_ID": str(domain)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def end(self):
        """What it did."""
        return json.loads(self._process.communicate(timeout=30)[0].splitlines()[-1])


@pytest.mark.verify
@pytest.mark.timeout(3600)
def test_nonsense_at_1_khz_and_fifty_restless_subscribers_leave_the_memory_flat(start, domain, tmp_path):
    scene, log = tmp_path / "pushed.yaml", tmp_path / "run.mcap"
    scene.write_text(yaml.safe_dump(pushed()))
    node = start("sim_node", domain, {"scene": scene, "log": log})
    node.wait_for("is ready")
    process, beside = psutil.Process(node.pid), [Beside(name, domain) for name in ("sender", "visitors")]
    memory, begin, started = [], time.monotonic(), sum(process.cpu_times()[:2])
    while (now := time.monotonic() - begin) < SECONDS:
        assert node.running, node.output
        memory.append((now, process.memory_info().rss / 1e6))
        time.sleep(SAMPLE_PERIOD)
    done = {key: value for of in beside for key, value in of.end().items()}
    cpu_time = sum(process.cpu_times()[:2])
    node.send(signal.SIGINT)
    assert node.wait() == 0, node.output
    at, megabytes = np.array(memory).T
    fifth = SECONDS / 5
    first, last = (float(np.median(megabytes[(at >= t) & (at < t + fifth)])) for t in (2 * fifth, 4 * fifth))
    warnings, run, info = node.output.count("[WARN]"), read_log(log), read_info(log)
    print(
        f"\n{SECONDS:g} s: {done['sent']} messages ({done['rate']:.0f} Hz), {done['subscriptions']} subscriptions, "
        f"{done['received']} received; memory {megabytes[0]:.1f} MB, {first:.1f} MB in the middle, {last:.1f} MB at "
        f"the end; simulated {info.last_time:.1f} s; {warnings} warnings; log {info.size / 1e6:.1f} MB"
    )
    assert last - first < MOST_GROWTH
    assert done["rate"] > 500 and done["subscriptions"] > 50 + SECONDS and done["received"] > 10 * SECONDS
    # It keeps pace on a core of its own; how much of one it gets is the machine's affair.
    assert info.last_time > 0.8 * min(SECONDS, cpu_time - started) and info.termination == "ended by SIGINT"
    assert node.output.count("refused: ") > 0.3 * SECONDS
    assert warnings < WARNINGS_A_SECOND * (SECONDS + 10)
    assert "[ERROR]" not in node.output and "Traceback" not in node.output
    applied = run["stimulus/heat"].values
    assert np.isfinite(applied).all() and applied.min() >= 0.0 and applied.max() <= 1.0 and np.ptp(applied) > 0.1
    heights = run["body/hand/position"].values[:, 2]
    assert heights.max() > soak_clients.LOW + 5e-4
    assert soak_clients.LOW - BRAKING < heights.min() and heights.max() < soak_clients.HIGH + BRAKING
    assert len(run["com"].times) > 0.8 * 50 * info.last_time - left_out(info)


def left_out(info):
    """Frames that the log lacks, as the disk was slower."""
    return sum(int(lack.split()[0]) for lack in info.lacks if "frames, left out" in lack)
