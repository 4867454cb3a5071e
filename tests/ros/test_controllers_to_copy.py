"""The controllers to copy: one file each, and each works in lockstep, running freely, paused, and after a reset."""

import ast
import math
import signal
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PointStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from support.logged_commands import stimuli_taken

from bilayer_core import Simulator, load_scene
from bilayer_core.log.messages.topics import output_topics
from bilayer_core.log.run.log_reader import read_log
from bilayer_sim_ros.controllers.gait_controller import wave

CONTROLLERS = ("ramp_controller", "gait_controller", "goal_controller")
WALK = {"channel": "humidity", "period": 2.4}
SWIM = {"channel": "light", "period": 0.6, "width": 0.1, "tolerance": 0.002, "axis": [0.0, 0.0, 1.0]}
GAIT = {"channels": ["left", "right", "hind"], "phases": [0.0, 0.5, 0.25], "period": 0.4, "low": 0.1, "high": 0.6}
FAST = 2.0
"""Simulated seconds a second of a run that nobody waits for."""


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_controller_is_one_short_file_that_imports_nothing_of_the_project(root, name):
    source = (root / f"bilayer_sim_ros/controllers/{name}.py").read_text(encoding="utf-8")
    assert source.count("\n") < 170
    nodes = list(ast.walk(ast.parse(source)))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    assert not any(node.level for node in nodes if isinstance(node, ast.ImportFrom))
    assert not [name for name in names if name.startswith("bilayer")]


@pytest.mark.parametrize(
    ("shape", "duty", "values"),
    [
        ("square", 0.25, [1.0, 0.0, 0.0, 0.0]),
        ("triangle", 0.5, [0.0, 0.5, 1.0, 0.5]),
        ("sine", 0.5, [0.0, 0.5, 1.0, 0.5]),
        ("triangle", 0.25, [0.0, 1.0, 2.0 / 3.0, 1.0 / 3.0]),
    ],
)
def test_waves_are_periodic_and_between_0_and_1(shape, duty, values):
    for turns in (-2, 0, 7):
        assert [wave(shape, turns + k / 4, duty) for k in range(4)] == pytest.approx(values, abs=1e-12)


def test_a_gait_on_three_channels_acts_exactly_and_rests_after_its_periods(start, domain, tmp_path):
    path = tmp_path / "run.mcap"
    simulation = {"scene": "steered_walker", "log": path, "duration": 1.0, "lockstep": True, "real_time_factor": 0.0}
    node = start("sim_node", domain, simulation)
    start("controllers.gait_controller", domain, GAIT | {"periods": 2})
    assert node.wait() == 0, node.output
    run = read_log(path)
    names = run.description.channels
    acted = dict(zip(names, run.stimulus.T, strict=True))
    for name, phase in zip(GAIT["channels"], GAIT["phases"], strict=True):
        ticks = np.arange(len(run.times) - 1) * 0.02
        gait = 0.35 - 0.25 * np.cos(2.0 * math.pi * (ticks / 0.4 - phase))
        # that of a tick is reached at the next one
        assert acted[name][1:] == pytest.approx(np.where(ticks < 0.8 - 1e-9, gait, 0.1), abs=1e-12)


def test_the_walker_comes_to_a_point_and_stops_there_to_5_mm(start, domain, tmp_path):
    path, goal = tmp_path / "run.mcap", 0.03
    simulation = {"scene": "crawling_dual_leg", "log": path, "duration": 14.4}
    node = start("sim_node", domain, simulation | {"lockstep": True, "real_time_factor": 0.0})
    start("controllers.goal_controller", domain, WALK | {"goal": [goal, 0.0, 0.0]})
    assert node.wait() == 0, node.output
    run = read_log(path)
    assert abs(run.com[-1, 0] - goal) < 5e-3 and run.com[0, 0] < 0.01
    assert np.ptp(run.com[run.times > run.times[-1] - 1.0, 0]) < 1e-3


def test_the_swimmer_holds_a_height_also_after_a_pause_a_reset_and_another_goal(start, connect, domain, tmp_path):
    simulation = {"scene": "swimming", "real_time_factor": FAST, "start_paused": True, "duration": 1000.0}
    node = start("sim_node", domain, simulation)
    controller = start("controllers.goal_controller", domain, SWIM | {"goal": [0.0, 0.0, 0.02]})
    client = connect(node)
    heights = client.listen(PointStamped, "/bilayer_sim/com")
    offset = heights[-1].point.z - 0.0

    def held(height):
        """Whether it was within 2 mm of a height for three beats."""
        latest = [m.point.z for m in heights[-int(3 * 0.6 * 50) :]]
        return len(latest) > 80 and max(abs(z - height) for z in latest) < 2e-3

    assert client.call("resume").success
    client.spin_until(lambda: heights[-1].point.z - offset > 0.01, "the way to a height")
    assert client.call("pause").success
    client.drain()
    assert client.call("reset").success
    del heights[:]
    assert client.call("resume").success
    client.spin_until(lambda: heights and abs(heights[-1].point.z - offset) < 5e-3, "the start")
    client.spin_until(lambda: held(0.02), "the same height after a reset")
    send = client.sender(PointStamped, "/goal_controller/goal")
    goal = PointStamped()
    goal.point.z = 0.03
    send(goal)
    client.spin_until(lambda: held(0.03), "another height")
    for process in (controller, node):
        process.send(signal.SIGINT)
        assert process.wait(30) == 0, process.output


@pytest.mark.parametrize(
    ("name", "parameters", "value_at"),
    [
        ("ramp_controller", {"channel": "swelling", "duration": 1.0, "hold": True}, lambda t: min(t, 1.0)),
        ("gait_controller", {"channels": ["swelling"], "period": 2.0}, lambda t: wave("sine", t / 2.0, 0.5)),
    ],
)
def test_beside_a_free_run_it_stands_still_in_a_pause_and_begins_anew_after_a_reset(
    start, connect, domain, name, parameters, value_at
):
    simulation = start("sim_node", domain, {"scene": "bending", "start_paused": True, "real_time_factor": 1.0})
    controller = start(f"controllers.{name}", domain, parameters)
    client = connect(simulation)
    answers = []
    client.node.create_subscription(JointState, "/bilayer_sim/stimulus_stamped", answers.append, 1000)
    while not answers:  # the first ones may be given before this node is known
        assert client.call("step").success
        client.drain(1.0)
    applied = client.listen(Float64MultiArray, "/bilayer_sim/stimulus_applied")
    for _ in range(2):
        del answers[:]
        assert client.call("reset").success
        client.spin_until(lambda: answers and applied[-1].data[0] == 0.0, "an answer to the time of the reset")
        client.drain()
        del applied[:]
        assert client.call("resume").success
        client.spin_until(lambda: answers[-1].position[0] > 0.4, "a part of the way")
        assert client.call("pause").success
        clocks = client.listen(Clock, "/clock")
        client.spin_until(lambda of=clocks: of[-1:] == of[-2:-1], "the time of the pause, which is repeated")
        client.spin_until(lambda of=clocks: answers[-1].header.stamp == of[-1].clock, "an answer to it")
        count, still = len(answers), applied[-1].data[0]
        del clocks[:]
        client.spin_until(lambda of=clocks: of, "another repetition")
        client.drain()
        assert len(answers) == count and applied[-1].data[0] == still
        # Each time has one right answer, however late it was heard.
        times = np.array([answer.header.stamp.sec + 1e-9 * answer.header.stamp.nanosec for answer in answers])
        values = [answer.position[0] for answer in answers]
        assert values == pytest.approx([value_at(time) for time in times], abs=1e-9)
        assert times[0] == 0.0 and len(answers) > 10 and (np.diff(times) > 0.0).all()
        rise = [message.data[0] for message in applied]  # from the start on, not from where it was
        assert rise[0] < 0.1 and (np.diff(rise) >= 0.0).all()
    assert controller.running


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("ramp_controller", {"channel": "swelling", "duration": 0.1, "hold": True}),
        ("gait_controller", {"channels": ["swelling"], "period": 0.1}),
        ("goal_controller", {"channel": "swelling", "period": 0.08, "tolerance": 1e-6, "goal": [1.0, 0.0, 0.0]}),
    ],
)
def test_in_lockstep_a_reset_brings_the_same_values_again(start, connect, domain, tmp_path, name, parameters):
    log = tmp_path / "run.mcap"
    simulation = {"scene": "bending", "lockstep": True, "start_paused": True, "rate": 50.0, "log": log}
    node = start("sim_node", domain, simulation)
    controller = start(f"controllers.{name}", domain, parameters)
    client = connect(node)
    for _ in range(2):
        for _ in range(12):
            assert client.call("step").success
        assert client.call("reset").success
    assert controller.running
    node.send(signal.SIGINT)
    assert node.wait() == 0, node.output
    first, second = stimuli_taken(log), stimuli_taken(log.with_stem("run_1"))
    assert [time for time, _ in first] == pytest.approx(np.arange(12) * 0.02)
    assert max(value for _, value in first) > 0.5 and len({value for _, value in first}) > 3
    assert first == second


def catches(process, number):
    """Whether a process has a handler of its own for a signal."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    caught = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(caught, 16) >> (number - 1) & 1)


@pytest.mark.parametrize("known", [False, True], ids=["before discovery", "after discovery"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_on_simulated_time_that_nobody_publishes_a_signal_ends_it(start, connect, domain, number, known):
    running = [start(f"controllers.{name}", domain, {"use_sim_time": True}) for name in CONTROLLERS]
    client = connect(running[0])
    count = partial(client.node.count_publishers, "/bilayer_sim/stimulus_stamped")
    if known:
        client.spin_until(lambda: count() == len(running), "publishers of all")
    else:
        client.spin_until(lambda: all(catches(of, signal.SIGTERM) for of in running), "handlers of all")
    for of in running:
        of.send(number)
    for of in running:
        assert of.wait(30) == 0 and "Traceback" not in of.output, of.output


@pytest.mark.parametrize(
    ("name", "parameters", "told"),
    [
        ("gait_controller", {"phases": [0.0, 0.5]}, "parameter 'phases' cannot be [0.0, 0.5]"),
        ("gait_controller", {"shape": "saw"}, "parameter 'shape' cannot be 'saw'"),
        ("gait_controller", {"period": "fast"}, "parameter 'period' is 'fast'; allowed is a value of the type double"),
        ("gait_controller", {"channels": []}, "default value of type PARAMETER_NOT_SET"),
        ("gait_controller", {"chanels": ["left"]}, "there is no parameter 'chanels'; there are channels, duty, high,"),
        ("ramp_controller", {"end": 0.5}, "there is no parameter 'end'; there are channel, connection_timeout,"),
        ("goal_controller", {"Goal": [1.0, 0.0, 0.0]}, "there is no parameter 'Goal'; there are axis, channel, goal,"),
        ("ramp_controller", {"duration": 0.0}, "parameter 'duration' cannot be 0.0; allowed is a finite number > 0"),
        ("ramp_controller", {"end_value": ".nan"}, "allowed are finite numbers"),
        ("ramp_controller", {"hold": 1}, "parameter 'hold' is '1'; allowed is a value of the type bool"),
        ("goal_controller", {"width": 3.0}, "allowed are period > width >= 0"),
        ("goal_controller", {"goal": ["a"]}, "allowed is a value of the type double array"),
        ("goal_controller", {"axis": [0.0, 0.0, 0.0]}, "goal and axis of 3 numbers, axis not 0"),
    ],
)
def test_parameters_that_cannot_be_are_refused(start, domain, name, parameters, told):
    controller = start(f"controllers.{name}", domain, parameters)
    assert controller.wait() == 2
    assert told in controller.output and "Traceback" not in controller.output


def test_the_configuration_of_rviz_shows_topics_that_the_node_has(root):
    content = yaml.safe_load((root / "config/markers.rviz").read_text(encoding="utf-8"))
    displays = content["Visualization Manager"]["Displays"]
    shown = {display["Topic"]["Value"] for display in displays if "Topic" in display}
    assert "/bilayer_sim/markers" in shown
    assert shown <= {topic.full_name() for topic in output_topics(Simulator(load_scene("bending")).description)}
