"""The feedback controller in lockstep: the same run bit for bit, however late and slow it is, and after a reset."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
from acted_scenes import TWO_CHANNELS
from logged_commands import stimuli_taken
from rosgraph_msgs.msg import Clock

from bilayer_core.record.log_reader import read_messages
from bilayer_core.record.topics import INPUTS
from bilayer_sim_ros.conversions import to_seconds

LOCKSTEP = {"lockstep": True, "real_time_factor": 0.0}
BEAT = {"period": 0.08, "tolerance": 1e-5, "axis": [0.0, 0.0, -1.0], "goal": [0.0, 0.0, -0.01]}
SLOWED = """
import random, sys, time
from bilayer_sim_ros.controllers.goal_controller import GoalController, main

chance, longest = random.Random(int(sys.argv[1])), float(sys.argv[2])

def slowed(take):
    def take_slowly(self, message):
        time.sleep(longest * chance.random())
        take(self, message)
    return take_slowly

GoalController.hear, GoalController.see = slowed(GoalController.hear), slowed(GoalController.see)
print("imported", flush=True)
sys.exit(main(sys.argv[2:]))
"""
"""The controller with a nap before each message that it takes, so that clock and frame change places."""


@contextmanager
def goal_controller(domain, channel="swelling", seed=1, longest_nap=0.0, name="goal_controller"):
    """A process that begins with its node; it ends with the block."""
    parameters = [part for key, value in {"channel": channel, **BEAT}.items() for part in ("-p", f"{key}:={value}")]
    command = [sys.executable, "-c", SLOWED, str(seed), str(longest_nap), "--ros-args", "-r", f"__node:={name}"]
    with subprocess.Popen(
        [*command, *parameters], env=os.environ | {"ROS_DOMAIN_ID": str(domain)}, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout.readline() == "imported\n"
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            assert process.wait(30) == 0


def states(log):
    """All states and inputs of a log: topic, time and bytes."""
    topics = {"/bilayer_sim/state", INPUTS.full_name()}
    return [(topic, stamp, bytes(data)) for topic, _, stamp, data in read_messages(log, topics) if data is not None]


def before(time, messages):
    """Those of messages from before a time [s]."""
    return [message for message in messages if message[1] < 1e9 * time]


def run(start, domain, log, lateness, seed, longest_nap, **parameters):
    """Run a node to its end; the controller begins so long after the node waits for it [s], or before the node."""
    simulation = LOCKSTEP | {"scene": "bending", "log": log} | parameters
    if lateness is None:
        with goal_controller(domain, seed=seed, longest_nap=longest_nap):
            node = start("sim_node", domain, simulation)
            assert node.wait() == 0, node.output
        return
    node = start("sim_node", domain, simulation)
    node.wait_for("is ready")
    time.sleep(lateness)
    with goal_controller(domain, seed=seed, longest_nap=longest_nap):
        assert node.wait() == 0, node.output


@pytest.mark.slow
def test_ten_runs_whose_controllers_start_late_and_are_slow_are_equal(start, domain, tmp_path):
    cases = [(lateness, nap) for lateness in (None, 0.0, 0.5, 2.0) for nap in (0.0, 0.05)] + [(None, 0.1), (1.0, 0.1)]
    logs = [tmp_path / f"{seed}.mcap" for seed in range(len(cases))]
    for seed, ((lateness, nap), log) in enumerate(zip(cases, logs, strict=True)):
        run(start, domain, log, lateness, seed, nap, duration=0.4)
    first = states(logs[0])
    assert len(stimuli_taken(logs[0])) == 20
    peaks = {value for _, value in stimuli_taken(logs[0]) if value > 0.05}
    assert len(peaks) > 5  # beats of different sizes: what the controller saw decides
    for log in logs[1:]:
        assert states(log) == first


def test_ticks_between_frames_have_frames_for_controllers(start, domain, tmp_path):
    logs = [tmp_path / "early.mcap", tmp_path / "late.mcap"]
    for log, lateness, nap in zip(logs, (None, 1.0), (0.0, 0.01), strict=True):
        run(start, domain, log, lateness, 1, nap, duration=0.2, rate=30.0, control_period=0.01)
    times = [when for when, _ in stimuli_taken(logs[0])]
    assert times == pytest.approx(np.arange(20) * 0.01, abs=1e-9)
    assert states(logs[0]) == states(logs[1])
    frames = [stamp for topic, stamp, _ in states(logs[0]) if topic.endswith("state")]
    assert len(frames) == 7  # the log keeps to its rate


def test_two_feedback_controllers_make_the_same_run_after_a_reset_and_with_a_pause(start, connect, domain, tmp_path):
    scene = tmp_path / "two.yaml"
    scene.write_text(TWO_CHANNELS)
    parameters = LOCKSTEP | {"scene": scene, "lockstep_answers": "[heat, light]"}
    logs = [tmp_path / "straight.mcap", tmp_path / "again.mcap"]
    with goal_controller(domain, "heat", name="of_heat"), goal_controller(domain, "light", 2, 0.02, "of_light"):
        node = start("sim_node", domain, parameters | {"log": logs[0], "duration": 0.4})
        assert node.wait() == 0, node.output
        node = start("sim_node", domain, parameters | {"log": logs[1], "start_paused": True})
        client = connect(node)
        clock = client.listen(Clock, "/clock")

        def reach(now):
            client.spin_until(lambda: to_seconds(clock[-1].clock) > now, f"t = {now} s")

        assert client.call("resume").success
        reach(0.1)
        assert client.call("reset").success  # answers are on their way
        client.spin_until(lambda: to_seconds(clock[-1].clock) < 0.1, "the start")
        reach(0.1)
        assert client.call("pause").success
        client.drain()
        assert client.call("resume").success
        reach(0.4)
        node.send(signal.SIGINT)
        assert node.wait() == 0, node.output
    first, second = states(logs[0]), states(logs[1].with_stem("again_1"))
    assert len(stimuli_taken(logs[0])) == 40
    assert before(0.4, first) == before(0.4, second)
