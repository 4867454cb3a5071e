"""Logs of real nodes, whose runs are made again bit for bit."""

import random
import time

import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from support.acted_scenes import pushed

from bilayer_core.log.messages.encoders import decode_input
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.log_reader import read_messages
from bilayer_core.observed.inputs import LOAD, POSE, RESET, STIMULUS, UNTIL
from bilayer_core.runs.replay import verify

NAMESPACE = "/bilayer_sim"


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "pushed.yaml"
    path.write_text(yaml.safe_dump(pushed()))
    return path


def kinds(log):
    """How often each kind of input is in a log."""
    found = {}
    for _, _, _, data in read_messages(log, {INPUTS.full_name()}):
        if data is not None:
            kind = decode_input(data).kind
            found[kind] = found.get(kind, 0) + 1
    return found


def assert_it_comes_out(log):
    found = verify(log)
    assert found.passed and found.states > 5 and not found.changed
    return found


def height(value):
    pose = PoseStamped()
    pose.pose.position.x, pose.pose.position.z, pose.pose.orientation.w = 0.04, 3e-3 + 2e-3 * value, 1.0
    return pose


def test_a_node_on_which_stimuli_loads_and_poses_act_at_any_time(start, connect, domain, tmp_path, scene):
    log, chance = tmp_path / "run.mcap", random.Random(4)
    parameters = {"scene": scene, "log": log, "real_time_factor": 0.2, "duration": 0.5, "start_paused": True}
    node = start("sim_node", domain, parameters)
    client = connect(node)
    send = {
        "heat": client.sender(Float64, f"{NAMESPACE}/stimulus/heat"),
        "push": client.sender(Float64, f"{NAMESPACE}/load/push"),
        "hand": client.sender(PoseStamped, f"{NAMESPACE}/mount_pose/hand"),
    }
    assert client.call("resume").success
    while node.running:
        what = chance.choice(list(send))
        send[what](height(chance.random()) if what == "hand" else Float64(data=chance.random()))
        time.sleep(0.02 * chance.random())
    assert node.wait() == 0, node.output
    found = kinds(log)
    assert found[STIMULUS] > 2 and found[LOAD] > 2 and found[POSE] > 2
    assert_it_comes_out(log)


def test_a_node_in_lockstep(start, connect, domain, tmp_path, scene):
    log, chance = tmp_path / "run.mcap", random.Random(5)
    parameters = {"scene": scene, "log": log, "real_time_factor": 0, "duration": 0.2, "lockstep": True}
    node = start("sim_node", domain, parameters | {"control_period": 0.015})
    client = connect(node)
    send = client.sender(Float64, f"{NAMESPACE}/stimulus/heat")
    client.node.create_subscription(Clock, "/clock", lambda _: send(Float64(data=chance.random())), 10)
    client.spin_to_the_end()
    assert node.wait() == 0, node.output
    assert kinds(log)[UNTIL] >= 13
    assert assert_it_comes_out(log).inputs >= 13


def test_runs_before_and_after_a_reset(start, connect, domain, tmp_path, scene):
    log = tmp_path / "run.mcap"
    parameters = {"scene": scene, "log": log, "real_time_factor": 0.2, "duration": 0.3, "start_paused": True}
    node = start("sim_node", domain, parameters | {"publish_clock": True})
    client = connect(node)
    send = client.sender(Float64, f"{NAMESPACE}/stimulus/heat")
    send(Float64(data=0.7))
    clock = client.listen(Clock, "/clock")
    assert client.call("resume").success
    client.spin_until(lambda: clock[-1].clock.nanosec > 1.2e8, "some time")
    assert client.call("reset").success
    client.spin_to_the_end()
    assert node.wait() == 0, node.output
    assert kinds(log)[RESET] == 1
    assert_it_comes_out(log)
    assert_it_comes_out(log.with_stem("run_1"))
