"""Logs that `replay_node` plays to another process over DDS."""

import importlib
import os
import re
import signal
import subprocess
import time
from functools import partial

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from support.processes import bilayer, command, environment
from support.written_logs import LATCHED, number, value_of, write_log

from bilayer_core.cli import main
from bilayer_core.log.file.indexed_log import IndexedLog
from bilayer_core.log.run.log_reader import read_messages
from bilayer_sim_ros.node.parameters import REPLAY_NODE
from bilayer_sim_ros.replay.log_replay import playback_of

NODE = "/bilayer_replay"
PAUSED = {"play.start_paused": True}
DEEP = QoSProfile(depth=1000)


@pytest.fixture
def counted_log(tmp_path):
    """A log of numbers, one a tenth of a second: an old one, that says nothing of quality of service."""

    def write(name="counted.mcap", count=100, period=0.1, first=0.0):
        messages = [("/bilayer_sim/number", index * period, number(first + index)) for index in range(count)]
        return write_log(tmp_path / name, messages)

    return write


def listen(client, topic, ros_type=Float64, qos=DEEP):
    """A list that grows with the bytes of every message, once a publisher is there."""
    found = []
    subscription = client.node.create_subscription(ros_type, topic, found.append, qos, raw=True)
    client.spin_until(lambda: subscription.get_publisher_count() > 0, f"a publisher of {topic}")
    return found


def numbers(found):
    return [value_of(data) for data in found]


def message_class(ros_type):
    package, _, name = ros_type.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def test_every_message_arrives_byte_for_byte_on_the_topics_of_the_node_and_no_clock(start, connect, domain, run_log):
    node = start("replay_node", domain, PAUSED, [str(run_log)])
    client = connect(node)
    logged, types = {}, {}
    for topic, ros_type, _, data in read_messages(run_log):
        types[topic] = ros_type
        if data is not None:
            logged.setdefault(topic, []).append(data)
    assert len(logged.pop("/clock")) == 26 and len(logged) > 10
    received = {
        topic: listen(client, topic.replace("/bilayer_sim", NODE), message_class(types[topic])) for topic in logged
    }
    assert client.node.count_publishers("/clock") == 0
    assert client.call("resume", NODE).success
    client.spin_to_the_end()
    assert node.wait() == 0, node.output
    # DDS pads what it carries to a multiple of four bytes.
    padded = {topic: [data + bytes(-len(data) % 4) for data in messages] for topic, messages in logged.items()}
    assert received == padded
    assert "services (std_srvs/Trigger): ~/pause ~/resume ~/toggle_paused ~/is_paused ~/play_next ~/stop" in node.output


def test_two_logs_play_side_by_side_under_the_names_of_their_nodes(start, connect, domain, counted_log):
    nodes = {}
    for name, first in (("one", 0.0), ("two", 1000.0)):
        log = counted_log(f"{name}.mcap", count=3, first=first)
        nodes[name] = start("replay_node", domain, PAUSED, [str(log), "--ros-args", "-r", f"__node:={name}"])
    client = connect(nodes["one"])
    heard = {name: listen(client, f"/{name}/number") for name in nodes}
    assert client.call("play_next", "/two").success
    client.spin_until(lambda: heard["two"], "the message")
    assert client.call("resume", "/one").success
    client.spin_to_the_end()
    assert numbers(heard["one"]) == [0, 1, 2]
    assert numbers(heard["two"]) == [1000]
    assert nodes["two"].running
    assert client.node.count_publishers("/bilayer_sim/number") == 0


def test_services_and_live_parameters_move_a_paused_player(start, connect, domain, counted_log):
    node = start("replay_node", domain, PAUSED | {"play.position": 0.4}, [str(counted_log())])
    client = connect(node)
    heard = listen(client, f"{NODE}/number")

    def said(name):
        answer = client.call(name, NODE)
        return answer.success, answer.message

    assert said("is_paused") == (True, "paused at t = 0.4 s")
    assert said("play_next") == (True, "sent /bilayer_sim/number of t = 0.4 s")
    assert client.set_parameter("play.position", 7.25, NODE).successful
    assert client.get_parameter("play.position", NODE) == 7.25
    assert said("is_paused") == (True, "paused at t = 7.25 s")
    assert said("play_next") == (True, "sent /bilayer_sim/number of t = 7.3 s")
    assert client.get_parameter("play.position", NODE) == 7.3
    refused = client.set_parameter("play.position", 12.0, NODE)
    assert not refused.successful and refused.reason == "t = 12 s is not in what is played, which is 0 to 9.9 s"
    for value in (0.0, -1.0, float("nan"), "fast"):
        refused = client.set_parameter("play.rate", value, NODE)
        assert not refused.successful and "allowed is a finite number > 0" in refused.reason
    assert not client.set_parameter("play.loop", True, NODE).successful
    assert client.set_parameter("play.rate", 1e-3, NODE).successful
    assert said("toggle_paused")[1].startswith("playing at t = 7.3")
    assert said("is_paused")[0] is False
    assert said("play_next") == (False, "the log is being played: call pause first")
    assert client.set_parameter("play.rate", 50, NODE).successful  # an integer will do
    client.spin_to_the_end()
    assert node.wait() == 0
    assert numbers(heard) == [4, *range(73, 100)]


def test_a_stop_ends_the_node_and_is_answered(start, connect, domain, counted_log):
    node = start("replay_node", domain, PAUSED, [str(counted_log())])
    answer = connect(node).call("stop", NODE)
    assert (answer.success, answer.message) == (True, "stopped at t = 0 s")
    assert node.wait(30) == 0


def test_offset_duration_and_rate_bound_what_is_sent_and_the_clock_follows(start, connect, domain, counted_log):
    parameters = {"play.start_offset": 1.0, "play.playback_duration": 0.5, "play.clock_publish_frequency": 100.0}
    node = start("replay_node", domain, PAUSED | parameters | {"log": counted_log(), "play.rate": 0.5})
    client = connect(node)
    heard, clock = listen(client, f"{NODE}/number"), client.listen(Clock, "/clock")
    begin = time.monotonic()
    assert client.call("resume", NODE).success
    client.spin_to_the_end()
    assert time.monotonic() - begin >= 1.0
    assert node.wait() == 0
    assert numbers(heard) == [10, 11, 12, 13, 14, 15]
    times = [message.clock.sec + message.clock.nanosec * 1e-9 for message in clock]
    assert times == sorted(times) and times[0] == 1.0 and times[-1] <= 1.5 and len(set(times)) > 20


def test_playing_ends_at_a_time_of_the_log_and_a_clock_comes_before_each_message(start, connect, domain, counted_log):
    parameters = {"play.start_offset": 1.0, "play.playback_until_timestamp": 1.5}
    clocked = parameters | {"play.clock_publish_on_topic_publish": True}
    node = start("replay_node", domain, PAUSED | clocked | {"log": counted_log()})
    client = connect(node)
    heard, clock = listen(client, f"{NODE}/number"), listen(client, "/clock", Clock)
    assert client.call("resume", NODE).success
    client.spin_to_the_end()
    assert node.wait() == 0
    assert numbers(heard) == [10, 11, 12, 13, 14, 15]
    stamps = [deserialize_message(data, Clock).clock for data in clock]
    times = [stamp.sec + stamp.nanosec * 1e-9 for stamp in stamps]
    assert times == pytest.approx([1.0, 1.1, 1.2, 1.3, 1.4, 1.5])


@pytest.mark.parametrize(
    ("offset", "duration", "until", "end"),
    [
        (0.0, -1.0, -1.0, 9.9),
        (1.0, -1.0, 2.5, 2.5),
        (1.0, 0.5, 2.5, 2.5),
        (1.0, 4.0, 2.5, 5.0),
        (1.0, -1.0, 1e300, 9.9),
        (1.0, -1.0, 1.0, 1.0),
        (1.0, 2.0, 0.5, 3.0),
    ],
)
def test_of_duration_and_time_the_later_one_ends_playing(counted_log, offset, duration, until, end):
    given = {"play.start_offset": offset, "play.playback_duration": duration, "play.playback_until_timestamp": until}
    with IndexedLog(counted_log()) as log:
        found = playback_of(log, {parameter.name: parameter.default for parameter in REPLAY_NODE} | given)
    assert (found.begin, found.end) == pytest.approx((offset * 1e9, end * 1e9))


@pytest.mark.parametrize("number_of_signal", [signal.SIGINT, signal.SIGTERM])
def test_a_loop_goes_on_until_a_signal_ends_the_node_with_0(start, connect, domain, counted_log, number_of_signal):
    log = counted_log(count=5, period=0.02)
    node = start("replay_node", domain, {"play.loop": True}, [str(log)])
    client = connect(node)
    heard = listen(client, f"{NODE}/number")
    client.spin_until(lambda: len(heard) > 11, "three passes")
    node.send(number_of_signal)
    node.send(number_of_signal)
    assert node.wait(30) == 0, node.output
    assert "Traceback" not in node.output and "ended at t = " in node.output


def test_topics_are_offered_as_they_were_and_late_listeners_get_what_is_latched(start, connect, domain, tmp_path):
    best_effort = "- history: keep_last\n  depth: 3\n  reliability: best_effort\n  durability: volatile\n"
    messages = [("/map", 0.0, number(1)), ("/map", 2.0, number(2)), ("/fast", 3.0, number(3)), ("/old", 3.0, number(4))]
    messages += [("/broken", 3.0, number(5))]
    qos = {"/map": LATCHED, "/fast": best_effort, "/broken": "- history: 99\n"}
    log = write_log(tmp_path / "run.mcap", messages, qos=qos)
    node = start("replay_node", domain, PAUSED | {"play.start_offset": 2.5}, [str(log)])
    client = connect(node)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    heard = listen(client, "/map", qos=latched)
    client.spin_until(lambda: heard, "what is latched")
    assert client.set_parameter("play.position", 1.0, NODE).successful
    client.spin_until(lambda: len(heard) > 1, "what was latched before")
    late = listen(client, "/map", qos=latched)
    client.spin_until(lambda: late, "what is latched now")
    assert (numbers(heard), numbers(late)) == ([2, 1], [1])
    offered = {}
    for topic in ("/map", "/fast", "/old", "/broken"):
        (found,) = client.spin_until(partial(client.node.get_publishers_info_by_topic, topic), f"{topic}")
        offered[topic] = found.qos_profile
    reliable, volatile = ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE
    assert {topic: (profile.reliability, profile.durability) for topic, profile in offered.items()} == {
        "/map": (reliable, DurabilityPolicy.TRANSIENT_LOCAL),
        "/fast": (ReliabilityPolicy.BEST_EFFORT, volatile),
        "/old": (reliable, volatile),
        "/broken": (reliable, volatile),
    }
    assert "topic /broken: its quality of service is not in the form of rosbag2" in node.output


def test_what_cannot_be_published_is_named_once_and_the_rest_is_played(start, connect, domain, tmp_path):
    topics = ("/good", "/alien", "/alien_too", "/misnamed", "/no topic")
    types = {"/alien": "aliens/msg/Ship", "/alien_too": "aliens/msg/Ship", "/misnamed": "Float64"}
    log = write_log(tmp_path / "run.mcap", [(topic, 0.1 * k, number(k)) for k in range(3) for topic in topics], types)
    node = start("replay_node", domain, PAUSED, [str(log)])
    client = connect(node)
    heard = listen(client, "/good")
    client.call("resume", NODE)
    client.spin_to_the_end()
    assert node.wait() == 0 and numbers(heard) == [0, 1, 2]
    assert node.output.count("aliens/msg/Ship is in no installed package") == 1
    assert "/alien, /alien_too" in node.output
    assert "'Float64' is no type of a message, such as 'std_msgs/msg/Float64': /misnamed" in node.output
    assert "/no topic" in node.output
    assert "Traceback" not in node.output


def test_the_command_plays_a_log_and_tells_that_it_cannot_keep_up(counted_log, domain, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    done = bilayer("replay", counted_log(count=20_000, period=0.01), "--ros", "--rate", "1e6")
    assert done.returncode == 0, done.stderr
    assert "playing " in done.stderr and "cannot keep up with play.rate = 1e+06" in done.stderr
    assert re.search(r"ended at t = 199\.99 s; \d\.\d\d s later than play\.rate asked", done.stderr)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rate", "0"], "--rate: 0 is not allowed; it must be a finite number > 0"),
        (["--from", "1"], "say either --verify"),
        (["--stimulus", "humidity=1"], "--stimulus: is not for --ros"),
        (["--force"], "--force: is not for --ros"),
    ],
)
def test_options_that_the_command_cannot_heed_are_refused(counted_log, arguments, said, capsys):
    assert main(["replay", str(counted_log()), "--ros", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_rate_and_loop_without_ros_are_refused(counted_log, capsys):
    log = str(counted_log())
    for option in (["--loop"], ["--rate", "2"]):
        assert main(["replay", log, "--verify", *option]) == 2
        assert f"{option[0]}: is for --ros" in capsys.readouterr().err


def test_where_ros_is_missing_the_command_says_so_with_exit_code_2(counted_log, tmp_path):
    absent = tmp_path / "absent"
    absent.mkdir()
    (absent / "rclpy.py").write_text("raise ModuleNotFoundError(\"No module named 'rclpy'\", name='rclpy')\n")
    surroundings = environment()
    surroundings["PYTHONPATH"] = f"{absent}{os.pathsep}{surroundings['PYTHONPATH']}"
    run = [*command("replay", counted_log(), "--ros")]
    done = subprocess.run(run, env=surroundings, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "pip install 'bilayer_sim_ros[ros]'" in done.stderr and "Traceback" not in done.stderr


def test_a_log_that_was_cut_off_is_refused_with_what_repairs_it_and_then_plays(run_log, start, domain, tmp_path):
    cut, new = tmp_path / "cut.mcap", tmp_path / "NEW.mcap"
    cut.write_bytes(run_log.read_bytes()[:-100])
    refused = start("replay_node", domain, arguments=[cut])
    assert refused.wait() == 2
    assert f"{cut}: has no index" in refused.output and "Traceback" not in refused.output
    (repair,) = re.findall(r"bilayer (repair \S+) NEW\.mcap", refused.output)
    assert main([*repair.split(), str(new)]) == 0
    played = start("replay_node", domain, {"play.rate": 10.0}, [new])
    assert played.wait() == 0 and "ended at t = 0.5 s" in played.output, played.output


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({}, "no log is given"),
        ({"log": "none.mcap"}, "none.mcap: cannot be read"),
        ({"play.raet": 2.0}, "no parameter 'play.raet': did you mean 'play.rate'?"),
        ({"play.rate": 0.0}, "'play.rate' is 0.0; allowed is a finite number > 0"),
        ({"play.loop": 1}, "'play.loop' is 1; allowed is true or false"),
        ({"services": "rosbag"}, "one of std_srvs, rosbag2"),
        ({"play.start_offset": 99.0}, "'play.start_offset' is 99; "),
        (
            {"play.start_offset": 0.1, "play.playback_until_timestamp": 0.05},
            "'play.playback_until_timestamp' is 0.05; ",
        ),
        ({"play.position": 99.0}, "'play.position' is 99; "),
        ({"play.clock_from_log": True}, "'play.clock_from_log' is true, and "),
        (
            {"play.clock_from_log": True, "play.clock_publish_frequency": 40.0},
            "'play.clock_from_log' is true, and 'play.clock_publish_frequency' asks for another /clock",
        ),
        ({"services": "rosbag2"}, "rosbag2_interfaces"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_a_bad_parameter_ends_the_player_with_exit_code_2_and_one_message(start, domain, counted_log, parameters, said):
    log = {} if said == "no log is given" else {"log": counted_log()}
    node = start("replay_node", domain, log | parameters)
    assert node.wait() == 2
    assert said in node.output
    assert "Traceback" not in node.output
