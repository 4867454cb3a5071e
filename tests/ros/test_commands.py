"""Poses of bodies and factors of loads from topics."""

import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_msgs.msg import Float64

SCENE = """
schema: 1
name: commanded
title: A strip on a hub that controllers move, pushed by a load
duration: 10
gravity: [0, 0, 0]
materials: {rubber: {youngs_modulus: 1e6, density: 1000, poisson_ratio: 0.5, retardation_time: 10 ms}}
rods:
  - name: strip
    width: 10 mm
    stations: 11
    path: {shape: straight, start: [0, 0, 0], direction: [1, 0, 0], length: 100 mm}
    normal: [0, 0, 1]
    clamp_start: hub
    layers: [{name: sheet, material: rubber, thickness: 2 mm}]
bodies:
  - {name: hub, position: [0, 0, 0], motion: {type: prescribed, top_speed: 1 m/s, top_angular_speed: 10 rad/s}}
loads:
  - {name: push, rod: strip, position: 100 mm, force: [0, 0, 10 mN], schedule: {type: hold, value: 0}}
"""


@pytest.fixture(scope="module")
def process(domain_of_module, start, tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "commanded.yaml"
    path.write_text(SCENE)
    return start("sim_node", domain_of_module, {"scene": path, "start_paused": True, "rate": 50, "real_time_factor": 0})


@pytest.fixture(scope="module")
def client(process, connect):
    return connect(process)


def pose(z, frame="world", w=1.0):
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.z, message.pose.orientation.w = z, w
    return message


def after_steps(client, messages, count):
    for _ in range(count):
        assert client.call("step").success
    client.drain()
    return messages[-1]


def test_a_pose_moves_its_body_within_its_limits_and_a_load_pushes(client):
    assert client.call("reset").success
    poses = client.listen(PoseStamped, "/bilayer_sim/body_pose/hub")
    wrenches = client.listen(WrenchStamped, "/bilayer_sim/clamp_wrench/hub")
    client.sender(PoseStamped, "/bilayer_sim/mount_pose/hub")(pose(0.02))
    client.drain()
    assert after_steps(client, poses, 10).pose.position.z == pytest.approx(0.02, abs=1e-12)
    client.sender(Float64, "/bilayer_sim/load/push")(Float64(data=1.0))
    client.drain()
    before = len(wrenches)
    after_steps(client, wrenches, 100)
    forces = [message.wrench.force.z for message in wrenches[before:]]
    assert sum(forces) / len(forces) == pytest.approx(0.01, rel=0.1)  # it swings about that


def test_a_pose_that_cannot_be_is_refused_with_a_warning_and_the_node_goes_on(client, process):
    send = client.sender(PoseStamped, "/bilayer_sim/mount_pose/hub")
    for message, reason in ((pose(0.0, "map"), "frame 'map' is not allowed"), (pose(0.0, w=0.0), "must be above 0")):

        def warned(message=message, reason=reason):
            send(message)
            assert client.call("step").success
            return reason in process.output

        client.spin_until(warned, f"a warning: {reason}", limit=30.0)
    assert process.running
