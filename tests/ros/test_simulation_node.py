"""Nodes that simulate, composed in one process: two of them, on one executor and in one graph."""

import subprocess
import sys
import threading

import numpy as np
import pytest
import rclpy
import yaml
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import BilayerError, InputError, SimulationError
from bilayer_core.log.run.log_reader import read_info, read_state
from bilayer_sim_ros.simulation_node import SimulationNode

LIMIT = 60.0
FREELY = {"real_time_factor": 0.0, "stimulus_fallback": "schedule"}


@pytest.fixture
def context(domain):
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    yield context
    context.try_shutdown()


@pytest.fixture(params=[SingleThreadedExecutor, MultiThreadedExecutor])
def executor(request, context):
    """An executor that spins in a thread."""
    executor = request.param(context=context)

    def spin():
        try:
            executor.spin()
        except ExternalShutdownException:
            return

    thread = threading.Thread(target=spin)
    thread.start()
    yield executor
    executor.shutdown()
    thread.join()


@pytest.fixture
def make(context):
    """Makes nodes that simulate, with parameters by name; they are destroyed with the test."""
    made = []

    def node(name, ended=None, namespace=None, **values):
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        made.append(
            SimulationNode(name, ended=ended, context=context, namespace=namespace, parameter_overrides=overrides)
        )
        return made[-1]

    yield node
    for node in made:
        node.destroy_node()


@pytest.fixture
def call(context, executor):
    """Calls a service by its full name."""
    client_node = Node("client", context=context)
    executor.add_node(client_node)

    def answer(name):
        client = client_node.create_client(Trigger, name)
        assert client.wait_for_service(LIMIT)
        done = threading.Event()
        future = client.call_async(Trigger.Request())
        future.add_done_callback(lambda _: done.set())
        assert done.wait(LIMIT), f"no answer of {name}"
        return future.result()

    return answer


def hopeless(root, path):
    """A scene file whose second step does not converge."""
    scene = yaml.safe_load((root / "config" / "scenes" / "bending.yaml").read_text())
    scene["stimuli"]["swelling"]["schedule"] = {"type": "table", "times": [0.05, 0.051], "values": [0.0, 1.0]}
    scene["solver"] = {"max_newton_iterations": 1, "max_halvings": 0}
    path.write_text(yaml.safe_dump(scene))
    return str(path)


def test_two_simulations_in_one_process_are_those_of_two_processes(make, executor, call, tmp_path):
    scenes, nodes = {"first": "bending", "second": "crawling_inchworm"}, []
    for name, scene in scenes.items():
        log = str(tmp_path / f"{name}.mcap")
        clock = name == "first"
        nodes.append(make(name, scene=scene, log=log, duration=0.4, start_paused=True, publish_clock=clock, **FREELY))
        executor.add_node(nodes[-1])
    for node in nodes:
        node.start()
    for name in scenes:
        assert call(f"/{name}/resume").success
    for node, (name, scene) in zip(nodes, scenes.items(), strict=True):
        assert node.wait(LIMIT) and node.error is None
        alone = Simulator(load_scene(scene))
        alone.run(0.4)
        np.testing.assert_array_equal(read_state(tmp_path / f"{name}.mcap")[0], alone.save_state())


def test_one_that_fails_leaves_the_other_running(make, executor, call, root, tmp_path):
    told, heard = [], threading.Event()
    values = FREELY | {"scene": hopeless(root, tmp_path / "bad.yaml"), "publish_clock": False}
    bad = make("bad", ended=lambda node: (told.append(node), heard.set()), **values)
    good = make("good", scene="bending")
    for node in (bad, good):
        executor.add_node(node)
        node.start()
    assert bad.wait(LIMIT)
    assert isinstance(bad.error, SimulationError) and "stopped at t = 0.05 s" in str(bad.error)
    assert heard.wait(LIMIT) and told == [bad]
    executor.remove_node(bad)
    bad.destroy_node()
    assert call("/good/pause").success and not good.ended and good.error is None


def test_a_destroyed_node_leaves_the_other_running_and_a_finished_log(make, executor, call, tmp_path):
    log = tmp_path / "run.mcap"
    first = make("simulation", namespace="/a", scene="bending", log=str(log), publish_clock=False, start_paused=True)
    second = make("simulation", namespace="/b", scene="bending", start_paused=True)
    for node in (first, second):
        executor.add_node(node)
        node.start()
    assert call("/a/simulation/step").success
    executor.remove_node(first)
    first.destroy_node()
    assert read_info(log).termination == "ended with its node"
    assert call("/b/simulation/step").success
    assert second.simulated_time > 0.0 and not second.ended


def test_a_node_can_be_stopped_in_a_callback_of_its_own(make, executor, context):
    node = make("simulation", scene="bending")
    stopped = threading.Event()
    node.create_timer(0.01, lambda: (node.stop("ended by its timer"), stopped.set()))
    executor.add_node(node)
    node.start()
    assert stopped.wait(LIMIT) and node.wait(LIMIT) and node.error is None


def test_a_context_that_is_shut_down_ends_its_nodes_and_finishes_their_logs(make, context, tmp_path):
    log = tmp_path / "run.mcap"
    node = make("simulation", scene="bending", log=str(log), start_paused=True)
    node.start()
    rclpy.shutdown(context=context)
    assert node.wait(LIMIT) and node.error is None
    assert read_info(log).termination.startswith("ended with")


def test_a_refused_node_is_not_in_the_graph_and_one_never_started_ends(make, context):
    watching = Node("watching", context=context)
    for values, said in (({"sceen": "bending"}, "did you mean 'scene'"), ({"scene": "bendin"}, "bending")):
        with pytest.raises(BilayerError, match=said):
            make("refused", **values)
    assert "refused" not in watching.get_node_names()
    idle = make("idle", scene="bending")
    idle.destroy_node()
    assert not idle.ended


def test_a_simulation_is_started_once(make):
    node = make("simulation", scene="bending")
    node.start()
    with pytest.raises(InputError, match="was started before; its service ~/reset"):
        node.start()


def test_parameters_have_the_types_of_the_table_and_ranges(make):
    node = make("simulation", scene="bending", rate=50, real_time_factor=2)
    assert node.get_parameter("rate").type_ is Parameter.Type.DOUBLE
    assert node.describe_parameter("duration").floating_point_range[0].from_value == 0.0
    assert node.describe_parameter("stimulus_fallback").additional_constraints == "one of hold, zero, schedule"
    for name in ("duration", "scene", "lockstep"):
        descriptor = node.describe_parameter(name)
        assert descriptor.read_only and not descriptor.dynamic_typing and descriptor.description


PROGRAM = """
import rclpy
from rclpy.parameter import Parameter
from bilayer_sim_ros.simulation_node import SimulationNode

rclpy.init()
values = {"scene": "bending", "log": "run.mcap"}
node = SimulationNode(parameter_overrides=[Parameter(name, value=value) for name, value in values.items()])
node.start()
while node.simulated_time < 0.1:
    rclpy.spin_once(node, timeout_sec=0.05)
"""


@pytest.mark.slow
def test_a_program_that_just_ends_leaves_a_finished_log(tmp_path):
    ended = subprocess.run([sys.executable, "-c", PROGRAM], cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT)
    assert ended.returncode == 0 and "Traceback" not in ended.stderr, ended.stderr
    assert read_info(tmp_path / "run.mcap").termination == "ended with the program"
