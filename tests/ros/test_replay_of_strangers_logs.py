"""Logs of unknown origin: `replay_node` imports nothing that they name, and publishes nothing that would surprise."""

import pytest
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64
from support.written_logs import number, value_of, write_log

from bilayer_core.errors import InputError
from bilayer_sim_ros.node.message_types import installed_message_class
from bilayer_sim_ros.replay.stored_qos import offered_profile

PLANTED = """
from pathlib import Path
Path({trace!r}).write_text("imported")
class Thing:
    pass
"""


@pytest.fixture
def trace(tmp_path, monkeypatch):
    """A file that is written when somebody imports the module ``planted.msg``, which any Python here can import."""
    package, trace = tmp_path / "path" / "planted" / "msg", tmp_path / "trace"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").write_text("")
    (package / "__init__.py").write_text(PLANTED.format(trace=str(trace)))
    monkeypatch.syspath_prepend(package.parents[1])
    monkeypatch.setenv("PYTHONPATH", str(package.parents[1]), prepend=":")
    return trace


@pytest.mark.parametrize(
    "name",
    [
        "planted/msg/Thing",
        "os/msg/path",
        "os/msg/Path",
        "os.path/msg/Join",
        "../planted/msg/Thing",
        "std_msgs/msg/Nothing",
        "std_msgs/msg/Float64\n",
        "std_msgs/msg/msg/Float64",
        "std_srvs/srv/Empty",
        "",
    ],
)
def test_a_type_that_no_installed_package_of_messages_has_is_not_imported(name, trace):
    with pytest.raises(InputError, match="is no type of a message|is in no installed package of ROS messages"):
        installed_message_class(name)
    assert not trace.exists()


@pytest.mark.parametrize("source", ["rclpy", "environment"])
def test_types_of_installed_packages_are_found_with_and_without_a_sourced_environment(monkeypatch, tmp_path, source):
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    if source == "environment":
        index = tmp_path / "share/ament_index/resource_index/rosidl_interfaces"
        index.mkdir(parents=True)
        (index / "std_msgs").write_text("msg/Float64.idl\nmsg/Float64.msg\n")
        monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
        monkeypatch.setattr("bilayer_sim_ros.node.message_types._prefix_of_rclpy", lambda: tmp_path / "none")
    assert installed_message_class("std_msgs/msg/Float64") is Float64


def test_a_strangers_log_plays_what_is_plain_and_nothing_else(start, connect, domain, tmp_path, trace):
    types = {"/planted": "planted/msg/Thing", "/os": "os/msg/path"}
    left_out = {
        "/rosout": "the nodes that run now publish there",
        "/parameter_events": "the nodes that run now publish there",
        "clock": "the nodes that run now publish there",
        "~/description": "names of topics have parts",
        "/{node}/live": "names of topics have parts",
        "/escape\x1b[2J": "names of topics have parts",
        "/act/_action/status": "names of topics have parts",
        "/planted": "the type planted/msg/Thing is in no installed package",
        "/os": "'os/msg/path' is no type of a message",
    }
    topics = ["/plain", *left_out, "/torn", "/long"]
    data = {"/torn": number(0)[:6], "/long": number(0) + bytes(800)}
    messages = [(topic, 0.1 * k, data.get(topic, number(k))) for k in range(3) for topic in topics]
    # Without the conventions of ROS, this would be the topic in DDS of a request to a service.
    qos = {"/plain": "- depth: 3\n  avoid_ros_namespace_conventions: true\n"}
    log = write_log(tmp_path / "log.mcap", messages, types, qos)
    node = start("replay_node", domain, {"play.start_paused": True}, [str(log)])
    client = connect(node)
    heard, torn = [], []
    for topic, found in (("/plain", heard), ("/torn", torn)):
        subscription = client.node.create_subscription(Float64, topic, found.append, QoSProfile(depth=10), raw=True)
        client.spin_until(lambda of=subscription: of.get_publisher_count() > 0, f"a publisher of {topic}")
    assert {name for name, _ in client.node.get_topic_names_and_types()} >= {"/plain", "/torn", "/long"}
    assert client.node.count_publishers("/clock") == 0
    client.call("resume", "/bilayer_replay")
    client.spin_to_the_end()
    assert node.wait() == 0 and "Traceback" not in node.output
    assert [value_of(found) for found in heard] == [0, 1, 2]
    for topic, reason in left_out.items():
        (line,) = [line for line in node.output.splitlines() if f"as {reason}" in line or reason in line]
        assert topic.replace("\x1b", "\\x1b") in line
    assert node.output.count("topic /long: a message that cannot be sent is left out") == 1
    assert not trace.exists()


def test_a_log_cannot_ask_for_names_outside_of_ros():
    profile = offered_profile("- depth: 3\n  avoid_ros_namespace_conventions: true\n")
    assert not profile.avoid_ros_namespace_conventions and profile.depth == 3
