"""Two controllers on one channel: which are told that they contradict each other, and which are not."""

import time

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from bilayer_core.scene.schedule import Hold
from bilayer_sim_ros.control.contradictions import UNKNOWN, Contradictions, Source
from bilayer_sim_ros.control.stimulus import Channel

HEAT = Channel("heat", 0.0, 1.0, Hold(type="hold", value=0.0))
A, B, C = (Source("/stimulus_stamped", name) for name in (b"a", b"b", b"c"))


class Listened:
    """Contradictions with a clock and ticks of their own."""

    def __init__(self):
        self.time, self.tick, self.told = 0.0, 0, []
        self.heard = Contradictions(
            [HEAT], lambda: self.tick, lambda *told: self.told.append(told), clock=lambda: self.time
        )

    def send(self, *messages, every=0.01, ticks=1):
        for source, value in messages:
            self.heard.note({"heat": value}, source)
            self.time += every
            self.tick += ticks


def test_two_who_take_turns_with_other_values_are_told_once():
    listened = Listened()
    listened.send(*[(A, 0.2), (B, 0.8)] * 5)
    assert listened.told == [("heat", {A: 0.2, B: 0.8})]


def test_two_on_different_topics_are_told():
    listened, other = Listened(), Source("/stimulus/heat")
    listened.send((A, 0.2), (other, 0.8), (A, 0.2))
    assert listened.told == [("heat", {A: 0.2, other: 0.8})]


def test_slow_ones_within_one_control_period_are_told():
    listened = Listened()
    listened.send((A, 0.2), (B, 0.8), (A, 0.2), every=5.0, ticks=0)
    assert len(listened.told) == 1


@pytest.mark.parametrize(
    "messages",
    [
        [(A, 0.2), (A, 0.9), (A, 0.1)],
        [(A, 0.2), (A, 0.3), (B, 0.9), (B, 0.8), (C, 0.1), (C, 0.2)],
        [(A, 0.2), (B, 0.2), (A, 0.3), (B, 0.3), (A, 0.4)],
        [(A, 0.2), (B, 0.25), (A, 0.3), (B, 0.35), (A, 0.4)],
        [(A, 0.5), (B, 0.505), (A, 0.5), (B, 0.495), (A, 0.5)],
    ],
    ids=["one that jumps", "one after the other", "the same", "the same ramp", "within a hundredth"],
)
def test_one_alone_successors_and_those_who_agree_are_not_told(messages):
    listened = Listened()
    listened.send(*messages)
    assert listened.told == []


def test_one_that_comes_back_much_later_is_not_told():
    listened = Listened()
    listened.send((A, 0.2), (B, 0.8), (A, 0.2), every=5.0, ticks=250)
    assert listened.told == []


def _names(node, topic):
    """Return the names of the nodes that publish a topic, none before all of them are known."""
    names = [of.node_name for of in node.get_publishers_info_by_topic(topic)]
    return [] if UNKNOWN in names else names


def test_the_node_warns_once_with_channel_values_topics_and_nodes(contexts, noting_node):
    node = noting_node()
    client, other = Node("open_loop", context=contexts[1]), Node("closed_loop", namespace="lab", context=contexts[1])
    plain = client.create_publisher(Float64, "/bilayer_sim/stimulus/swelling", 10)
    stamped = other.create_publisher(JointState, "/bilayer_sim/stimulus_stamped", 10)
    executor, deadline = SingleThreadedExecutor(context=contexts[0]), time.monotonic() + 30.0
    executor.add_node(node)
    while not all(_names(node, topic) for topic in (plain.topic_name, stamped.topic_name)):
        assert time.monotonic() < deadline, "the controllers were not discovered"
        executor.spin_once(timeout_sec=0.02)
    for turn in range(200):
        plain.publish(Float64(data=0.25))
        stamped.publish(JointState(name=["swelling"], position=[0.75]))
        for _ in range(4):
            executor.spin_once(timeout_sec=0.02)
        if (node.lines and turn > 50) or time.monotonic() > deadline:
            break
    executor.shutdown()
    (line,) = node.lines
    assert line.startswith("stimulus 'swelling' gets ") and "contradict each other" in line
    assert "0.25 on /bilayer_sim/stimulus/swelling (/open_loop)" in line
    assert "0.75 on /bilayer_sim/stimulus_stamped (/lab/closed_loop)" in line
