"""The standard services and action of simulators; their types have no wheel: ones with their fields stand for them."""

import asyncio
import math
import sys
from concurrent.futures import Future
from contextlib import nullcontext
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import Accel, Pose, Twist
from rclpy.action import CancelResponse
from std_msgs.msg import Header

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_sim_ros.services import simulator_services as module
from bilayer_sim_ros.services import steps_action
from bilayer_sim_ros.services.requests import Requests

MESSAGES = {
    "Result": {"result": int, "error_message": str},
    "SimulationState": {"state": int},
    "SimulatorFeatures": {"features": list, "spawn_formats": list, "custom_info": str},
    "EntityState": {"header": Header, "pose": Pose, "twist": Twist, "acceleration": Accel},
    "TagsFilter": {"tags": list, "filter_mode": int},
    "Bounds": {"type": int, "points": list},
}
MESSAGES["EntityFilters"] = {"filter": str, "categories": list, "tags": "TagsFilter", "bounds": "Bounds"}
SERVICES = {
    "GetSimulatorFeatures": ({}, {"features": "SimulatorFeatures"}),
    "GetSimulationState": ({}, {"state": "SimulationState", "result": "Result"}),
    "SetSimulationState": ({"state": "SimulationState"}, {"result": "Result"}),
    "ResetSimulation": ({"scope": int}, {"result": "Result"}),
    "StepSimulation": ({"steps": int}, {"result": "Result"}),
    "GetEntities": ({"filters": "EntityFilters"}, {"result": "Result", "entities": list}),
    "GetEntitiesStates": ({"filters": "EntityFilters"}, {"result": "Result", "entities": list, "states": list}),
    "GetEntityState": ({"entity": str}, {"result": "Result", "state": "EntityState"}),
    "SetEntityState": ({"entity": str, "state": "EntityState", "set_pose": bool}, {"result": "Result"}),
}


class Fields:
    """A message with certain fields and no others."""

    def __init__(self, fields):
        for name, kind in fields.items():
            object.__setattr__(self, name, Fields(MESSAGES[kind]) if isinstance(kind, str) else kind())

    def __setattr__(self, name, value):
        assert hasattr(self, name), f"there is no field {name}"
        object.__setattr__(self, name, value)


class Worker:
    """Simulates when it is asked, in the test's thread."""

    begun = True

    def __init__(self, simulator):
        self.simulator, self.paused, self.steps, self.begun = simulator, True, 0, True
        self._requests = Requests()

    def _do(self, action):
        future = self._requests.ask(lambda answer: answer.set_result(action()))
        self._requests.serve(0.0)
        return future

    def pause(self):
        return self._do(lambda: setattr(self, "paused", True))

    def resume(self):
        return self._do(lambda: setattr(self, "paused", False))

    def look(self, read):
        return self._do(lambda: read(self.simulator, self.paused))

    def step(self):
        return self._do(self._step)

    def _step(self):
        if not self.paused:
            raise InputError("the simulation is running: call pause first")
        self.steps += 1
        if self.steps < 5:
            self.simulator.run(0.02)

    def reset(self):
        return self._do(self.simulator.reset)


@pytest.fixture(scope="module")
def simulator():
    return Simulator(load_scene("gripping"))


@pytest.fixture
def worker(simulator):
    simulator.reset()
    return Worker(simulator)


@pytest.fixture
def ended():
    return []


@pytest.fixture
def call(worker, ended, monkeypatch):
    """Calls a service with fields of its request; the answer."""
    package = ModuleType("simulation_interfaces")
    package.srv, package.msg = ModuleType("simulation_interfaces.srv"), ModuleType("simulation_interfaces.msg")
    package.msg.EntityState = lambda: Fields(MESSAGES["EntityState"])
    for name in SERVICES:
        setattr(package.srv, name, name)
    for name in ("simulation_interfaces", "simulation_interfaces.srv", "simulation_interfaces.msg"):
        monkeypatch.setitem(sys.modules, name, sys.modules.get(name, package))
    monkeypatch.setitem(sys.modules, "simulation_interfaces.srv", package.srv)
    monkeypatch.setitem(sys.modules, "simulation_interfaces.msg", package.msg)
    monkeypatch.setattr(module, "check_is_valid_srv_type", lambda _: None)
    lines = []
    node = SimpleNamespace(get_logger=lambda: SimpleNamespace(info=lines.append, warning=lines.append))
    offered = module.simulator_services(node, worker, worker.simulator.description, ended.append)
    by_type = {service.type: service for service in offered}
    assert by_type.keys() == SERVICES.keys()
    assert lines == ["services of simulation_interfaces: " + " ".join(f"~/{service.name}" for service in offered)]

    def answer(name, **fields):
        request, response = map(Fields, SERVICES[name])
        for field, value in fields.items():
            owner = request
            *path, last = field.split("__")
            for part in path:
                owner = getattr(owner, part)
            setattr(owner, last, value)
        future = by_type[name].ask(request)
        assert isinstance(future, Future) and future.done()
        by_type[name].answer(response, future)
        return response

    return answer


def set_state(call, state):
    return call("SetSimulationState", state__state=state).result.result


def state(call):
    return call("GetSimulationState").state.state


def test_nothing_is_offered_where_the_types_are_not_installed(worker, monkeypatch):
    monkeypatch.setitem(sys.modules, "simulation_interfaces", None)
    assert module.simulator_services(SimpleNamespace(), worker, worker.simulator.description, print) == []


def test_types_whose_libraries_are_missing_are_told_and_not_offered(worker, monkeypatch):
    package, lines = ModuleType("simulation_interfaces"), []
    package.srv = SimpleNamespace(GetSimulationState=object)
    monkeypatch.setitem(sys.modules, "simulation_interfaces", package)
    node = SimpleNamespace(get_logger=lambda: SimpleNamespace(warning=lines.append))
    assert module.simulator_services(node, worker, worker.simulator.description, print) == []
    assert "are not offered" in lines[0]


def test_it_plays_pauses_and_stops_as_the_standard_says(call, worker):
    assert state(call) == module.STOPPED
    assert set_state(call, module.PAUSED) == module.WRONG_TRANSITION
    assert set_state(call, module.PLAYING) == module.OK and state(call) == module.PLAYING
    assert set_state(call, module.PLAYING) == module.ALREADY_THERE
    worker.simulator.run(0.02)
    assert set_state(call, module.PAUSED) == module.OK and state(call) == module.PAUSED
    assert set_state(call, module.STOPPED) == module.OK and worker.simulator.time == 0.0
    assert set_state(call, 4) == module.UNSUPPORTED


def test_it_is_loading_its_world_until_it_is_compiled_and_can_be_quit(call, worker, ended):
    worker.begun = False
    assert state(call) == module.LOADING_WORLD
    assert set_state(call, module.QUITTING) == module.OK
    assert ended == ["ended by SetSimulationState"]


def test_many_steps_are_as_many_output_periods_and_only_while_paused(call, worker):
    assert call("StepSimulation", steps=3).result.result == module.OK
    assert worker.simulator.time == pytest.approx(0.06)
    assert call("StepSimulation", steps=5000).result.result == module.OK and worker.steps == 5003
    worker.paused = False
    result = call("StepSimulation", steps=1).result
    assert result.result == module.FAILED and "call pause first" in result.error_message


@pytest.mark.parametrize(("scope", "code"), [(0, 1), (255, 1), (3, 1), (1, 0), (2, 0), (4, 0)])
def test_time_and_state_are_reset_together_or_not_at_all(call, worker, scope, code):
    worker.simulator.run(0.02)
    assert call("ResetSimulation", scope=scope).result.result == code
    assert (worker.simulator.time == 0.0) is (code == module.OK)


def test_bodies_and_rods_are_entities_with_their_states(call, worker):
    simulator = worker.simulator
    simulator.run(0.1)
    names = call("GetEntities").entities
    assert set(simulator.bodies) | set(simulator.rods) == set(names)
    ball = call("GetEntityState", entity="ball").state
    assert [ball.pose.position.x, ball.pose.position.z] == list(simulator.bodies["ball"].position[[0, 2]])
    assert ball.twist.linear.z == simulator.bodies["ball"].velocity[2]
    assert (ball.header.frame_id, ball.header.stamp.nanosec) == ("world", 100_000_000)
    rod = call("GetEntityState", entity="arm_1").state
    place = rod.pose.position
    np.testing.assert_array_equal([place.x, place.y, place.z], simulator.rods["arm_1"].positions[0])
    turned = rod.pose.orientation
    assert math.hypot(turned.x, turned.y, turned.z, turned.w) == pytest.approx(1.0)
    assert math.isnan(rod.twist.angular.x) and math.isnan(rod.acceleration.linear.x)
    several = call("GetEntitiesStates", filters__filter="^arm_[01]$")
    assert several.entities == ["arm_0", "arm_1"] and several.states[1].pose == rod.pose


def test_what_cannot_be_is_answered_with_a_reason(call):
    missing = call("GetEntityState", entity="bal").result
    assert missing.result == module.NOT_FOUND and "ball" in missing.error_message
    assert call("GetEntities", filters__tags__tags=["a"]).result.result == module.UNSUPPORTED
    assert call("GetEntitiesStates", filters__bounds__type=1).result.result == module.UNSUPPORTED
    assert "regular expression" in call("GetEntities", filters__filter="(").result.error_message
    refused = call("SetEntityState", entity="ball", set_pose=True).result
    assert refused.result == module.UNSUPPORTED and "~/mount_pose" in refused.error_message


def test_features_say_what_is_offered(call):
    features = set(call("GetSimulatorFeatures").features.features)
    assert {10, 20, 24, 25, 26, 31, 32, 33} == features


GOAL, RESULT, FEEDBACK = {"steps": int}, {"result": "Result"}, {"completed_steps": int, "remaining_steps": int}


class Goal:
    """A goal of the action, and what becomes of it."""

    def __init__(self, steps, cancelled_after=None):
        self.request, self.told, self.end = Fields(GOAL), [], None
        self.request.steps, self._cancelled_after = steps, cancelled_after

    @property
    def is_cancel_requested(self):
        return len(self.told) == self._cancelled_after

    def publish_feedback(self, feedback):
        self.told.append((feedback.completed_steps, feedback.remaining_steps))

    def succeed(self):
        self.end = "succeeded"

    def abort(self):
        self.end = "aborted"

    def canceled(self):  # rclpy's spelling
        self.end = "cancelled"


@pytest.fixture
def execute(worker, monkeypatch):
    """Has the action do a goal; code and text of its result."""

    def feedback(**values):
        message = Fields(FEEDBACK)
        for name, value in values.items():
            setattr(message, name, value)
        return message

    async def in_executor(future):
        assert future.done()

    made = []
    package = ModuleType("simulation_interfaces")
    package.action = ModuleType("simulation_interfaces.action")
    package.action.SimulateSteps = SimpleNamespace(Result=lambda: Fields(RESULT), Feedback=feedback)
    monkeypatch.setitem(sys.modules, "simulation_interfaces", package)
    monkeypatch.setitem(sys.modules, "simulation_interfaces.action", package.action)
    monkeypatch.setattr(steps_action, "ActionServer", lambda *arguments, **named: made.append((arguments, named)))
    lines = []
    node = SimpleNamespace(get_logger=lambda: SimpleNamespace(info=lines.append))
    services = SimpleNamespace(answering=nullcontext, in_executor=in_executor)
    assert steps_action.offer_steps(node, worker.step, services)
    assert lines == ["action of simulation_interfaces: ~/simulate_steps"]
    ((server_node, kind, name, execute), named) = made[0]
    assert (server_node, kind, name) == (node, package.action.SimulateSteps, "~/simulate_steps")
    assert named["cancel_callback"](None) == CancelResponse.ACCEPT

    def run(goal):
        result = asyncio.run(execute(goal)).result
        return result.result, result.error_message

    return run


def test_the_action_tells_each_step_and_succeeds_after_the_last(execute, worker):
    goal = Goal(3)
    assert execute(goal) == (module.OK, "")
    assert (goal.end, goal.told) == ("succeeded", [(1, 2), (2, 1), (3, 0)])
    assert worker.simulator.time == pytest.approx(0.06)


def test_a_cancelled_action_ends_between_two_steps(execute, worker):
    goal = Goal(1000, cancelled_after=2)
    assert execute(goal) == (module.FAILED, "cancelled after 2 of 1000 steps")
    assert (goal.end, goal.told[-1], worker.steps) == ("cancelled", (2, 998), 2)


def test_the_action_is_aborted_with_the_reason_while_the_simulation_runs(execute, worker):
    worker.paused, goal = False, Goal(2)
    code, text = execute(goal)
    assert (code, goal.end, goal.told) == (module.FAILED, "aborted", []) and "call pause first" in text


def test_the_action_is_not_offered_where_its_type_is_not_installed_or_not_usable(worker, monkeypatch):
    monkeypatch.setitem(sys.modules, "simulation_interfaces", None)
    assert not steps_action.offer_steps(SimpleNamespace(), worker.step, None)
    package, lines = ModuleType("simulation_interfaces"), []
    package.action = SimpleNamespace()  # of a release without the action
    monkeypatch.setitem(sys.modules, "simulation_interfaces", package)
    node = SimpleNamespace(get_logger=lambda: SimpleNamespace(warning=lines.append))
    assert not steps_action.offer_steps(node, worker.step, None)
    assert "simulate_steps of simulation_interfaces is not offered" in lines[0]
