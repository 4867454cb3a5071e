"""One node, paused at the start, and what its topics and services do. Every test begins with a reset."""

import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped, PoseArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, Float64MultiArray
from visualization_msgs.msg import MarkerArray

from bilayer_core import Simulator, load_scene
from bilayer_sim_ros.conversions import to_seconds

SCENE = "bending"
DOMAIN = 101
PERIOD = 0.02


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENE)


@pytest.fixture(scope="module")
def process(start):
    return start("sim_node", DOMAIN, {"scene": SCENE, "start_paused": True, "rate": 50, "real_time_factor": 0.0})


@pytest.fixture(scope="module")
def client(process, connect):
    return connect(DOMAIN)


@pytest.fixture(autouse=True)
def paused_at_the_start(client):
    assert client.call("pause").success
    assert client.call("reset").success


@pytest.fixture(scope="module")
def heard(client):
    """Messages of a topic, subscribed to once."""
    lists = {}

    def messages(message_type, name):
        if name not in lists:
            lists[name] = client.listen(message_type, name if name.startswith("/") else f"/bilayer_sim/{name}")
        return lists[name]

    return messages


def step(client, messages):
    """The first message after one more output period."""
    count = len(messages)
    assert client.call("step").success
    return client.spin_until(lambda: messages[count:], "a message after a step")[0]


def test_a_step_takes_one_output_period(client, heard):
    clock = heard(Clock, "/clock")
    times = [to_seconds(step(client, clock).clock) for _ in range(3)]
    assert times == pytest.approx([PERIOD, 2 * PERIOD, 3 * PERIOD], abs=1e-9)


def test_a_single_channel_message_changes_the_applied_stimulus(client, heard, scene):
    applied = heard(Float64MultiArray, "stimulus_applied")
    channel = next(iter(scene.stimuli))
    value = 0.625 * scene.stimuli[channel].maximum
    client.sender(Float64, f"/bilayer_sim/stimulus/{channel}")(Float64(data=value))
    message = until(client, applied, lambda message: message.data[0] == value)
    assert message.layout.dim[0].label == channel


def until(client, messages, condition):
    """Step until a message meets the condition; that message."""
    for _ in range(50):
        message = step(client, messages)
        if condition(message):
            return message
    raise AssertionError(f"no message met the condition; the last one: {message}")


def test_a_message_with_all_channels_changes_the_applied_stimulus(client, heard, scene):
    applied = heard(Float64MultiArray, "stimulus_applied")
    values = [0.375 * stimulus.maximum for stimulus in scene.stimuli.values()]
    client.sender(Float64MultiArray, "/bilayer_sim/stimulus")(Float64MultiArray(data=values))
    until(client, applied, lambda message: list(message.data) == values)


@pytest.mark.parametrize("bad", [[math.nan], [], [0.5, 0.5], [1e9]], ids=["nan", "empty", "too long", "out of range"])
def test_a_bad_stimulus_is_refused_with_a_warning_and_the_last_good_value_stays(client, process, heard, scene, bad):
    applied = heard(Float64MultiArray, "stimulus_applied")
    good = [0.75 * stimulus.maximum for stimulus in scene.stimuli.values()]
    send = client.sender(Float64MultiArray, "/bilayer_sim/stimulus")
    send(Float64MultiArray(data=good))
    until(client, applied, lambda message: list(message.data) == good)
    warnings = process.output.count("refused")
    send(Float64MultiArray(data=bad))
    client.spin_until(lambda: process.output.count("refused") > warnings, "a warning", limit=5.0)
    assert list(step(client, applied).data) == good


def test_warnings_about_bad_stimuli_are_throttled(client, process):
    send = client.sender(Float64MultiArray, "/bilayer_sim/stimulus")
    before = process.output.count("refused")
    for _ in range(200):
        send(Float64MultiArray(data=[math.nan]))
    client.spin_until(lambda: process.output.count("refused") > before, "a warning", limit=5.0)
    client.call("step")
    assert process.output.count("refused") - before <= 2


def test_markers_show_every_strand_where_the_simulation_has_it(client, heard, scene):
    markers = step(client, heard(MarkerArray, "markers")).markers
    simulator = Simulator(scene)
    simulator.run(PERIOD)
    for strand in simulator.description.strands:
        marker = next(marker for marker in markers if len(marker.points) == strand.nodes.stop - strand.nodes.start)
        drawn = np.array([[point.x, point.y, point.z] for point in marker.points])
        assert drawn == pytest.approx(simulator.positions[strand.nodes], abs=1e-9)
        assert len(marker.colors) == len(marker.points)
    assert {marker.header.frame_id for marker in markers} == {"world"}
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers)


def test_all_outputs_of_one_step_carry_the_same_simulated_time(client, heard):
    lists = [heard(PoseArray, "nodes"), heard(PointCloud2, "points"), heard(PointStamped, "com")]
    counts = [len(messages) for messages in lists]
    assert client.call("step").success
    for messages, count in zip(lists, counts, strict=True):
        client.spin_until(lambda: messages[count:], "a message")  # noqa: B023
    assert [to_seconds(messages[-1].header.stamp) for messages in lists] == pytest.approx([PERIOD] * 3)


def test_a_reset_brings_back_the_start(client, heard):
    com, clock = heard(PointStamped, "com"), heard(Clock, "/clock")
    first = step(client, com).point
    for _ in range(4):
        step(client, com)
    assert client.call("reset").success
    assert to_seconds(step(client, clock).clock) == pytest.approx(PERIOD)
    client.spin_until(lambda: to_seconds(com[-1].header.stamp) == pytest.approx(PERIOD), "the frame after the reset")
    assert com[-1].point == first


def test_resume_lets_time_grow_and_pause_stops_it(client, heard):
    clock = heard(Clock, "/clock")
    count = len(clock)
    assert client.call("resume").success
    client.spin_until(lambda: len(clock) >= count + 20, "twenty clock messages")
    assert client.call("pause").success
    stopped = to_seconds(step(client, clock).clock)
    times = [to_seconds(message.clock) for message in clock[count:]]
    assert times == sorted(times)
    assert stopped == max(times)
    assert step_time_stands_still(client, clock)


def step_time_stands_still(client, clock):
    """Whether the messages of a paused node all show the same time."""
    count = len(clock)
    client.spin_until(lambda: len(clock) >= count + 2, "two clock messages while paused", limit=10.0)
    return len({to_seconds(message.clock) for message in clock[count:]}) == 1


def test_a_step_of_a_running_simulation_is_refused(client):
    assert client.call("resume").success
    answer = client.call("step")
    assert not answer.success
    assert "pause" in answer.message


def test_diagnostics_come_about_once_a_second(client, heard):
    diagnostics = heard(DiagnosticArray, "/diagnostics")
    count = len(diagnostics)
    start = client.node.get_clock().now().nanoseconds
    client.spin_until(lambda: len(diagnostics) >= count + 3, "three diagnostics", limit=10.0)
    assert (client.node.get_clock().now().nanoseconds - start) * 1e-9 == pytest.approx(3.0, abs=1.2)
    status = diagnostics[-1].status[0]
    assert (status.level, status.message) == (DiagnosticStatus.OK, "paused")
    assert "real-time factor" in {value.key for value in status.values}
