"""/tf beside a node: what is published where tf2_msgs is installed, and what is said where it is not."""

import importlib.util
import sys
from types import ModuleType, SimpleNamespace

import pytest
from support import synthetic_run

from bilayer_core.errors import InputError
from bilayer_core.log.messages.encoders import FrameEncoder
from bilayer_sim_ros.publishing.tf_topic import tf_prefix
from bilayer_sim_ros.publishing.topic_publishers import FramePublisher


class FakeNode:
    """Notes what is published, as bytes."""

    def __init__(self, name="/left/bilayer_sim"):
        self._name, self.sent = name, {}

    def get_fully_qualified_name(self):
        return self._name

    def create_publisher(self, kind, topic, quality, **_):
        sent = self.sent[topic] = SimpleNamespace(kind=kind, quality=quality, messages=[])
        return SimpleNamespace(publish=sent.messages.append, get_subscription_count=lambda: 1)


@pytest.fixture
def tf2_msgs(monkeypatch):
    """The type as one that is installed; its bytes are held against rosbags in tests/logs/test_encoders.py."""
    package, messages = ModuleType("tf2_msgs"), ModuleType("tf2_msgs.msg")
    package.__spec__ = importlib.util.spec_from_loader("tf2_msgs", None)
    messages.TFMessage = type("TFMessage", (), {})
    monkeypatch.setitem(sys.modules, "tf2_msgs", package)
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
    return messages


def test_every_frame_is_published_on_tf_under_the_name_of_the_node(tf2_msgs):
    node, description = FakeNode(), synthetic_run.description()
    prefix = tf_prefix(node, {"tf": True})
    assert prefix == "left/bilayer_sim"
    publisher = FramePublisher(node, description, 50.0, 20.0, True, prefix)
    for time in (0.0, 0.02, 0.04):
        publisher.publish(synthetic_run.frame(time))
    sent = node.sent["/tf"]
    assert sent.kind is tf2_msgs.TFMessage and sent.quality.depth == 100
    assert len(sent.messages) == 3 and len(node.sent["~/markers"].messages) == 1
    assert sent.messages[1] == FrameEncoder(description, prefix).encode("/tf", synthetic_run.frame(0.02))
    assert b"left/bilayer_sim/arm_0/start\0" in sent.messages[0]


def test_nobody_who_does_not_ask_gets_tf_or_needs_its_package():
    assert tf_prefix(FakeNode(), {"tf": False}) == ""
    node = FakeNode()
    FramePublisher(node, synthetic_run.description(), 50.0, 20.0, True)
    assert "/tf" not in node.sent


@pytest.mark.skipif(importlib.util.find_spec("tf2_msgs") is not None, reason="tf2_msgs is installed here")
def test_without_its_package_the_node_says_what_to_install(start, domain_of_module):
    with pytest.raises(InputError, match="the Python package 'tf2_msgs' of ROS 2 is not there"):
        tf_prefix(FakeNode(), {"tf": True})
    process = start("sim_node", domain_of_module, {"scene": "bending", "tf": True})
    assert process.wait() == 2
    (line,) = process.output.splitlines()
    assert "apt install ros-$ROS_DISTRO-tf2-msgs" in line and "allowed is False" in line
