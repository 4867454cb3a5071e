"""The controller in docs/control.md, as a process beside a node."""

import math
import os
import re
import subprocess
import sys

import pytest
from rosgraph_msgs.msg import Clock
from support.logged_commands import stimuli_taken

from bilayer_core.log.run.log_reader import read_info
from bilayer_sim_ros.publishing.conversions import to_seconds

PERIOD = 0.02


@pytest.fixture
def controller(root, domain, tmp_path):
    program = tmp_path / "wave.py"
    page = (root / "docs" / "control.md").read_text(encoding="utf-8")
    program.write_text(re.search(r"```python\n(.*?)```", page, re.S)[1], encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, program],
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    yield process
    process.kill()
    process.wait()


def test_the_controller_of_the_page_answers_each_tick_and_again_after_a_reset(
    start, connect, controller, domain, tmp_path
):
    log = tmp_path / "run.mcap"
    parameters = {"scene": "bending", "log": log, "duration": 0.4, "lockstep": True, "lockstep_answers": "[swelling]"}
    node = start("sim_node", domain, parameters | {"real_time_factor": 0.2})
    client = connect(node)
    clock = client.listen(Clock, "/clock")
    client.spin_until(lambda: to_seconds(clock[-1].clock) > 0.1, "some ticks")
    assert client.call("reset").success
    client.spin_to_the_end()
    assert node.wait() == 0, node.output
    assert controller.poll() is None
    assert read_info(log).termination == "reset" and read_info(log.with_stem("run_1")).complete
    for path, most in ((log, 21), (log.with_stem("run_1"), 20)):
        found = stimuli_taken(path)
        times = [round(time / PERIOD) for time, _ in found]
        assert 5 < len(times) <= most and times == list(range(len(times)))
        expected = [0.5 - 0.5 * math.cos(6.0 * time) for time, _ in found]
        assert [value for _, value in found] == pytest.approx(expected, abs=1e-9)
