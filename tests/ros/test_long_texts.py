"""What others send as names and texts, of any length and with any characters: warnings about it stay short."""

import time

import pytest
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from bilayer_core.errors import InputError
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.node import graph_watch
from bilayer_sim_ros.node.parameters import SIM_NODE, accept_all

LONG = "\x1b[31m" + "x" * 500_000
SHORT = 500
"""Characters."""


@pytest.fixture
def node(noting_node):
    return noting_node()


def assert_short(text):
    assert len(text) < SHORT and text.isprintable(), text[:SHORT]


def test_a_message_of_megabytes_of_names_is_refused_in_a_line(node, contexts):
    client = Node("client", context=contexts[1])
    publisher = client.create_publisher(JointState, "/bilayer_sim/stimulus_stamped", 10)
    executors = [SingleThreadedExecutor(context=context) for context in contexts]
    executors[0].add_node(node)
    executors[1].add_node(client)
    deadline = time.monotonic() + 30.0
    while publisher.get_subscription_count() == 0:
        assert time.monotonic() < deadline
        executors[0].spin_once(timeout_sec=0.05)
    publisher.publish(JointState(name=[f"{LONG[:10000]}{k}" for k in range(100)], position=[0.5]))
    publisher.publish(JointState(name=[LONG], position=[0.5]))
    asking = client.create_client(SetParameters, "/bilayer_sim/set_parameters")
    parameters = [Parameter("rate", value=LONG).to_parameter_msg()]
    answer = None
    while len(node.lines) < 2 or answer is None or not answer.done():
        assert time.monotonic() < deadline, node.lines
        if answer is None and asking.service_is_ready():
            answer = asking.call_async(SetParameters.Request(parameters=parameters))
        for executor in executors:
            executor.spin_once(timeout_sec=0.02)
    for executor in executors:
        executor.shutdown()
    assert "has 100 names (\\x1b[31mxxx" in node.lines[0] and "there is no stimulus '\\x1b[31mxxx" in node.lines[1]
    for line in (*node.lines, answer.result().results[0].reason):
        assert_short(line)


@pytest.mark.parametrize("refused", [{LONG: 1.0}, {"rate": LONG}, {"stimulus_fallback": LONG}, {"rate": [LONG] * 5}])
def test_a_parameter_that_is_refused_is_quoted_in_part(refused):
    with pytest.raises(InputError) as error:
        accept_all(SIM_NODE, refused)
    assert len(str(error.value)) < 2 * SHORT and "\x1b" not in str(error.value)  # with the names of all parameters


def test_the_frame_of_a_pose_is_quoted_in_part():
    message = PoseStamped()
    message.header.frame_id = LONG
    with pytest.raises(InputError) as error:
        Commands(pytest.fail).pose("hub", message)
    assert_short(str(error.value))


def test_the_number_of_warnings_about_topics_has_a_bound(node, monkeypatch):
    names = [(f"/bilayer_sim/stimuls{number}", ["std_msgs/msg/Float64"]) for number in range(3000)]
    monkeypatch.setattr(node, "get_topic_names_and_types", lambda: names)
    monkeypatch.setattr(node, "get_publishers_info_by_topic", lambda _: [type("Info", (), {"topic_type": "T"})])
    watch = graph_watch.GraphWatch(node)
    for _ in range(3):
        watch.look()
    assert len(node.lines) == graph_watch.MOST_WARNINGS + 1
    assert node.lines[-1] == f"{graph_watch.MOST_WARNINGS} warnings about topics were given; no more follow"
