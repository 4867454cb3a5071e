"""Names that miss a node by a letter: who says so, and of whom nothing is said."""

import time

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float32, Float64, Float64MultiArray

from bilayer_sim_ros.node import graph_watch
from bilayer_sim_ros.node.near_misses import of_topics
from bilayer_sim_ros.node.ros_arguments import remap_sources
from bilayer_sim_ros.simulation_node import SimulationNode

PREFIX = "/bilayer_sim/"
FLOAT, FLOATS = "std_msgs/msg/Float64", "std_msgs/msg/Float64MultiArray"
INPUTS = {"/bilayer_sim/stimulus": FLOATS, "/bilayer_sim/stimulus/humidity": FLOAT, "/bilayer_sim/load/tip": FLOAT}
OUTPUTS = {"/bilayer_sim/energy", "/bilayer_sim/state", "/clock"}


@pytest.mark.parametrize(
    ("topic", "type_name", "said"),
    [
        ("/bilayer_sim/stimulus/humidty", FLOAT, "did you mean /bilayer_sim/stimulus/humidity?"),
        ("/bilayer_sim/stimuls", FLOATS, "did you mean /bilayer_sim/stimulus?"),
        ("/bilayer_sim/stimulus/light", FLOAT, "there are /bilayer_sim/stimulus/humidity"),
        ("/bilayer_sim/stimulus/humidity", "std_msgs/msg/Float32", "which is not heard: it is std_msgs/msg/Float64"),
        ("/bilayer_sim/stimulus/humidity", FLOAT, None),
        ("/bilayer_sim/camera/image", "sensor_msgs/msg/Image", None),
        ("/bilayer_simulator/stimuls", FLOATS, None),
        ("/stimuls", FLOATS, None),
        ("/bilayer_sim/energy", FLOATS, None),
    ],
)
def test_a_publisher_that_is_not_heard_is_told_the_right_name(topic, type_name, said):
    found = of_topics(PREFIX, INPUTS, OUTPUTS, {topic: [type_name]}, [])
    assert (said in found[topic]) if said else found == {}


@pytest.mark.parametrize(
    ("topic", "said"),
    [
        ("/bilayer_sim/energi", "did you mean /bilayer_sim/energy?"),
        ("/bilayer_sim/energy", None),
        ("/bilayer_sim/statistics", None),
        ("/bilayer_sim/stimulus", None),
    ],
)
def test_a_subscriber_of_what_is_not_published_is_told_the_right_name(topic, said):
    found = of_topics(PREFIX, INPUTS, OUTPUTS, {}, [topic])
    assert (said in found[topic]) if said else found == {}


def test_remapped_names_are_read_from_the_command_line():
    argv = "sim_node -r no:=x --ros-args -r __node:=a -r ~/stimuls:=/s -p r:=1 --remap bilayer_sim:com:=/c -- -r d:=e"
    assert list(remap_sources(argv.split())) == ["~/stimuls", "com"]


@pytest.fixture
def node(noting_node, monkeypatch):
    """A node of the gripper that has a remapped topic."""
    monkeypatch.setattr(graph_watch, "PERIOD", 0.05)
    return noting_node("gripping", ["--ros-args", "-r", "~/stimulus:=/everything"], real_time_factor=0.0)


def test_a_near_miss_in_the_graph_is_warned_of_once(node, contexts):
    client = Node("client", context=contexts[1])
    client.create_publisher(Float64, "/bilayer_sim/stimulus/humidty", 10)
    client.create_publisher(Float32, "/everything", 10)
    client.create_subscription(Float64, "/bilayer_sim/energi", print, 10)
    client.create_subscription(Float64, "/bilayer_sim/image", print, 10)
    executor = SingleThreadedExecutor(context=contexts[0])
    executor.add_node(node)
    for _ in range(400):
        executor.spin_once(timeout_sec=0.05)
        if len(node.lines) >= 3:
            break
    for _ in range(6):
        executor.spin_once(timeout_sec=0.05)
    executor.shutdown()
    assert sorted(node.lines) == [
        "/bilayer_sim/energi is listened to, but not published: did you mean /bilayer_sim/energy?",
        "/bilayer_sim/stimulus/humidty is published, but not heard: did you mean /bilayer_sim/stimulus/humidity?",
        "/everything is published as std_msgs/msg/Float32, which is not heard: it is std_msgs/msg/Float64MultiArray",
    ]


def test_those_who_listen_and_can_hear_nothing_are_warned_of_once(node, contexts):
    client = Node("client", context=contexts[1])
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    lossy = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    client.create_subscription(Float64MultiArray, "/bilayer_sim/energy", print, kept)
    client.create_subscription(Float64, "/bilayer_sim/com", print, 10)
    client.create_subscription(Float64MultiArray, "/bilayer_sim/solver", print, lossy)
    watch, deadline = graph_watch.GraphWatch(node), time.monotonic() + 20.0
    while len(node.lines) < 2 and time.monotonic() < deadline:
        watch.look()
    watch.look()
    type_missed, quality_missed = sorted(node.lines)
    assert type_missed == (
        "/bilayer_sim/com is listened to as std_msgs/msg/Float64, which is not sent: "
        "it is geometry_msgs/msg/PointStamped"
    )
    assert quality_missed == (
        "/bilayer_sim/energy is listened to by somebody who cannot hear it: "
        "Volatile publisher and transient local subscription"
    )


def test_a_second_clock_is_warned_of(node, contexts):
    other = SimulationNode("other", context=contexts[0], parameter_overrides=[Parameter("scene", value="bending")])
    try:
        watch, deadline = graph_watch.GraphWatch(node), time.monotonic() + 20.0
        while not node.lines and time.monotonic() < deadline:
            watch.look()
        assert "Set publish_clock to false for all but one" in node.lines[0]
    finally:
        other.destroy_node()


def test_a_remapping_that_touches_nothing_is_warned_of(node):
    given = "sim_node --ros-args -r ~/stimulus:=/everything -r ~/energi:=/e -r ~/paus:=/p -r /tf:=/b/tf"
    graph_watch.warn_of_unused_remaps(node, given.split())
    assert node.lines == [
        "~/energi is remapped, but is no name of this node: did you mean /bilayer_sim/energy?",
        "~/paus is remapped, but is no name of this node: did you mean /bilayer_sim/pause?",
    ]
