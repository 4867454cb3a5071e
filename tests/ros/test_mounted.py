"""A strip that hangs on somebody's arm: its hub goes where the arm is, and the arm is told what it bears."""

import math
import random

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from bilayer_core import Simulator, load_scene
from bilayer_core.log.messages.encoders import decode_input
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.log_reader import read_log, read_messages
from bilayer_core.observed.inputs import POSE
from bilayer_core.runs.replay import verify
from bilayer_sim_ros.publishing.conversions import to_seconds

TOP_SPEED, HEIGHT, GRAVITY = 0.2, 0.3, 9.81
LIFT, BEGIN = 0.05, 0.1
"""How far the arm jumps [m], and when [s]."""
END = BEGIN + 1.5 * LIFT / TOP_SPEED
"""When the hub is there: on its cubic path the largest speed is 1.5 times the mean [s]."""
SCENE = f"""
schema: 1
name: hung
title: A strip hangs on a hub that an arm carries
duration: 10
gravity: [0, 0, -{GRAVITY}]
materials: {{rubber: {{youngs_modulus: 1e6, density: 1000, poisson_ratio: 0.5, retardation_time: 10 ms}}}}
stimuli: {{heat: {{minimum: 0, maximum: 1, schedule: {{type: hold, value: 0}}}}}}
rods:
  - name: strip
    width: 10 mm
    stations: 11
    path: {{shape: straight, start: [0, 0, {HEIGHT}], direction: [0, 0, -1], length: 100 mm}}
    normal: [1, 0, 0]
    clamp_start: hub
    layers: [{{name: sheet, material: rubber, thickness: 2 mm, eigenstrain: {{stimulus: heat, gain: 1e-3}}}}]
bodies:
  - {{name: hub, position: [0, 0, {HEIGHT}], motion: {{type: prescribed, top_speed: {TOP_SPEED} m/s}}}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene")
    (path / "hung.yaml").write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def process(folder, domain_of_module, start):
    parameters = {"scene": folder / "hung.yaml", "log": folder / "run.mcap", "rate": 50.0, "start_paused": True}
    answers = {"lockstep": True, "lockstep_answers": "[heat, mount_pose/hub]"}
    return start("sim_node", domain_of_module, parameters | answers | {"real_time_factor": 0.0})


class Arm:
    """At each tick it says where it is, before or after the answer for the one channel; it hears what it bears."""

    def __init__(self, client):
        self._client, self._answered, self._chance = client, None, random.Random(1)
        self.poses = client.listen(PoseStamped, "/bilayer_sim/body_pose/hub")
        self.wrenches = client.listen(WrenchStamped, "/bilayer_sim/clamp_wrench/hub")
        self._mount = client.sender(PoseStamped, "/bilayer_sim/mount_pose/hub")
        self._answer = client.sender(JointState, "/bilayer_sim/stimulus_stamped")
        client.node.create_subscription(Clock, "/clock", self._tick, 10)

    def _tick(self, message):
        if message.clock == self._answered:
            return
        self._answered = message.clock
        mount = PoseStamped()
        mount.header.stamp, mount.header.frame_id, mount.pose.orientation.w = message.clock, "world", 1.0
        mount.pose.position.z = HEIGHT + (LIFT if to_seconds(message.clock) >= BEGIN - 1e-9 else 0.0)
        answer = JointState(name=["heat"], position=[0.0])
        answer.header.stamp = message.clock
        both = [lambda: self._mount(mount), lambda: self._answer(answer)]
        for send in both if self._chance.random() < 0.5 else both[::-1]:
            send()

    def run(self, duration):
        """Times, heights of the hub, and wrenches on it, from the start on."""
        del self.poses[:], self.wrenches[:]
        assert self._client.call("resume").success
        self._client.spin_until(lambda: self.poses and time_of(self.poses[-1]) >= duration, "the end")
        assert self._client.call("pause").success
        self._client.drain()
        heights = {time_of(message): message.pose.position.z for message in self.poses}
        wrenches = {time_of(message): message.wrench for message in self.wrenches}
        return np.array(list(heights)), np.array(list(heights.values())), wrenches[max(wrenches)]


def states(log):
    """Time [ns] -> state, byte for byte."""
    return {time: data for _, _, time, data in read_messages(log, {"/bilayer_sim/state"}) if data}


def time_of(message):
    return to_seconds(message.header.stamp)


def test_a_mounted_hub_keeps_its_top_speed_and_bears_the_weight_as_after_a_reset(process, connect, folder):
    arm, simulator = Arm(client := connect(process)), Simulator(load_scene(folder / "hung.yaml"))
    weight = GRAVITY * float(simulator.model.rods.node_mass.sum())
    assert weight == pytest.approx(GRAVITY * 1000 * 0.1 * 0.01 * 0.002, rel=1e-9)
    for _ in range(2):
        times, heights, wrench = arm.run(1.0)
        speeds = np.diff(heights) / np.diff(times)
        assert np.all(heights[times < BEGIN] == HEIGHT)
        assert 0.95 * TOP_SPEED < speeds.max() <= TOP_SPEED * (1.0 + 1e-9) and speeds.min() >= -1e-12
        there = times[np.argmax(np.abs(heights - HEIGHT - LIFT) < 1e-9)]
        assert there == pytest.approx(END + 0.5 * 0.02, abs=0.5 * 0.02 + 1e-9)  # the first frame from then on
        force, moment = wrench.force, wrench.torque
        assert [force.x, force.y, force.z] == pytest.approx([0.0, 0.0, -weight], rel=1e-3, abs=1e-6)
        assert [moment.x, moment.y, moment.z] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6 * 0.1)
        assert client.call("reset").success
        client.spin_until(lambda: arm.poses[-1].pose.position.z == HEIGHT, "the start")
    process.send(15)
    assert process.wait() == 0, process.output
    one, other = (states(folder / name) for name in ("run.mcap", "run_1.mcap"))
    assert len(one.keys() & other.keys()) >= 50 and all(one[time] == other[time] for time in one.keys() & other.keys())
    for name in ("run.mcap", "run_1.mcap"):
        run = read_log(folder / name)
        told = [decode_input(data) for _, _, _, data in read_messages(folder / name, {INPUTS.full_name()}) if data]
        assert any(of.kind == POSE and math.isclose(of.values[2], HEIGHT + LIFT) for of in told)
        assert run.clamp_wrenches[-1, 0, 2] == pytest.approx(-weight, rel=1e-3)
        assert verify(folder / name).passed
