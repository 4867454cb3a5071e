"""A node that falls behind says so, and why."""

import re
import signal
import threading
import time
from types import SimpleNamespace

import pytest

from bilayer_core import Simulator, load_scene
from bilayer_sim_ros.control import subscriptions
from bilayer_sim_ros.control.control_ticks import Control
from bilayer_sim_ros.control.pacing import CONTROLLERS, LOG, OTHERS, PHYSICS, SUBSCRIBERS, Pacer
from bilayer_sim_ros.control.pending_changes import Commands
from bilayer_sim_ros.control.stimulus import StimulusInputs
from bilayer_sim_ros.control.subscriptions import LONGEST_REST, ROUND, Rest
from bilayer_sim_ros.node.worker import SimulationWorker
from bilayer_sim_ros.publishing.run_files import Recording

NAP = 0.05
"""Longer than the period of frames, 0.02 s."""


class Publisher:
    """Somebody listens, and takes a while."""

    wanted = True

    def __init__(self, nap=0.0):
        self._nap = nap

    def publish(self, frame, everything=False):
        time.sleep(self._nap)


class Log(Recording):
    """A log that takes a while."""

    wanted = True

    def __init__(self, nap=0.0):
        super().__init__("", "", 50.0, 25.0, 0.0)
        self._nap = nap

    def observe(self, frame):
        time.sleep(self._nap)


class Physics(Simulator):
    """Steps that take a while, of the processor."""

    nap = 0.0

    def step(self, until=float("inf")):
        report = super().step(until)
        begin = time.thread_time()
        while time.thread_time() - begin < self.nap:
            pass
        self._loop.cpu_time += self.nap
        self._loop.wall_time += self.nap
        return report


class Gate:
    """Controllers that answer after a while."""

    wait_ends_at = float("inf")

    def open(self, time_of_tick, stand=False):
        self._answer_at = time.monotonic() + NAP

    def wait_anew(self):
        pass

    @property
    def waiting(self):
        self.wait_ends_at = self._answer_at
        return time.monotonic() < self._answer_at


def first_status(simulator, publisher, recording, gate=None):
    """The first status of a run in real time, which comes after a second."""
    found, over = [], threading.Event()
    worker = SimulationWorker(
        simulator,
        control=Control(StimulusInputs([], 0.0, "hold"), Commands(pytest.fail), 50.0, "hold", gate),
        publisher=publisher,
        recording=recording,
        rate=50.0,
        pacer=Pacer(1.0),
        duration=1.3,
        report=found.append,
        finished=over.set,
    )
    worker.start()
    while not found and not over.wait(0.01):
        pass
    worker.stop()
    assert worker.error is None
    return found[0]


@pytest.fixture
def simulator():
    simulator = Physics(load_scene("bending"))
    simulator.compile()
    return simulator


@pytest.mark.parametrize("cause", [PHYSICS, LOG, SUBSCRIBERS, CONTROLLERS])
def test_the_cause_of_a_lag_is_known_within_its_first_second(simulator, cause):
    simulator.nap = NAP if cause == PHYSICS else 0.0
    publisher, recording = Publisher(NAP * (cause == SUBSCRIBERS)), Log(NAP * (cause == LOG))
    status = first_status(simulator, publisher, recording, Gate() if cause == CONTROLLERS else None)
    assert status.lost > 0.0
    status.spent.pop(OTHERS, None)  # on a busy machine that may be most of the time
    assert max(status.spent, key=status.spent.get) == cause
    assert status.real_time_factor < 0.6 and status.asked_factor == 1.0


def test_a_node_that_is_behind_says_so_and_then_every_ten_seconds(start, domain):
    parameters = {"scene": "bending", "real_time_factor": 1e6, "duration": 1e9}
    node = start("sim_node", domain, parameters)
    node.wait_for("behind: simulated time goes at")
    said = re.search(r"asked for is 1e\+06; .* Cause: (.*), \d+% of the time", node.output)
    assert said and said[1] in ("physics", "other threads and programs")
    time.sleep(1.5)
    node.send(signal.SIGINT)
    assert node.wait() == 0
    stamps = [float(stamp) for stamp in re.findall(r"\[(\d+\.\d+)\].*behind:", node.output)]
    assert all(after - before > 9.0 for before, after in zip(stamps[:-1], stamps[1:], strict=True))


@pytest.mark.parametrize(("factor", "rest"), [(1.0, 0.005), (5.0, 0.001), (0.01, LONGEST_REST), (0.0, 0.0)])
def test_the_executor_rests_once_in_a_round_of_messages(monkeypatch, factor, rest):
    now, slept = [0.0], []

    def sleep(seconds):
        slept.append(seconds)
        now[0] += seconds

    monkeypatch.setattr(subscriptions, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
    after = Rest(50.0, lambda: factor)
    for _ in range(3):
        for _ in range(4):  # messages of one round
            now[0] += 0.1 * ROUND
            after()
        now[0] += 10 * ROUND
    assert slept == ([pytest.approx(rest)] * 3 if rest else [])
