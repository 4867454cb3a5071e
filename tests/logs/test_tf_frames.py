"""Frames on /tf, in messages and in logs."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from support import synthetic_run
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.encoders import FrameEncoder
from bilayer_core.log.messages.topics import TF
from bilayer_core.log.run.log_reader import read_info, read_log, read_messages

TYPESTORE = get_typestore(Stores.ROS2_KILTED)


def transforms(data):
    """Child frame -> position and quaternion, of a message whose every frame is a child of the world at one time."""
    message = TYPESTORE.deserialize_cdr(data, TF.type)
    assert bytes(TYPESTORE.serialize_cdr(message, TF.type)) == bytes(data)
    assert len({(of.header.stamp.sec, of.header.stamp.nanosec, of.header.frame_id) for of in message.transforms}) <= 1
    assert {of.header.frame_id for of in message.transforms} <= {"world"}
    found = {}
    for of in message.transforms:
        at, turned = of.transform.translation, of.transform.rotation
        found[of.child_frame_id] = np.array([at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w])
    assert len(found) == len(message.transforms)
    return found


def axes(quaternion):
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
            [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
            [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize(("model", "dimension"), [("laminate", 3), ("two_rod", 3), ("laminate", 2)])
def test_frames_are_those_of_bodies_and_of_both_ends_of_rods(model, dimension):
    scene = everything() if dimension == 3 else "gripping"
    simulator = Simulator(load_scene(scene), model=model)
    simulator.run(0.02)
    frame = simulator.frame()
    found = transforms(FrameEncoder(simulator.description, tf="/a/sim").encode("/tf", frame))
    for name, body in simulator.bodies.items():
        np.testing.assert_array_equal(found[f"a/sim/{name}"][:3], body.position)
        turned = found[f"a/sim/{name}"][3:]
        assert abs(turned @ body.quaternion) == pytest.approx(1.0, abs=1e-12)
    for name, rod in simulator.rods.items():
        if f"a/sim/{name}/start" not in found:
            continue
        strand = next(of for of in simulator.description.strands if of.rod == name)
        nodes = frame.positions[strand.nodes]
        for end, place, director in (("start", 0, rod.directors[0]), ("end", -1, frame.directors[strand.edges][-1])):
            own = found[f"a/sim/{name}/{end}"]
            np.testing.assert_array_equal(own[:3], nodes[place])
            m1, m2, m3 = axes(own[3:])
            tangent = np.diff(nodes, axis=0)[place]
            np.testing.assert_allclose(m1, director, atol=1e-9)
            np.testing.assert_allclose(m3, tangent / np.linalg.norm(tangent), atol=1e-9)
            np.testing.assert_allclose(m2, np.cross(m3, m1), atol=1e-9)
    closed = {strand.rod for strand in simulator.description.strands if strand.closed}
    assert len(found) == len(simulator.bodies) + 2 * len(set(simulator.rods) - closed)


@pytest.mark.parametrize(("name", "names"), [("ring", set()), ("bending", {"wall", "strip/start", "strip/end"})])
def test_a_closed_rod_has_no_ends(name, names):
    simulator = Simulator(load_scene(name))
    found = transforms(FrameEncoder(simulator.description, tf="sim").encode("/tf", simulator.frame()))
    assert set(found) == {f"sim/{own}" for own in names}


def test_without_being_asked_for_there_is_no_tf(tmp_path):
    description = synthetic_run.description()
    assert TF.name not in {spec.name for spec in FrameEncoder(description).topics}
    synthetic_run.run(McapRecorder(tmp_path / "run.mcap"), np.array([0.0, 0.02]))
    assert "/tf" not in read_info(tmp_path / "run.mcap").topics


def test_a_log_has_tf_with_every_frame_and_all_else_as_without(tmp_path, capsys):
    plain, asked = str(tmp_path / "plain.mcap"), str(tmp_path / "run.mcap")
    for name, more in ((plain, []), (asked, ["--tf"])):
        assert main(["run", "bending", "--duration", "0.1", "--log", name, "--quiet", *more]) == 0
    topics = read_info(asked).topics
    assert topics["/tf"] == {"type": "tf2_msgs/msg/TFMessage", "count": 6}
    assert topics.keys() - read_info(plain).topics.keys() == {"/tf"} and read_info(asked).lacks == ()
    run, other = read_log(asked), read_log(plain)
    np.testing.assert_array_equal(run.positions, other.positions)
    stored = [(time, transforms(data)) for _, _, time, data in read_messages(asked, {"/tf"}) if data is not None]
    assert [time for time, _ in stored] == [round(1e9 * time) for time in run.times]
    ends = np.array([of["bilayer_sim/strip/end"][:3] for _, of in stored])
    strand = run.description.strands[0]
    np.testing.assert_array_equal(ends[-1].astype(np.float32), run.positions[-1, strand.nodes][-1])
    assert main(["run", "bending", "--tf", "--quiet"]) == 2
    assert "--tf: is written into a log; give --log FILE.mcap too" in capsys.readouterr().err
