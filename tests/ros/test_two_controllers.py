"""A node in lockstep with two controllers, each a thread with a node of its own."""

import math
import random
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress

import pytest
import rclpy
from mcap.reader import make_reader
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from support.acted_scenes import TWO_CHANNELS

from bilayer_core.runs.replay import verify
from bilayer_sim_ros.publishing.conversions import to_seconds

DURATION = 0.2
LONGEST_DELAY = 0.02
"""Of an answer [s of real time]."""


def law(channel, now):
    """Stimulus at a simulated time [s]; it uses all bits."""
    return 0.5 - 0.5 * math.cos((7.0 if channel == "heat" else 11.0) * now)


class Controller:
    """Answers each tick once for one channel, after a random delay, in a thread of its own."""

    def __init__(self, domain, channel, stamped, seed):
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(f"controller_of_{channel}", context=self._context)
        self._channel, self._delays, self._answered = channel, random.Random(seed), set()
        self._stamped = stamped
        if stamped:
            self._sender = self._node.create_publisher(JointState, "/bilayer_sim/stimulus_stamped", 10)
        else:
            self._sender = self._node.create_publisher(Float64, f"/bilayer_sim/stimulus/{channel}", 10)
        self._node.create_subscription(Clock, "/clock", self._answer, 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        with suppress(ExternalShutdownException):
            self._executor.spin()

    def _answer(self, message):
        now = to_seconds(message.clock)
        if now in self._answered or self._sender.get_subscription_count() == 0:
            return
        self._answered.add(now)
        time.sleep(LONGEST_DELAY * self._delays.random())
        value = law(self._channel, now)
        if not self._stamped:
            self._sender.publish(Float64(data=value))
            return
        answer = JointState(name=[self._channel], position=[value])
        answer.header.stamp = message.clock
        self._sender.publish(answer)
        if self._delays.random() < 0.3:
            self._sender.publish(answer)  # a duplicate, or late

    def close(self):
        rclpy.shutdown(context=self._context)
        self._thread.join()
        self._node.destroy_node()


def states(log):
    with log.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=["/bilayer_sim/state", "/bilayer_sim/inputs"])
        return [(channel.topic, message.log_time, message.data) for _, channel, message in messages]


@contextmanager
def load(processes):
    """Others that take the processors."""
    others = [subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


@pytest.mark.parametrize("interpolation", ["linear", pytest.param("hold", marks=pytest.mark.verify)])
def test_two_controllers_make_the_same_run_with_and_without_a_loaded_machine(start, domain, tmp_path, interpolation):
    scene = tmp_path / "two.yaml"
    scene.write_text(TWO_CHANNELS)
    runs, ignored = [], 0
    for seed in range(2):
        log = tmp_path / f"{seed}.mcap"
        parameters = {"scene": scene, "log": log, "duration": DURATION, "lockstep": True, "real_time_factor": 0}
        node = start(
            "sim_node",
            domain,
            parameters | {"lockstep_answers": "[heat, light]", "stimulus_interpolation": interpolation},
        )
        with load(2 * seed):
            controllers = [Controller(domain, "heat", True, seed), Controller(domain, "light", seed == 1, seed + 10)]
            try:
                assert node.wait() == 0, node.output
            finally:
                for controller in controllers:
                    controller.close()
        ignored += "is duplicate and is ignored" in node.output or "is late and is ignored" in node.output
        runs.append(states(log))
    assert len(runs[0]) > 2 * DURATION / 0.02
    assert runs[0] == runs[1]
    assert ignored
    assert verify(log).passed
