"""A block on a slope beside a node whose friction is changed."""

import math

import pytest
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import Log

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.log.run.log_reader import read_info, read_log
from bilayer_core.runs.replay import verify
from bilayer_core.scene.loader import scene_text
from bilayer_core.verification.validate.friction import FAR, GRAVITY, SIZE, at_rest, block
from bilayer_core.verification.validate.parts import GROUND, contact, fixed, layer, rod, scene
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.node.live_friction import LiveFriction, friction_overrides
from bilayer_sim_ros.node.parameters import FRICTION, FRICTION_OF_SCENE

SLOPE = 0.3


def slope():
    """YAML of a block at rest on a slope down to +x: gravity is turned instead of the ground."""
    angle = math.atan(SLOPE)
    content = scene(
        [rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")],
        gravity=[GRAVITY * math.sin(angle), 0, -GRAVITY * math.cos(angle)],
        obstacles=[GROUND],
        contact=contact(1e-4, 0.5, 1e-5),
        bodies=[fixed(position=FAR), block((0, 0, SIZE[2]))],
    )
    return scene_text(at_rest(content).scene)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene")
    (path / "slope.yaml").write_text(slope())
    return path


@pytest.fixture(scope="module")
def process(folder, domain_of_module, start):
    parameters = {"scene": folder / "slope.yaml", "log": folder / "run.mcap", "friction": 0.4}
    return start("sim_node", domain_of_module, parameters | {"start_paused": True, "real_time_factor": 0})


@pytest.fixture(scope="module")
def client(process, connect):
    return connect(process)


def way(client, poses, frames=10):
    """How far the block goes in some more frames [m]."""
    client.drain()
    before = poses[-1].pose.position.x
    for _ in range(frames):
        assert client.call("step").success
    client.drain()
    return poses[-1].pose.position.x - before


def test_without_friction_in_the_scene_no_coefficient_can_be_given():
    none = dict.fromkeys(FRICTION, FRICTION_OF_SCENE)
    smooth, rough = load_scene("cantilever"), load_scene("steered_walker")
    assert friction_overrides(smooth, none) == friction_overrides(rough, none) == []
    assert friction_overrides(rough, none | {"friction.forward": 0.1}) == ["contact.friction.forward=0.1"]
    with pytest.raises(InputError, match=r"'friction.forward' is 0.1; .* has no contact.friction, so allowed is -1"):
        friction_overrides(smooth, none | {"friction.forward": 0.1})
    live = LiveFriction(Simulator(smooth), Commands(pytest.fail), pytest.fail)
    with pytest.raises(
        InputError, match="'friction.coefficient' is 0.1: .*nothing slides against friction in the scene"
    ):
        live.changes["friction.coefficient"](0.1)


def test_a_block_slides_once_friction_is_below_the_slope_until_a_reset(client, process, folder):
    poses, events = client.listen(PoseStamped, "/bilayer_sim/body_pose/block"), []
    client.node.create_subscription(Log, "/bilayer_sim/events", events.append, 100)
    assert client.get_parameter("friction.coefficient") == 0.4  # by the name that the coefficient had before
    assert process.output.count("parameter 'friction' is now called 'friction.coefficient'") == 1
    assert abs(way(client, poses)) < 1e-5
    assert client.set_parameter("friction.coefficient", 0.2).successful
    slid = way(client, poses)
    cosine = math.cos(math.atan(SLOPE))
    assert slid == pytest.approx(0.5 * GRAVITY * (SLOPE - 0.2) * cosine * 0.2**2, rel=0.05)
    assert [event.msg for event in events if event.name == "setting"] == ["contact.friction.coefficient is 0.2"]
    assert client.set_parameter("friction.coefficient", -1.0).successful
    way(client, poses)
    assert abs(way(client, poses)) < 1e-5  # by the 0.4 with which the node was started
    for bad in (-0.1, math.nan, math.inf):
        refused = client.set_parameter("friction.sideways", bad)
        assert not refused.successful and "allowed is a finite number >= 0, or -1" in refused.reason
    assert client.set_parameter("friction.coefficient", 0.0).successful
    assert client.call("reset").success
    client.spin_until(
        lambda: client.get_parameter("friction.coefficient") == 0.4, "the value of the start after a reset"
    )
    assert abs(way(client, poses)) < 1e-5
    process.send(15)
    assert process.wait() == 0
    found = verify(folder / "run.mcap")
    assert found.passed and found.inputs == 3  # friction twice, and the reset
    assert verify(folder / "run_1.mcap").passed
    assert read_info(folder / "run.mcap").topics["/bilayer_sim/inputs"]["count"] > 0
    said = [event.text for event in read_log(folder / "run.mcap").events if event.name == "setting"]
    assert said == ["contact.friction.coefficient is 0.2", "contact.friction.coefficient is 0.4"]
