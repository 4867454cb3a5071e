"""Feedback in lockstep: each tick has a frame, and the same run comes out however late and slow the controller is."""

import signal
import threading
import time
from contextlib import contextmanager

import pytest
from rosgraph_msgs.msg import Clock
from support.acted_scenes import TWO_CHANNELS
from support.logged_commands import stimuli_taken

from bilayer_core import Simulator, load_scene
from bilayer_core.log.messages.topics import INPUTS
from bilayer_core.log.run.log_reader import read_messages
from bilayer_sim_ros.control.control_ticks import Control
from bilayer_sim_ros.control.pacing import Pacer
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.control.stimulus import StimulusInputs
from bilayer_sim_ros.node import worker
from bilayer_sim_ros.publishing.conversions import to_seconds
from bilayer_sim_ros.publishing.run_files import Recording

LOCKSTEP = {"lockstep": True, "real_time_factor": 0.0}
BEAT = {"period": 0.08, "tolerance": 1e-5, "axis": [0.0, 0.0, -1.0], "goal": [0.0, 0.0, -0.01]}
SLOWED = """
import random, time
from bilayer_sim_ros.controllers.goal_controller import GoalController

chance, longest = random.Random({seed}), {longest_nap}

def slowed(take):
    def take_slowly(self, message):
        time.sleep(longest * chance.random())
        take(self, message)
    return take_slowly

GoalController.hear, GoalController.see = slowed(GoalController.hear), slowed(GoalController.see)
print("imported", flush=True)
"""
"""The controller with a nap before each message that it takes, so that clock and frame change places."""


@pytest.fixture
def goal_controller(start, domain):
    """Starts a controller that takes naps, in a process that begins with its node; it ends with a block."""

    @contextmanager
    def begin(channel="swelling", seed=1, longest_nap=0.0, name="goal_controller"):
        program = SLOWED.format(seed=seed, longest_nap=longest_nap)
        renamed = ["--ros-args", "-r", f"__node:={name}"]
        controller = start("controllers.goal_controller", domain, {"channel": channel, **BEAT}, renamed, program)
        controller.wait_for("imported")
        yield
        controller.send(signal.SIGINT)
        assert controller.wait(30) == 0

    return begin


def states(log):
    """All states and inputs of a log: topic, time and bytes."""
    topics = {"/bilayer_sim/state", INPUTS.full_name()}
    return [(topic, stamp, bytes(data)) for topic, _, stamp, data in read_messages(log, topics) if data is not None]


def before(time, messages):
    """Those of messages from before a time [s]."""
    return [message for message in messages if message[1] < 1e9 * time]


def run(start, goal_controller, domain, log, lateness, seed, longest_nap):
    """Run a node to its end; the controller begins so long after the node waits for it [s], or before the node."""
    simulation = LOCKSTEP | {"scene": "bending", "log": log, "duration": 0.4}
    if lateness is None:
        with goal_controller(seed=seed, longest_nap=longest_nap):
            node = start("sim_node", domain, simulation)
            assert node.wait() == 0, node.output
        return
    node = start("sim_node", domain, simulation)
    node.wait_for("is ready")
    time.sleep(lateness)
    with goal_controller(seed=seed, longest_nap=longest_nap):
        assert node.wait() == 0, node.output


class Audience:
    """Somebody who subscribes to frames."""

    wanted = True

    def __init__(self, heard):
        self._heard = heard

    def publish(self, frame, everything=False):
        self._heard.append(("frame", frame.time))


class Gate:
    """Controllers that hear of ticks, and answer at once or never."""

    wait_ends_at = float("inf")

    def __init__(self, heard, waiting):
        self._heard, self.waiting = heard, waiting

    def publish(self, time):
        self._heard.append(("tick", time))

    def open(self, time, stand=False):
        self.publish(time)


def start_worker(waiting, finished=lambda: None):
    """A run with 30 frames and 100 ticks a second, and what is heard of it, in order."""
    simulator, heard = Simulator(load_scene("bending")), []
    simulator.compile()
    control = Control(StimulusInputs([], 0.0, "hold"), Commands(pytest.fail), 100.0, "hold", Gate(heard, waiting))
    started = worker.SimulationWorker(
        simulator,
        control=control,
        publisher=Audience(heard),
        recording=Recording("", "", 30.0, 30.0, 0.0),
        rate=30.0,
        pacer=Pacer(0.0),
        duration=0.2,
        report=lambda status: None,
        finished=finished,
    )
    started.start()
    return started, heard


def test_each_tick_has_a_frame_before_it_also_where_the_rate_gives_none():
    over = threading.Event()
    started, heard = start_worker(waiting=False, finished=over.set)
    assert over.wait(60.0) and started.error is None
    ticks = [time for kind, time in heard if kind == "tick"]
    assert ticks == pytest.approx([k / 100 for k in range(21)])
    before = [heard[index - 1] for index, (kind, _) in enumerate(heard) if kind == "tick"]
    assert before == [("frame", time) for time in ticks]


def test_while_a_tick_waits_its_frame_is_repeated_with_it(monkeypatch):
    monkeypatch.setattr(worker, "SHOWING_PERIOD", 0.01)
    deadline = time.monotonic() + 60.0
    started, heard = start_worker(waiting=True)
    while len(heard) < 8 and time.monotonic() < deadline:
        time.sleep(0.01)
    started.stop()
    assert started.error is None
    assert heard[:8] == [("frame", 0.0), ("tick", 0.0)] * 4


CASES = [(lateness, nap) for lateness in (None, 0.0, 0.5, 2.0) for nap in (0.0, 0.05)] + [(None, 0.1), (1.0, 0.1)]


@pytest.mark.timeout(1200)
@pytest.mark.parametrize(
    "cases", [[(None, 0.0), (0.5, 0.05)], pytest.param(CASES, marks=pytest.mark.verify)], ids=["two", "all"]
)
def test_runs_whose_controllers_start_late_and_are_slow_are_equal(start, goal_controller, domain, tmp_path, cases):
    logs = [tmp_path / f"{seed}.mcap" for seed in range(len(cases))]
    for seed, ((lateness, nap), log) in enumerate(zip(cases, logs, strict=True)):
        run(start, goal_controller, domain, log, lateness, seed, nap)
    first = states(logs[0])
    assert len(stimuli_taken(logs[0])) == 20
    peaks = {value for _, value in stimuli_taken(logs[0]) if value > 0.05}
    assert len(peaks) > 5  # beats of different sizes: what the controller saw decides
    for log in logs[1:]:
        assert states(log) == first


def test_two_feedback_controllers_make_the_same_run_after_a_reset_and_with_a_pause(
    start, connect, goal_controller, domain, tmp_path
):
    scene = tmp_path / "two.yaml"
    scene.write_text(TWO_CHANNELS)
    parameters = LOCKSTEP | {"scene": scene, "lockstep_answers": "[heat, light]"}
    logs = [tmp_path / "straight.mcap", tmp_path / "again.mcap"]
    with goal_controller("heat", name="of_heat"), goal_controller("light", 2, 0.02, "of_light"):
        node = start("sim_node", domain, parameters | {"log": logs[0], "duration": 0.4})
        assert node.wait() == 0, node.output
        node = start("sim_node", domain, parameters | {"log": logs[1], "start_paused": True})
        client = connect(node)
        clock = client.listen(Clock, "/clock")

        def reach(now):
            client.spin_until(lambda: to_seconds(clock[-1].clock) > now, f"t = {now} s")

        assert client.call("resume").success
        reach(0.1)
        assert client.call("reset").success  # answers are on their way
        client.spin_until(lambda: to_seconds(clock[-1].clock) < 0.1, "the start")
        reach(0.1)
        assert client.call("pause").success
        client.drain()
        assert client.call("resume").success
        reach(0.4)
        node.send(signal.SIGINT)
        assert node.wait() == 0, node.output
    first, second = states(logs[0]), states(logs[1].with_stem("again_1"))
    assert len(stimuli_taken(logs[0])) == 40
    assert before(0.4, first) == before(0.4, second)
