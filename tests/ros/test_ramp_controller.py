"""The controller beside a simulation node: two processes, connected by topics alone."""

import signal
import threading
import time

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from bilayer_core.log.run.log_reader import read_log
from bilayer_sim_ros.controllers.ramp_controller import FINAL_MESSAGES, RampController, ramp

DURATION = 1.0


@pytest.mark.parametrize(("elapsed", "value"), [(-1.0, 2.0), (0.0, 2.0), (2.5, 5.0), (10.0, 14.0), (99.0, 14.0)])
def test_a_ramp_is_linear_and_constant_before_and_after(elapsed, value):
    assert ramp(elapsed, 10.0, 2.0, 14.0) == value


@pytest.fixture
def controller(domain, monkeypatch, request):
    """A controller in this process, connected to nobody: itself, and what it has answered."""
    arguments = [part for name, value in request.param.items() for part in ("-p", f"{name}:={value}")]
    monkeypatch.setattr(RampController, "connected", True)
    rclpy.init(args=["--ros-args", *arguments], domain_id=domain)
    node, answers = RampController(), []
    monkeypatch.setattr(node.publisher, "publish", answers.append)
    yield node, answers
    node.destroy_node()
    rclpy.shutdown()


def stamp(nanoseconds):
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


@pytest.mark.parametrize("controller", [{}, {"hold": "true"}], indirect=True, ids=["ends", "holds"])
def test_each_time_is_answered_once_until_the_end_value_has_been_sent_often_enough(controller):
    node, answers = controller
    start = 4_000_000_000
    times = (0, 0, 500_000_000, 500_000_000, *range(1_000_000_000, 1_000_000_000 + FINAL_MESSAGES))
    for now in times:
        assert not node.done.done()
        node.hear(stamp(start + now))
    assert [list(answer.position) for answer in answers] == [[0.0], [0.5]] + [[1.0]] * FINAL_MESSAGES
    assert [answer.header.stamp for answer in answers] == [stamp(start + now) for now in dict.fromkeys(times)]
    assert {tuple(answer.name) for answer in answers} == {("humidity",)}
    assert node.done.done() is not node.hold


@pytest.mark.parametrize("controller", [{"hold": "true"}], indirect=True, ids=["holds"])
def test_when_time_goes_back_the_ramp_begins_again(controller):
    node, answers = controller
    for now in (0, 500_000_000, 2_000_000_000, 0, 250_000_000, 250_000_000):
        node.hear(stamp(now))
    assert [answer.position[0] for answer in answers] == [0.0, 0.5, 1.0, 0.0, 0.25]


def test_in_lockstep_the_ramp_acts_exactly_at_each_time_and_holds_until_interrupted(start, domain, tmp_path):
    path = tmp_path / "run.mcap"
    parameters = {"scene": "bending", "log": path, "duration": 0.4, "lockstep": True, "real_time_factor": 0.0}
    simulation = start("sim_node", domain, parameters | {"start_paused": True, "rate": 50.0})
    controller = start(
        "controllers.ramp_controller", domain, {"channel": "swelling", "duration": 0.2, "hold": True, "resume": True}
    )
    assert simulation.wait() == 0, simulation.output
    # A frame shows the stimulus of the step that ends with it, and that of a tick is reached at the next one.
    expected = [ramp(k / 50, 0.2, 0.0, 1.0) for k in range(20)]
    assert read_log(path).stimulus[1:, 0].tolist() == pytest.approx(expected, abs=1e-15)
    assert controller.running
    controller.send(signal.SIGINT)
    assert controller.wait(10) == 0, controller.output


@pytest.fixture(scope="module")
def log(domain_of_module, start, tmp_path_factory):
    """The log of a run whose controller took the stimulus from 0.25 to 0.75."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    simulation = start(
        "sim_node",
        domain_of_module,
        {"scene": "bending", "log": path, "start_paused": True, "duration": 1.5 * DURATION, "real_time_factor": 0.5},
    )
    controller = start(
        "controllers.ramp_controller",
        domain_of_module,
        {"channel": "swelling", "start_value": 0.25, "end_value": 0.75, "duration": DURATION, "resume": True},
    )
    assert controller.wait() == 0, controller.output
    assert simulation.wait() == 0, simulation.output
    return path


@pytest.fixture(scope="module")
def run(log):
    return read_log(log)


def test_the_stimulus_follows_the_ramp_in_simulated_time(run):
    expected = np.array([ramp(time, DURATION, 0.25, 0.75) for time in run.times])
    # The controller hears of a time after it was simulated: the stimulus is late, and never early.
    late = (expected - run.stimulus[:, 0])[run.times > 0.2]
    assert late.min() > -1e-9
    assert late.max() < 0.05


def test_the_end_value_stays_after_the_controller_has_ended(run):
    assert np.all(run.stimulus[run.times > 1.3 * DURATION, 0] == 0.75)


def test_before_the_first_message_the_start_of_the_schedule_is_held(run):
    assert run.stimulus[0, 0] == 0.0


def test_each_stimulus_is_logged_at_the_time_from_which_it_acts(log, run):
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        messages = [
            (message.log_time * 1e-9, decoded.data)
            for _, _, message, decoded in reader.iter_decoded_messages(topics=["/bilayer_sim/stimulus/swelling"])
        ]
    assert len({value for _, value in messages}) > 10
    # A frame shows the stimulus of the step that ends with it.
    for end, applied in zip(run.times[1:], run.stimulus[1:, 0], strict=True):
        assert applied == [value for since, value in messages if since < end - 1e-9][-1]


def test_a_controller_without_a_simulation_gives_up_with_exit_code_2(start, domain):
    controller = start("controllers.ramp_controller", domain, {"connection_timeout": 0.5, "use_sim_time": True})
    assert controller.wait() == 2
    assert "nobody subscribes to /bilayer_sim/stimulus/humidity (waited 0.5 s)" in controller.output


@pytest.fixture
def subscriber(domain):
    """Somebody who listens to the stimulus, and publishes no time: the values heard so far."""
    values = []
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node("robot", context=context)
    node.create_subscription(Float64, "/bilayer_sim/stimulus/humidity", lambda message: None, 10)
    node.create_subscription(
        JointState, "/bilayer_sim/stimulus_stamped", lambda message: values.append(message.position[0]), 10
    )
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    yield values
    executor.shutdown()
    thread.join()
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_without_a_clock_the_controller_does_not_take_real_time_for_simulated(start, domain, subscriber):
    controller = start("controllers.ramp_controller", domain, {"connection_timeout": 4.0, "use_sim_time": True})
    assert controller.wait() == 2
    assert "/clock is silent, and simulated_time is true (waited 4 s)" in controller.output
    assert not subscriber


def test_a_ramp_in_real_time_needs_no_clock(start, domain, subscriber):
    begin = time.monotonic()
    controller = start(
        "controllers.ramp_controller", domain, {"simulated_time": False, "duration": 0.5, "use_sim_time": True}
    )
    assert controller.wait() == 0, controller.output
    assert time.monotonic() - begin > 0.5
    assert subscriber[-1] == 1.0 and len(set(subscriber)) > 10
    assert np.all(np.diff(subscriber) >= 0.0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_waiting_controller_can_be_interrupted(start, domain, number):
    controller = start("controllers.ramp_controller", domain, {"connection_timeout": 100.0})
    controller.wait_for("waiting for a subscriber")
    controller.send(number)
    assert controller.wait(10) == 0, controller.output
