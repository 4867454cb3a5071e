"""What `ros2 param dump` does with each node: all parameters by the services, nested by the dots in their names."""

import sys
import time

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from bilayer_sim_ros.configured_node import ConfiguredNode
from bilayer_sim_ros.controllers.gait_controller import GaitController
from bilayer_sim_ros.controllers.goal_controller import GoalController
from bilayer_sim_ros.controllers.ramp_controller import RampController
from bilayer_sim_ros.parameters import REPLAY_NODE, SIM_NODE

LIMIT = 30.0

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
            deadline = time.monotonic() + LIMIT
            while not client.services_are_ready() and time.monotonic() < deadline:
                executors[1].spin_once(timeout_sec=0.05)
            future = request(client)
            while not future.done():
                assert time.monotonic() < deadline, "no answer"
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
