"""A node that has to compile first: its topics and services are there, and what is asked for waits."""

import threading

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from bilayer_core.log.run.log_reader import read_info, read_log
from bilayer_sim_ros.node import simulation_run
from bilayer_sim_ros.simulation_node import SimulationNode

LIMIT = 60.0


def spin(executor):
    try:
        executor.spin()
    except ExternalShutdownException:
        return


@pytest.fixture
def nodes(domain):
    """Makes nodes in this process, with an executor each in a thread: of the simulation, and of its client."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)

    def node(kind, *name, **values):
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        node = kind(*name, context=context, parameter_overrides=overrides)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        threads.append(threading.Thread(target=spin, args=[executor]))
        threads[-1].start()
        return node

    threads = []
    yield node
    rclpy.shutdown(context=context)
    for thread in threads:
        thread.join()


def test_what_is_sent_and_asked_for_while_it_compiles_acts_when_it_is_ready(nodes, monkeypatch, tmp_path):
    compiled, told = threading.Event(), threading.Event()
    said = []

    def compile_slowly(report, needed):
        while not compiled.wait(0.1):
            report(3, 60)

    monkeypatch.setattr(simulation_run, "ensure_compiled", compile_slowly)
    log = tmp_path / "run.mcap"
    node = nodes(SimulationNode, scene="bending", log=str(log), start_paused=True, real_time_factor=0.0, duration=0.2)
    node.start()
    client = nodes(Node, "client")

    def hear(message):
        said.append(message.status[0].message)
        told.set()

    client.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    publisher = client.create_publisher(Float64, "/bilayer_sim/stimulus/swelling", 10)
    resume = client.create_client(Trigger, "/bilayer_sim/resume")
    try:
        assert resume.wait_for_service(LIMIT) and told.wait(LIMIT)
        assert said[0] == "compiling kernels, once for this version on this machine: 3 of 60 pieces"
        assert publisher.get_subscription_count() == 1
        publisher.publish(Float64(data=0.75))
        answered = threading.Event()
        answer = resume.call_async(Trigger.Request())
        answer.add_done_callback(lambda _: answered.set())
        assert not answered.wait(0.5)
        compiled.set()
        assert answered.wait(LIMIT) and answer.result().success
        assert node.wait(LIMIT) and node.error is None
    finally:
        compiled.set()
    assert read_log(log).stimulus[-1, 0] == pytest.approx(0.75, abs=1e-12)


def test_a_node_that_is_stopped_while_it_compiles_ends_at_once_and_its_log_says_why(nodes, monkeypatch, tmp_path):
    begun, go_on = threading.Event(), threading.Event()

    def compile_for_long(report, needed):
        begun.set()
        go_on.wait(LIMIT)
        report(1, 60)

    monkeypatch.setattr(simulation_run, "ensure_compiled", compile_for_long)
    monkeypatch.setattr(simulation_run, "PATIENCE", 0.1)
    log = tmp_path / "run.mcap"
    node = nodes(SimulationNode, scene="bending", log=str(log))
    try:
        node.start()
        assert begun.wait(LIMIT)
        node.stop("ended by SIGTERM")
        assert node.wait(2.0) and node.compiling and node.error is None
        info = read_info(log)
        assert (info.complete, info.termination) == (False, "ended by SIGTERM while kernels were compiled")
    finally:
        go_on.set()
