"""Messages from templates, held against two independent implementations: rosbags and ROS 2 itself."""

import time
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_typestore
from support import synthetic_run
from visualization_msgs.msg import Marker

from bilayer_core import Simulator, load_scene
from bilayer_core.log.messages.cdr import nanoseconds, read_float64_multi_array
from bilayer_core.log.messages.encoders import FrameEncoder, encode_float64, multi_array_template
from bilayer_core.log.messages.markers import (
    ADD,
    ARROW_DECADE,
    ARROW_FORCE,
    DELETE,
    DELETE_ALL,
    LINE_LIST,
    SPHERE,
    delete_all,
    deleting_all_first,
)
from bilayer_core.log.messages.schemas import schema_text
from bilayer_core.log.messages.topics import MULTI_ARRAY, TF, DisplayGate, Rate, output_topics, stimulus_topics

DESCRIPTION = synthetic_run.description()
TOPICS = {spec.name: spec for spec in output_topics(DESCRIPTION, tf=True)}
TYPES = sorted({spec.type for spec in (*TOPICS.values(), *stimulus_topics(DESCRIPTION))})


@pytest.fixture(scope="module")
def typestore():
    return get_typestore(Stores.ROS2_KILTED)


@pytest.fixture(scope="module")
def encoder():
    return FrameEncoder(DESCRIPTION, tf="/left/bilayer_sim")


def assert_same(found, expected):
    """A rclpy message holds the same as one of rosbags, field by field."""
    if hasattr(expected, "__msgtype__"):
        for name in found.get_fields_and_field_types():
            assert_same(getattr(found, name), getattr(expected, name))
    elif isinstance(expected, (list, np.ndarray)):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            assert_same(one, other)
    else:
        assert found == expected


def test_markers_show_the_width_at_each_node(typestore):
    widths = np.linspace(12e-3, 3e-3, synthetic_run.NODES)
    strands = tuple(replace(strand, width=widths) for strand in DESCRIPTION.strands)
    data = FrameEncoder(replace(DESCRIPTION, strands=strands)).encode("markers", synthetic_run.frame(1.0))
    markers = {m.ns: m for m in typestore.deserialize_cdr(data, TOPICS["markers"].type).markers}
    points = [(p.x, p.y, p.z) for p in markers[f"strands/{strands[-1].name}"].points]
    bars = np.array(points).reshape(-1, 2, 3)
    assert np.linalg.norm(bars[:, 1] - bars[:, 0], axis=1) == pytest.approx(widths)


def test_markers_are_in_the_middle_of_the_section_where_nodes_are_not(typestore):
    def bars(offset):
        strands = tuple(replace(s, offset=np.full(synthetic_run.NODES, offset)) for s in DESCRIPTION.strands)
        data = FrameEncoder(replace(DESCRIPTION, strands=strands)).encode("markers", synthetic_run.frame(0.0))
        markers = {m.ns: m for m in typestore.deserialize_cdr(data, TOPICS["markers"].type).markers}
        return np.array([(p.x, p.y, p.z) for p in markers[f"strands/{strands[0].name}"].points])

    moved = bars(2e-3) - bars(0.0)
    assert moved[0] == pytest.approx([0.0, 0.0, 2e-3], abs=1e-6)  # along m1: up, as long as the arms are flat
    assert np.linalg.norm(moved, axis=1) == pytest.approx(np.full(len(moved), 2e-3))


@pytest.mark.parametrize("name", TOPICS)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_message_has_the_bytes_that_rosbags_writes(name, seed, encoder, typestore):
    frame = synthetic_run.random_frame(np.random.default_rng(seed))
    data = encoder.encode(name, frame)
    message = typestore.deserialize_cdr(data, TOPICS[name].type)
    assert bytes(typestore.serialize_cdr(message, TOPICS[name].type)) == data


@pytest.mark.parametrize("name", [name for name in TOPICS if name != TF.name])  # of which there is no wheel
def test_ros_itself_reads_the_same_message(name, encoder, typestore):
    data = encoder.encode(name, synthetic_run.random_frame(np.random.default_rng(2)))
    package, type_name = TOPICS[name].type.split("/msg/")
    found = deserialize_message(data, getattr(import_module(f"{package}.msg"), type_name))
    assert_same(found, typestore.deserialize_cdr(data, TOPICS[name].type))


def test_a_single_number_has_the_bytes_that_rosbags_writes(typestore):
    data = encode_float64(-0.6)
    message = typestore.deserialize_cdr(data, "std_msgs/msg/Float64")
    assert message.data == -0.6
    assert bytes(typestore.serialize_cdr(message, "std_msgs/msg/Float64")) == data


@pytest.mark.parametrize("ros_type", TYPES)
def test_schema_texts_are_those_of_rosbags(ros_type, typestore):
    assert schema_text(ros_type) == typestore.generate_msgdef(ros_type, ros_version=2)[0]


def test_messages_hold_the_values_of_the_frame(encoder, typestore):
    frame = synthetic_run.random_frame(np.random.default_rng(3))

    def read(name):
        return typestore.deserialize_cdr(encoder.encode(name, frame), TOPICS[name].type)

    clock = read("/clock").clock
    assert clock.sec + 1e-9 * clock.nanosec == pytest.approx(frame.time, abs=1e-9)
    labels, values = read_float64_multi_array(encoder.encode("energy", frame))
    assert dict(zip(labels, values.tolist(), strict=True)) == frame.energy
    assert [dim.label for dim in read("energy").layout.dim] == ["kinetic,stretch,bend,twist,coupling,gravity,barrier"]
    assert [dim.label for dim in read("stimulus_applied").layout.dim] == ["humidity"]
    state = read("state")
    (dim,) = state.layout.dim
    assert (dim.label, dim.size, dim.stride) == ("positions:329x3,velocities:329x3,step:1", 1975, 1975)
    np.testing.assert_array_equal(state.data, frame.state)
    wrench = read("contact_wrench/ball").wrench
    assert [wrench.force.x, wrench.torque.z] == frame.contact_wrenches[1, [0, 5]].tolist()
    pose = read("body_pose/hub").pose
    assert [pose.position.y, pose.orientation.w] == [frame.body_positions[0, 1], frame.body_quaternions[0, 3]]
    points = read("points")
    assert [field.name for field in points.fields] == "x y z strain curvature fx fy fz".split()
    cloud = points.data.view("<f4").reshape(-1, 8)
    np.testing.assert_array_equal(cloud[:, :3], frame.positions.astype(np.float32))
    np.testing.assert_array_equal(cloud[:, 3], frame.strain.astype(np.float32))
    np.testing.assert_array_equal(cloud[:, 4], frame.curvature.astype(np.float32))
    np.testing.assert_array_equal(cloud[:, 5:], frame.contact_forces.astype(np.float32))


@pytest.mark.parametrize("name", [name for name, spec in TOPICS.items() if spec.type == MULTI_ARRAY])
def test_strict_readers_give_an_array_its_shape_by_its_layout(name, encoder, typestore):
    frame = synthetic_run.random_frame(np.random.default_rng(4))
    message = typestore.deserialize_cdr(encoder.encode(name, frame), MULTI_ARRAY)
    assert message.data.reshape([dim.size for dim in message.layout.dim]).shape == (len(message.data),)


@pytest.mark.parametrize("names", [(), ("one",), ("one", "two"), ("rod barrier", "stimulus:a_b")])
def test_names_and_values_of_an_array_are_read_back(names, typestore):
    template = multi_array_template(names)
    template.views()["data"][:] = np.arange(len(names))
    data = template.to_bytes()
    found, values = read_float64_multi_array(data)
    assert (tuple(found), values.tolist()) == (names, [float(k) for k in range(len(names))])
    message = typestore.deserialize_cdr(data, MULTI_ARRAY)
    assert bytes(typestore.serialize_cdr(message, MULTI_ARRAY)) == data
    assert message.data.reshape([dim.size for dim in message.layout.dim]).shape == (len(names),)


def test_stamps_are_the_nearest_nanosecond():
    times = np.arange(1, 10_000)
    assert [nanoseconds(time * 1e-3) for time in times.tolist()] == (1_000_000 * times).tolist()


def test_the_axes_of_a_node_are_director_width_and_tangent(encoder, typestore):
    # Arm 1 of the closed gripper, half way along: its tangent has turned down, its director outwards.
    frame = synthetic_run.frame(2.0)
    poses = typestore.deserialize_cdr(encoder.encode("nodes", frame), TOPICS["nodes"].type).poses
    assert len(poses) == synthetic_run.NODES * 8
    node = DESCRIPTION.strands[3].nodes.start + 20
    q = poses[node].orientation
    x, y, z, w = q.x, q.y, q.z, q.w
    m1 = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    m3 = np.array([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])
    angle = 42.001 * 0.5 * synthetic_run.LENGTH
    np.testing.assert_allclose(m1, [0.0, np.sin(angle), np.cos(angle)], atol=1e-9)
    np.testing.assert_allclose(m3, [0.0, np.cos(angle), -np.sin(angle)], atol=1e-9)
    np.testing.assert_array_equal(
        [poses[node].position.x, poses[node].position.y, poses[node].position.z], frame.positions[node]
    )


@pytest.mark.parametrize(("model", "nodes"), [("laminate", 200), ("two_rod", 392)])
def test_points_are_the_nodes_in_their_order_and_then_contact_points_of_bodies(model, nodes, typestore):
    simulator = Simulator(load_scene("gripping"), model=model)
    encoder, topics = FrameEncoder(simulator.description), {of.name: of for of in output_topics(simulator.description)}
    decoded = {
        name: typestore.deserialize_cdr(encoder.encode(name, simulator.frame()), topics[name].type)
        for name in ("nodes", "points")
    }
    at = np.array([[p.position.x, p.position.y, p.position.z] for p in decoded["nodes"].poses])
    points = decoded["points"].data.view("<f4").reshape(-1, 8)
    assert (len(at), len(points)) == (nodes, nodes + 1)
    np.testing.assert_array_equal(points[:nodes, :3], at.astype("<f4"))
    assert points[nodes, 3:5].tolist() == [0.0, 0.0]


def test_markers_tile_ribbons_with_bars_and_show_forces_only_while_there_are_any(encoder, typestore):
    def markers(time):
        data = encoder.encode("markers", synthetic_run.frame(time))
        return {m.ns: m for m in typestore.deserialize_cdr(data, TOPICS["markers"].type).markers}

    closed, free = markers(2.0), markers(0.5)
    assert list(closed) == list(free)
    assert len(closed) == 8 + 2 + 1 + 2 + 1
    ribbon = closed["strands/arm_2/active"]
    assert ribbon.type == LINE_LIST
    ends = np.array([[p.x, p.y, p.z] for p in ribbon.points]).reshape(-1, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), synthetic_run.WIDTH, rtol=1e-9)
    assert ribbon.scale.x == pytest.approx(synthetic_run.LENGTH / (synthetic_run.NODES - 1), rel=0.05)
    assert ribbon.colors[0].r > ribbon.colors[0].b
    assert (closed["bodies/ball"].type, closed["bodies/ball"].scale.x) == (SPHERE, 2 * synthetic_run.RADIUS)
    ground = closed["obstacles/ground"]
    assert ground.pose.position.z + 0.5 * ground.scale.z == pytest.approx(0.0)
    assert (free["contact_forces"].action, len(free["contact_forces"].points)) == (DELETE, 0)
    arrows = closed["contact_forces"]
    assert (arrows.action, len(arrows.points)) == (ADD, 6 * 9 * 4)
    shaft = np.array([[p.x, p.y, p.z] for p in arrows.points[:2]])
    force = 0.02 * np.hypot(1.0, 0.4)
    assert np.linalg.norm(shaft[1] - shaft[0]) == pytest.approx(ARROW_DECADE * np.log10(1 + force / ARROW_FORCE))


@pytest.mark.parametrize("time", [0.5, 2.0], ids=["nothing touches", "with arrows"])
def test_an_array_that_deletes_all_first_shows_the_same_markers_after_that(time, encoder, typestore):
    kind = TOPICS["markers"].type
    plain = encoder.encode("markers", synthetic_run.frame(time))
    message = typestore.deserialize_cdr(deleting_all_first(plain), kind)
    assert bytes(typestore.serialize_cdr(message, kind)) == deleting_all_first(plain)
    first, *others = message.markers
    (alone,) = typestore.deserialize_cdr(delete_all(), kind).markers
    assert first.action == alone.action == DELETE_ALL == Marker.DELETEALL
    message.markers = others
    assert bytes(typestore.serialize_cdr(message, kind)) == plain


@pytest.mark.parametrize("name", [name for name in TOPICS if name not in ("energy", TF.name)])
def test_the_least_size_of_a_message_is_that_without_contacts(name, encoder):
    frame = synthetic_run.frame(0.0)
    free = replace(frame, contact_forces=np.zeros_like(frame.contact_forces))
    assert FrameEncoder(DESCRIPTION).least_size(name) == len(encoder.encode(name, free))


def test_display_topics_come_once_in_each_of_their_periods():
    gate = DisplayGate(50.0, 20.0)
    due = [round(time, 2) for time in np.arange(0, 0.3, 0.02) if gate.is_due(float(time))]
    assert due == [0.0, 0.06, 0.1, 0.16, 0.2, 0.26]
    assert {name for name, spec in TOPICS.items() if spec.rate is Rate.DISPLAY} == {"nodes", "points", "markers"}


def test_a_frame_is_encoded_in_less_than_a_millisecond(encoder):
    durations = []
    for step in range(20):
        frame = synthetic_run.frame(2.0 + 0.02 * step)
        start = time.perf_counter()
        for name in TOPICS:
            encoder.encode(name, frame)
        durations.append(time.perf_counter() - start)
    assert min(durations) < 1e-3  # 0.15 ms where it was measured
