"""Point clouds of what is not a rod, for viewers that draw no markers."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from support import synthetic_run

from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.messages.clouds import CloudEncoder, surface_points
from bilayer_core.log.run.log_reader import read_messages
from bilayer_core.observed.frame import ShapeInfo

TURNED = (0.0, np.sin(0.3), 0.0, np.cos(0.3))
CLOUDS = {"obstacle_points", "body_points", "contact_force_points"}


@pytest.fixture(scope="module")
def typestore():
    return get_typestore(Stores.ROS2_KILTED)


def clouds(encoder, frame, typestore):
    """Points of each topic of a frame, shape (points, 3)."""
    found = {}
    for name, data in encoder.encode(frame):
        message = typestore.deserialize_cdr(data, "sensor_msgs/msg/PointCloud2")
        assert [field.name for field in message.fields] == ["x", "y", "z"] and message.header.frame_id == "world"
        found[name] = message.data.view("<f4").reshape(-1, 3)
    return found


def test_points_lie_on_the_ground_on_bodies_and_along_contact_forces(typestore):
    encoder, frame = CloudEncoder(synthetic_run.description()), synthetic_run.frame(3.0)
    found = clouds(encoder, frame, typestore)
    assert np.abs(found["obstacle_points"][:, 2]).max() < 1e-9
    assert found["obstacle_points"].min(axis=0)[:2] == pytest.approx(frame.positions.min(axis=0)[:2], abs=0.1)
    hub, ball = found["body_points"][:1], found["body_points"][1:]
    assert hub[0] == pytest.approx(frame.body_positions[0], abs=1e-7)
    distance = np.linalg.norm(ball - frame.body_positions[1], axis=1)
    assert distance == pytest.approx(np.full(len(ball), synthetic_run.RADIUS), rel=1e-4)
    touching = np.linalg.norm(frame.contact_forces, axis=1) > 0.0
    ways = found["contact_force_points"].reshape(-1, 3, 3) - frame.positions[touching][:, None]
    forces = frame.contact_forces[touching][:, None]
    along = (ways * forces).sum(axis=2) / np.linalg.norm(forces, axis=2)
    assert along == pytest.approx(np.linalg.norm(ways, axis=2), rel=1e-3)
    assert (np.diff(along, axis=1) > 0.0).all() and (along[:, 0] > 0.0).all()


def test_obstacles_come_once_and_lost_contacts_are_replaced_by_an_empty_cloud(typestore):
    encoder = CloudEncoder(synthetic_run.description())
    topics = [clouds(encoder, synthetic_run.frame(time), typestore) for time in (3.0, 0.0, 0.04)]
    assert [set(of) for of in topics] == [CLOUDS, CLOUDS - {"obstacle_points"}, {"body_points"}]
    assert len(topics[1]["contact_force_points"]) == 0


@pytest.mark.parametrize("kind", ["sphere", "box", "cylinder", "plane"])
def test_points_of_a_turned_shape_lie_on_its_surface(kind):
    size = np.array([0.02, 0.02, 0.05]) if kind != "sphere" else np.full(3, 0.02)
    shape = ShapeInfo(kind, tuple(size), 0.0, (0.1, 0.2, 0.3), TURNED)
    points = surface_points(shape, np.zeros(3), 1.0) - shape.position
    turn = np.array([[np.cos(0.6), 0.0, np.sin(0.6)], [0.0, 1.0, 0.0], [-np.sin(0.6), 0.0, np.cos(0.6)]])
    own = points @ turn / (0.5 * size)
    if kind == "plane":
        surface = own[:, 2] + 1.0
    elif kind == "sphere":
        surface = np.linalg.norm(own, axis=1)
    elif kind == "box":
        surface = np.abs(own).max(axis=1)
    else:
        surface = np.maximum(np.linalg.norm(own[:, :2], axis=1), np.abs(own[:, 2]))
    assert surface == pytest.approx(np.ones(len(own)))
    assert len(own) > 40


def test_clouds_are_less_than_three_percent_of_a_log(tmp_path):
    synthetic_run.run(McapRecorder(tmp_path / "run.mcap", rate=25.0, marker_rate=25.0), np.arange(0, 101) * 0.04)
    sizes = {True: 0, False: 0}
    for topic, _, _, data in read_messages(tmp_path / "run.mcap"):
        sizes[topic.rpartition("/")[2] in CLOUDS] += len(data or b"")
    assert 0 < sizes[True] < 0.03 * sizes[False]
