"""Signals at chosen moments of the life of a node, sent by the process to itself: each ends it with 0 and a reason."""

import os
import subprocess
import sys

import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.log.run.log_reader import read_info

LIMIT = 120.0
HEAD = """
import os, signal, sys, time
from bilayer_sim_ros import sim_node
NUMBERS = [getattr(signal, name) for name in SIGNALS.split(",")]

def send(number_of_times=1):
    for number in NUMBERS * number_of_times:
        os.kill(os.getpid(), number)
"""
WHILE_IMPORTING = """
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "rclpy":
            send()
sys.meta_path.insert(0, Finder())
"""
WHILE_COMPILING = """
from bilayer_sim_ros.node import simulation_run
def compile_for_long(report, needed):
    send()
    time.sleep(60.0)
simulation_run.ensure_compiled = compile_for_long
simulation_run.PATIENCE = 0.2
"""
WHILE_STEPPING = """
from bilayer_core import Simulator
step, steps = Simulator.step, []
def count_steps(self, **arguments):
    steps.append(self.time)
    if len(steps) == 20:
        send()
    return step(self, **arguments)
Simulator.step = count_steps
"""
IN_ANOTHER_THREAD = """
import threading
def send():  # to the thread that calls this, not to the one that handles signals
    for number in NUMBERS:
        signal.pthread_kill(threading.get_ident(), number)
"""
WHILE_CLOSING = """
from bilayer_core.log.file.mcap_log import McapRecorder
close = McapRecorder.close
def close_slowly(self, *arguments):
    send(5)
    time.sleep(0.2)
    send(5)
    close(self, *arguments)
McapRecorder.close = close_slowly
"""
WHILE_LEAVING = """
import atexit
atexit.register(send, 5)
"""
ABOUT_TO_WAIT = """
from bilayer_core import Simulator
from rclpy.executors import SingleThreadedExecutor
step, wait, steps, sent = Simulator.step, SingleThreadedExecutor.wait_for_ready_callbacks, [], []
def count_steps(self, **arguments):
    steps.append(self.time)
    return step(self, **arguments)
def send_and_wait(self, *arguments, **named):
    if steps and not sent:
        sent.append(True)
        send()
        time.sleep(1.0)  # the node ends meanwhile
    return wait(self, *arguments, **named)
Simulator.step, SingleThreadedExecutor.wait_for_ready_callbacks = count_steps, send_and_wait
"""
WHILE_SIGNALS_ARE_HANDLED = """
from bilayer_sim_ros.node.signals import Signals

sent = 0

def interrupt(frame, event, argument):  # before every line but those of this program
    global sent
    if frame.f_code.co_filename == "<string>":
        return None
    sent += 1
    send()
    return interrupt

stop = Signals("sim_node").take()
sys.settrace(interrupt)
stop.set()
stop.wait()
stop.wait()
sys.settrace(None)
assert stop.is_set() and stop.reason == "ended by SIGINT" and sent > 3, (stop.reason, sent)
os._exit(0)
"""
TAIL = "\nsys.exit(sim_node.main())\n"

CONTROLLERS = ("ramp_controller", "gait_controller", "goal_controller")
CONTROLLER = """
import atexit, os, signal, sys, threading, time
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

def send():
    for number in [signal.SIGINT, signal.SIGTERM] * 2:
        os.kill(os.getpid(), number)

def send_here():  # to the thread that calls this, not to the one that handles signals
    signal.pthread_kill(threading.get_ident(), signal.SIGTERM)

def send_in(owner, name):
    call = getattr(owner, name)
    def call_and_send(*arguments, **named):
        send()
        result = call(*arguments, **named)
        send()
        return result
    setattr(owner, name, call_and_send)

{moment}
"""
MOMENTS = {
    "rclpy is initialised": "send_in(rclpy, 'init')",
    "the node is made": "send_in(Node, '__init__')",
    "its publisher is made": "send_in(Node, 'create_publisher')",
    "it begins to spin": "send_in(rclpy, 'spin_until_future_complete')",
    "it is about to wait": "send_in(SingleThreadedExecutor, 'wait_for_ready_callbacks')",
    "it waits": "threading.Timer(1.0, send).start()",
    "another thread gets them": "threading.Timer(1.0, send_here).start()",
    "it ends": "threading.Timer(1.0, send).start()\nsend_in(rclpy, 'try_shutdown')\natexit.register(send)",
}
"""Statements that have signals sent when something happens to a controller."""


@pytest.fixture(scope="module")
def compiled():
    """Kernels are there: a node steps as soon as it has started, and no limit is spent on a compiler."""
    Simulator(load_scene("bending")).compile()


@pytest.fixture
def ended(tmp_path, domain, start):
    """Runs a node that signals reach at some moment; its exit code and what it printed."""

    def run(program, signals, imports=False):
        """`imports`: the process begins as one of its own does, and ends so."""
        program = f"SIGNALS = {signals!r}\n{HEAD}{program}"
        arguments = ["--ros-args", "-p", "scene:=bending", "-p", f"log:={tmp_path}/run.mcap"]
        if not imports:
            node = start("sim_node", domain, arguments=arguments, program=program)
            code, output = node.wait(), node.output
        else:
            finished = subprocess.run(
                [sys.executable, "-c", program + TAIL, *arguments],
                cwd=tmp_path,
                env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=LIMIT,
            )
            code, output = finished.returncode, finished.stdout
        assert "Traceback" not in output
        return code, output

    return run


@pytest.mark.parametrize("signals", ["SIGINT", "SIGTERM", "SIGINT,SIGINT"])
def test_a_signal_while_modules_are_imported_ends_it_with_0_and_a_line(ended, signals):
    code, output = ended(WHILE_IMPORTING, signals, imports=True)
    assert (code, output) == (0, f"sim_node: ended by {signals.partition(',')[0]}, before there was a node\n")


def test_signals_while_kernels_are_compiled_end_it_at_once_and_the_log_says_so(ended, tmp_path):
    code, output = ended(WHILE_COMPILING, "SIGTERM,SIGTERM")
    reason = "ended by SIGTERM while kernels were compiled"
    assert code == 0 and reason in output
    info = read_info(tmp_path / "run.mcap")
    assert (info.complete, info.termination) == (False, reason)


@pytest.mark.usefixtures("compiled")
def test_signals_while_the_log_is_closed_and_the_process_ends_change_nothing(ended, tmp_path):
    code, output = ended(WHILE_STEPPING + WHILE_CLOSING + WHILE_LEAVING, "SIGINT,SIGTERM", imports=True)
    assert code == 0, output
    info = read_info(tmp_path / "run.mcap")
    assert (info.complete, info.termination) == (False, "ended by SIGINT")


@pytest.mark.usefixtures("compiled")
def test_a_signal_that_the_system_hands_to_another_thread_ends_the_node(ended, tmp_path):
    code, output = ended(WHILE_STEPPING + IN_ANOTHER_THREAD, "SIGTERM")
    assert code == 0, output
    assert read_info(tmp_path / "run.mcap").termination == "ended by SIGTERM"


def test_signals_may_interrupt_the_handlers_of_others_and_the_wait_for_them(ended):
    assert ended(WHILE_SIGNALS_ARE_HANDLED, "SIGINT,SIGTERM", imports=True) == (0, "")


@pytest.mark.usefixtures("compiled")
def test_a_node_ends_without_a_word_of_an_executor_that_was_about_to_wait(ended):
    code, output = ended(ABOUT_TO_WAIT, "SIGTERM")
    assert (code, "ended by SIGTERM" in output) == (0, True), output


@pytest.mark.parametrize("moment", MOMENTS.values(), ids=MOMENTS)
def test_signals_end_controllers_with_0_and_no_traceback_when(start, domain, moment):
    program = CONTROLLER.format(moment=moment)
    running = [start(f"controllers.{name}", domain, {"use_sim_time": True}, program=program) for name in CONTROLLERS]
    for controller in running:
        assert controller.wait() == 0 and "Traceback" not in controller.output, controller.output
