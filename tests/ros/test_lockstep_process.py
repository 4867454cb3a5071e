"""Real nodes in lockstep: a controller that is late by chance, and none at all."""

import math
import random
import signal
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from support.logged_commands import stimuli_taken

from bilayer_core.jit.compile_all import compile_all, is_complete
from bilayer_core.log.run.log_reader import read_info
from bilayer_sim_ros.publishing.conversions import to_seconds

CHANNEL = "/bilayer_sim/stimulus/swelling"
LOCKSTEP = {"scene": "bending", "real_time_factor": 0, "lockstep": True}
LONGEST_DELAY = 0.02
"""Of the controller's answers, in real time [s]."""


def control_law(now):
    """Stimulus at simulated time `now` [s]; it uses all bits."""
    return 0.5 - 0.5 * math.cos(7.0 * now)


@pytest.fixture(scope="module")
def kernels():
    """All kernels, before nodes start: what two processes compile may differ in rounding."""
    if not is_complete():
        compile_all()


def run_with_a_late_controller(start, connect, domain, log, seed, **parameters):
    """Run a node to its end with a controller that answers each time once, after a random delay."""
    node = start("sim_node", domain, LOCKSTEP | {"log": log} | parameters)
    client = connect(node)
    delays = random.Random(seed)
    send = client.sender(Float64, CHANNEL)
    answered = set()

    def answer(message):
        now = to_seconds(message.clock)
        if now not in answered:
            answered.add(now)
            time.sleep(LONGEST_DELAY * delays.random())
            send(Float64(data=control_law(now)))

    client.node.create_subscription(Clock, "/clock", answer, 10)
    client.spin_to_the_end()
    assert node.wait() == 0, node.output
    return answered


def messages(log, topic):
    """Simulated times [ns] and bytes of all messages of a topic."""
    with log.open("rb") as file:
        return [(message.log_time, message.data) for _, _, message in make_reader(file).iter_messages(topics=[topic])]


def stimuli(log):
    """Since when [s] each stimulus acts, and its value."""
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            (m.log_time * 1e-9, decoded.data) for _, _, m, decoded in reader.iter_decoded_messages(topics=[CHANNEL])
        ]


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize(
    ("parameters", "ticks"),
    [
        ({"duration": 0.3}, [k / 50 for k in range(15)]),
        ({"duration": 0.3, "control_period": 0.03}, [k * 0.03 for k in range(10)]),
        ({"duration": 0.1, "control_period": 0.02, "dt": 0.003}, [0.0, 0.021, 0.042, 0.06, 0.081]),
    ],
    ids=["with frames", "between frames", "fixed steps"],
)
def test_a_run_does_not_depend_on_when_the_controller_answers(start, connect, domain, tmp_path, parameters, ticks):
    logs = [tmp_path / f"{seed}.mcap" for seed in (1, 2)]
    for seed, log in enumerate(logs):
        heard = run_with_a_late_controller(start, connect, domain, log, seed, **parameters)
        assert sorted(heard)[: len(ticks)] == pytest.approx(ticks, abs=1e-9)
        acting = stimuli(log)
        assert [since for since, _ in acting] == pytest.approx(ticks, abs=1e-9)
        assert [value for _, value in acting] == [control_law(now) for now in sorted(heard)[: len(ticks)]]
    for topic in ("/bilayer_sim/state", CHANNEL, "/bilayer_sim/stimulus_applied"):
        first, second = (messages(log, topic) for log in logs)
        assert len(first) >= len(ticks)
        assert first == second


@pytest.mark.usefixtures("kernels")
def test_a_timer_on_simulated_time_answers_all_ticks_but_the_start(start, connect, domain, tmp_path):
    log, limit = tmp_path / "run.mcap", 4.0
    parameters = {"log": log, "duration": 0.4, "lockstep_timeout": limit, "start_paused": True}
    node = start("sim_node", domain, LOCKSTEP | parameters)
    client = connect(node)
    client.node.set_parameters([Parameter("use_sim_time", value=True)])
    send = client.sender(Float64, CHANNEL)
    client.spin_until(lambda: client.node.count_publishers("/clock"), "the clock")

    def answer():
        send(Float64(data=control_law(client.node.get_clock().now().nanoseconds * 1e-9)))

    client.node.create_timer(0.02, answer)
    assert client.call("resume").success
    client.spin_to_the_end()
    assert node.wait() == 0, node.output
    assert node.output.count("no answer of swelling within") == 1
    ticks = np.arange(1, 20) * 0.02
    fallback, *answers = stimuli_taken(log)
    assert fallback == (0.0, 0.0)
    assert answers == [(pytest.approx(now), pytest.approx(control_law(now))) for now in ticks]


def test_without_a_controller_time_stands_still_and_the_node_says_so(start, connect, domain, tmp_path):
    log = tmp_path / "run.mcap"
    node = start("sim_node", domain, LOCKSTEP | {"log": log})
    client = connect(node)
    clock, diagnostics = client.listen(Clock, "/clock"), client.listen(DiagnosticArray, "/diagnostics")
    client.spin_until(lambda: diagnostics[-1].status[0].level == DiagnosticStatus.WARN, "a warning")
    assert {status.message for message in diagnostics for status in message.status} == {
        "waiting for a stimulus at t = 0 s"
    }
    for status in (message.status[0] for message in diagnostics):
        waited = next(float(value.value) for value in status.values if value.key == "waited for a stimulus [s]")
        assert (status.level == DiagnosticStatus.WARN) is (waited >= 5.0) or abs(waited - 5.0) < 0.01
    client.spin_until(lambda: len(clock) >= 3, "three repetitions")
    assert {to_seconds(message.clock) for message in clock} == {0.0}
    client.spin_until(lambda: to_seconds(diagnostics[-1].header.stamp) == 0.0 and len(diagnostics) > 8, "more of them")
    assert node.output.count("simulated time stands still at t = 0 s") == 1
    assert "does not fire at t = 0. Answer in the callback of /clock, or set the parameter 'lockstep_ti" in node.output
    node.send(signal.SIGINT)
    assert node.wait(30) == 0, node.output
    assert "Traceback" not in node.output
    info = read_info(log)
    assert (info.complete, info.termination, info.last_time) == (False, "ended by SIGINT", 0.0)
    assert info.topics["/bilayer_sim/state"]["count"] == 1


@pytest.fixture(scope="module")
def node(domain_of_module, start):
    return start("sim_node", domain_of_module, LOCKSTEP | {"rate": 50.0})


@pytest.fixture(scope="module")
def waiting(node, connect):
    """A client of a node that waits for its first stimulus."""
    return connect(node)


@pytest.fixture
def client(waiting):
    """The same, reset to its start, where it waits again, and paused."""
    assert waiting.call("pause").success
    assert waiting.call("reset").success
    return waiting


def begun_step(client):
    """A step that waits for a stimulus; the future of its answer."""
    diagnostics = client.listen(DiagnosticArray, "/diagnostics")
    step = client.request("step")
    client.spin_until(lambda: "waiting" in diagnostics[-1].status[0].message, "a step that waits")
    return step


def test_a_step_ends_at_the_next_frame_once_there_is_an_answer(client, node):
    send = client.sender(Float64, CHANNEL)
    step = begun_step(client)
    send(Float64(data=math.nan))
    client.spin_until(lambda: "refused: stimulus 'swelling' is nan" in node.output, "a refusal")
    client.drain()
    assert not step.done()
    send(Float64(data=0.5))
    client.spin_until(step.done, "the end of the step")
    assert (step.result().success, step.result().message) == (True, "paused at t = 0.02 s")


def test_steps_end_in_the_order_in_which_they_were_asked_for(client):
    steps = [begun_step(client), client.request("step")]
    send = client.sender(Float64, CHANNEL)
    for step, now in zip(steps, (0.02, 0.04), strict=True):
        client.drain()
        send(Float64(data=0.5))
        client.spin_until(step.done, "the end of the step")
        assert step.result().message == f"paused at t = {now} s"


@pytest.mark.parametrize(("service", "reason"), [("pause", "paused"), ("resume", "resumed"), ("reset", "reset")])
def test_what_comes_before_a_step_has_ended_refuses_it(client, service, reason):
    step = begun_step(client)
    assert client.call(service).success
    client.spin_until(step.done, "an answer")
    answer = step.result()
    assert (answer.success, answer.message) == (False, f"the simulation was {reason} before the next frame")


def test_a_waiting_simulation_that_runs_refuses_a_step_and_can_be_paused(client):
    assert client.call("resume").success
    assert client.call("step").message == "the simulation is running: call pause first"
    assert client.call("pause").message == "paused at t = 0 s"


def test_an_answer_counts_though_the_simulation_is_paused(client):
    client.sender(Float64, CHANNEL)(Float64(data=0.5))
    client.drain()
    assert client.call("step").message == "paused at t = 0.02 s"


def test_an_interrupted_node_answers_the_step_that_waits(start, connect, domain):
    node = start("sim_node", domain, LOCKSTEP | {"start_paused": True})
    client = connect(node)
    step = begun_step(client)
    node.send(signal.SIGINT)
    client.spin_to_the_end()
    assert node.wait(30) == 0
    assert (step.result().success, step.result().message) == (False, "the simulation has ended")


def test_an_answer_takes_no_polling_period(start, connect, domain, tmp_path):
    node = start("sim_node", domain, LOCKSTEP | {"control_period": 1e-3, "start_paused": True})
    client = connect(node)
    send = client.sender(Float64, CHANNEL)
    heard = []

    def answer(message):
        if not heard or message.clock != heard[-1][0]:
            heard.append((message.clock, time.monotonic()))
            send(Float64(data=0.5))

    client.node.create_subscription(Clock, "/clock", answer, 10)
    client.spin_until(lambda: heard, "the start")
    assert client.call("resume").success
    client.spin_until(lambda: len(heard) >= 100, "100 answers")
    moments = [moment for _, moment in heard]
    trips = sorted(b - a for a, b in zip(moments[:-1], moments[1:], strict=True))
    # A worker that nobody wakes looks again after a second; a trip takes milliseconds, and longer on a busy machine.
    assert trips[len(trips) // 2] < 0.5, "half of the round trips, each with a step"
