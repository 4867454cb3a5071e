"""One node, paused at the start, and what its topics and services do. Every test begins with a reset."""

import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped, PoseArray
from rcl_interfaces.msg import Log, ParameterDescriptor
from rcl_interfaces.srv import DescribeParameters
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, Float64MultiArray
from visualization_msgs.msg import Marker, MarkerArray

from bilayer_core import Simulator, load_scene
from bilayer_sim_ros.publishing.conversions import to_seconds

SCENE = "bending"
PERIOD = 0.02


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENE)


@pytest.fixture(scope="module")
def process(domain_of_module, start):
    parameters = {"scene": SCENE, "start_paused": True, "rate": 50, "real_time_factor": 1}
    return start("sim_node", domain_of_module, parameters)


@pytest.fixture(scope="module")
def client(process, connect):
    return connect(process)


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


def step(client, *topics):
    """The messages of some topics after one more output period."""
    client.drain()
    counts = [len(messages) for messages in topics]
    assert client.call("step").success

    def arrived():
        return all(len(messages) > count for messages, count in zip(topics, counts, strict=True))

    client.spin_until(arrived, "messages after a step")
    new = [messages[count] for messages, count in zip(topics, counts, strict=True)]
    return new if len(new) > 1 else new[0]


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
    found = until(client, applied, lambda message: list(message.data) == values)
    (dimension,) = found.layout.dim
    assert dimension.label.split(",") == list(scene.stimuli) and dimension.size == dimension.stride == len(values)


@pytest.mark.parametrize("bad", [[math.nan], [], [0.5, 0.5], [1e9]], ids=["nan", "empty", "too long", "out of range"])
def test_a_bad_stimulus_is_refused_with_a_warning_and_the_last_good_value_stays(client, process, heard, scene, bad):
    applied = heard(Float64MultiArray, "stimulus_applied")
    good = [0.75 * stimulus.maximum for stimulus in scene.stimuli.values()]
    send = client.sender(Float64MultiArray, "/bilayer_sim/stimulus")
    send(Float64MultiArray(data=good))
    until(client, applied, lambda message: list(message.data) == good)
    warnings = process.output.count("refused")

    def warned():
        send(Float64MultiArray(data=bad))
        return process.output.count("refused") > warnings

    client.spin_until(warned, "a warning that is not throttled", limit=10.0)
    assert list(step(client, applied).data) == good


def test_warnings_about_bad_stimuli_are_throttled(client, process):
    send = client.sender(Float64MultiArray, "/bilayer_sim/stimulus")
    before = process.output.count("refused")
    sent = 0

    def two_warnings():
        nonlocal sent
        send(Float64MultiArray(data=[math.nan]))
        sent += 1
        return process.output.count("refused") >= before + 2

    client.spin_until(two_warnings, "two warnings", limit=10.0)
    assert sent > 10


def test_markers_show_every_layer_where_the_simulation_has_it(client, heard, scene):
    applied, states = heard(Float64MultiArray, "stimulus_applied"), heard(Float64MultiArray, "state")
    full = [stimulus.maximum for stimulus in scene.stimuli.values()]
    client.sender(Float64MultiArray, "/bilayer_sim/stimulus")(Float64MultiArray(data=full))
    until(client, applied, lambda message: list(message.data) == full)
    array, state = step(client, heard(MarkerArray, "markers"), states)
    markers = array.markers
    simulator = Simulator(scene)
    at_rest = simulator.positions
    simulator.load_state(np.array(state.data))
    assert np.abs(simulator.positions - at_rest).max() > 1e-4
    shown = {marker.ns: marker for marker in markers}
    for layer in simulator.description.layers:
        marker = shown[f"strands/{layer.name}"]
        bars = np.array([[point.x, point.y, point.z] for point in marker.points]).reshape(-1, 2, 3)
        across = bars[:, 1] - bars[:, 0]
        beside = bars.mean(axis=1) - simulator.positions[layer.nodes]
        assert np.linalg.norm(beside, axis=1) == pytest.approx(np.abs(layer.offset), abs=1e-9)
        assert np.einsum("ni,ni->n", beside, across) == pytest.approx(np.zeros(len(across)), abs=1e-9)
        assert np.linalg.norm(across, axis=1) == pytest.approx(layer.width)
        assert len(marker.colors) == len(marker.points)
    assert {marker.header.frame_id for marker in markers} == {"world"}
    assert len(shown) == len(markers)


def deletions(messages):
    return [[marker.action for marker in message.markers].count(Marker.DELETEALL) for message in messages]


def test_each_viewer_first_deletes_the_markers_of_another_robot_and_once(client, heard):
    early = heard(MarkerArray, "markers")
    client.drain()
    seen = len(early)
    late = client.listen(MarkerArray, "/bilayer_sim/markers")
    client.spin_until(lambda: len(late) == 3, "the paused frame again")  # repeated once a second
    assert late[0].markers[0].action == Marker.DELETEALL and len(late[0].markers) > 1
    assert deletions(late) == [1, 0, 0]
    client.drain()
    assert sum(deletions(early[seen:])) == 1


def test_the_first_markers_after_a_reset_delete_those_before(client, heard):
    markers = heard(MarkerArray, "markers")
    step(client, markers)
    client.drain()
    seen = len(markers)
    assert client.call("reset").success
    client.spin_until(lambda: len(markers) > seen, "markers of the start")
    assert deletions(markers[seen:])[0] == 1


def test_all_outputs_of_one_step_carry_the_same_simulated_time(client, heard):
    messages = step(client, heard(PoseArray, "nodes"), heard(PointCloud2, "points"), heard(PointStamped, "com"))
    assert [to_seconds(message.header.stamp) for message in messages] == pytest.approx([PERIOD] * 3)


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
    client.spin_until(lambda: clock[-1] == clock[-2], "the paused time again")  # none is on its way any more
    before = to_seconds(clock[-1].clock)
    assert client.call("step").success
    client.spin_until(lambda: to_seconds(clock[-1].clock) > before, "a clock message of the step")
    stopped = to_seconds(clock[-1].clock)
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


def test_rates_may_be_set_at_any_time_and_are_told_as_events(client, heard):
    clock, nodes = heard(Clock, "/clock"), heard(PoseArray, "nodes")
    before, events = len(nodes), []
    client.node.create_subscription(Log, "/bilayer_sim/events", events.append, 100)
    try:
        client.spin_until(lambda: client.set_parameter("rate", 25.0).successful and events, "an event")
        assert [to_seconds(step(client, clock).clock) for _ in range(2)] == pytest.approx([0.04, 0.08], abs=1e-9)
        assert client.set_parameter("marker_rate", 12.5).successful
        assert client.set_parameter("real_time_factor", 0.4).successful
        assert client.call("resume").success
        client.spin_until(lambda: to_seconds(clock[-1].clock) > 0.25, "some time")
        assert client.call("pause").success
        client.drain()
        shown = sorted({round(to_seconds(message.header.stamp), 6) for message in nodes[before:]})
        assert {0.16, 0.24} <= set(shown) and 0.2 not in shown  # from 0.08 s on, at 12.5 Hz
        said = [event.msg for event in events if event.name == "setting"]
        assert said[0] == "rate is 25 Hz, marker_rate is 20 Hz" and "real_time_factor is 0.4" in said
    finally:
        for name, value in (("rate", 50.0), ("marker_rate", 0.0), ("real_time_factor", 1.0)):
            assert client.set_parameter(name, value).successful


def test_a_rate_above_that_of_the_scene_may_be_set_at_any_time(client, heard):
    clock = heard(Clock, "/clock")
    try:
        assert client.set_parameter("rate", 400.0).successful
        assert [to_seconds(step(client, clock).clock) for _ in range(4)] == pytest.approx(
            [0.0025, 0.005, 0.0075, 0.01], abs=1e-9
        )
    finally:
        assert client.set_parameter("rate", 50.0).successful


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("rate", -1.0, "-1"),
        ("rate", 2e6, "'rate' is 2e+06; allowed is at most 1e+06 Hz"),
        (
            "marker_rate",
            100.0,
            "'marker_rate' is 100; allowed is at most the rate of frames, 50 Hz: set 'rate' to that",
        ),
        ("real_time_factor", "fast", "parameter 'real_time_factor' is 'fast'; allowed is a finite number >= 0"),
        ("scene", "gripping", "read-only"),
    ],
)
def test_a_setting_that_cannot_be_is_refused_with_the_reason(client, name, value, reason):
    answer = client.set_parameter(name, value)
    assert not answer.successful
    assert reason in answer.reason


def test_parameters_say_what_they_mean_and_what_is_allowed(client):
    request = DescribeParameters.Request(names=["rate", "lockstep_timeout", "scene", "control_period"])
    rate, timeout, scene, _ = client.call("describe_parameters", kind=DescribeParameters, request=request).descriptors
    assert (rate.read_only, timeout.read_only) == (False, True)
    assert "frames published and logged" in rate.description and scene.additional_constraints == "a text"
    assert isinstance(rate, ParameterDescriptor) and rate.floating_point_range[0].from_value == 0.0
