"""Parameters of all nodes: dumped as `ros2 param dump` does it, by the services and nested by dots; whole numbers."""

import sys
import time

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from bilayer_sim_ros.controllers.gait_controller import GaitController
from bilayer_sim_ros.controllers.goal_controller import GoalController
from bilayer_sim_ros.controllers.ramp_controller import RampController
from bilayer_sim_ros.node.configured_node import ConfiguredNode
from bilayer_sim_ros.node.parameters import REPLAY_NODE, SIM_NODE

LIMIT, PATIENCE = 60.0, 3.0

NODES = {
    "sim_node": lambda: ConfiguredNode("bilayer_sim", SIM_NODE),
    "replay_node": lambda: ConfiguredNode("bilayer_replay", REPLAY_NODE),
    "ramp_controller": RampController,
    "gait_controller": GaitController,
    "goal_controller": GoalController,
}


@pytest.fixture
def answer(domain, monkeypatch):
    """Starts a node in the default context, which is what controllers have; the answers to requests of another one."""
    monkeypatch.setattr(sys, "argv", ["node"])
    rclpy.init(args=[], domain_id=domain)
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    executors = SingleThreadedExecutor(), SingleThreadedExecutor(context=context)

    def made(make):
        node, asking = make(), Node("asking", context=context)
        executors[0].add_node(node)
        executors[1].add_node(asking)
        client = AsyncParameterClient(asking, node.get_name())

        def ask(request):
            deadline, future, asked = time.monotonic() + LIMIT, None, 0.0
            while future is None or not future.done():
                assert time.monotonic() < deadline, "no answer"
                if client.services_are_ready() and (future is None or time.monotonic() > asked + PATIENCE):
                    future, asked = request(client), time.monotonic()  # an answer may be too early for who asks
                for executor in executors:
                    executor.spin_once(timeout_sec=0.01)
            return future.result()

        return ask

    yield made
    for executor in executors:
        executor.shutdown()
    rclpy.shutdown(context=context)
    rclpy.try_shutdown()


def nested(values):
    """As `ros2 param dump` does it: a name with dots is a place in mappings inside each other."""
    whole = {}
    for name, value in values.items():
        *places, last = name.split(".")
        part = whole
        for place in places:
            part = part.setdefault(place, {})
            assert isinstance(part, dict), f"'{name}' has a name in it that is a parameter itself"
        assert last not in part, f"'{name}' is the beginning of another name"
        part[last] = value
    return whole


@pytest.mark.parametrize("name", NODES)
def test_all_parameters_of_a_node_can_be_dumped(answer, name):
    ask = answer(NODES[name])
    names = ask(lambda client: client.list_parameters([], 10)).result.names
    values = ask(lambda client: client.get_parameters(names)).values
    dumped = nested(dict(zip(names, map(parameter_value_to_python, values), strict=True)))
    if name == "sim_node":
        assert dumped["friction"] == {"coefficient": -1.0, "forward": -1.0, "backward": -1.0, "sideways": -1.0}
    if name == "replay_node":
        assert dumped["play"]["rate"] == 1.0
    assert len(names) > 5 and len(dumped) > 1


@pytest.mark.parametrize(
    ("make", "given", "expected"),
    [
        (RampController, "-p duration:=1 -p end_value:=2", lambda node: (node.duration, node.values[1]) == (1.0, 2.0)),
        (
            GaitController,
            "-p period:=2 -p phases:=[0] -p high:=1",
            lambda node: (node.period, node.phases) == (2.0, [0.0]),
        ),
        (
            GoalController,
            "-p period:=2 -p axis:=[0,0,1]",
            lambda node: (node.period, [*node.axis]) == (2.0, [0.0, 0.0, 1.0]),
        ),
    ],
    ids=["ramp", "gait", "goal"],
)
def test_whole_numbers_will_do_for_numbers_of_controllers(domain, make, given, expected):
    rclpy.init(args=["controller", "--ros-args", *given.split()], domain_id=domain)
    try:
        assert expected(make())
    finally:
        rclpy.shutdown()


@pytest.mark.parametrize("make", [RampController, GaitController, GoalController], ids=["ramp", "gait", "goal"])
def test_a_text_for_a_number_of_a_controller_is_refused_by_its_name(domain, make):
    rclpy.init(args=["controller", "--ros-args", "-p", "high:=fast", "-p", "duration:=fast"], domain_id=domain)
    try:
        with pytest.raises(
            ValueError, match="parameter '(high|duration)' is 'fast'; allowed is a value of the type double"
        ):
            make()
    finally:
        rclpy.shutdown()
