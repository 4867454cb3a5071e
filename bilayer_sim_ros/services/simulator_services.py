"""The standard services of simulators (`simulation_interfaces`, 2.x) as adapters of those that every node has.

They are offered where their types are installed. What this simulator cannot do is answered as unsupported, with what to
do instead; `get_simulator_features` lists what it can.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from rclpy.node import Node
from rclpy.type_support import check_is_valid_srv_type

from bilayer_core.errors import BilayerError
from bilayer_core.observed.frame import Description
from bilayer_core.printable import shortened
from bilayer_core.simulation.simulator import Simulator
from bilayer_sim_ros.control.subscriptions import LONGEST_WARNING
from bilayer_sim_ros.services.entities import Entities
from bilayer_sim_ros.services.requests import answered
from bilayer_sim_ros.services.trigger_services import Service

UNSUPPORTED, OK, NOT_FOUND, FAILED = 0, 1, 2, 4
"""Of `simulation_interfaces/msg/Result`."""
ALREADY_THERE, WRONG_TRANSITION = 101, 103
"""Further ones of `SetSimulationState`."""
STOPPED, PLAYING, PAUSED, QUITTING, LOADING_WORLD = 0, 1, 2, 3, 5
"""Of `simulation_interfaces/msg/SimulationState`."""
SCOPE_TIME, SCOPE_STATE = 1, 2
"""Of `ResetSimulation`; no scope means all."""
FEATURES = (10, 20, 24, 25, 26, 31, 32, 33)
"""Of `SimulatorFeatures`: states of entities, reset, state of the simulation asked for and set, pause, one and many
steps, steps as an action."""
NOT_STATE = "the state of {0} cannot be set at once; a body with a top_speed goes to a pose on ~/mount_pose/<body>"
NOT_SCOPE = "time and state are reset together, and nothing is spawned: ask for both, or for scope 0"
NOT_FILTER = "entities are filtered by their names alone"
QUIT = "ended by SetSimulationState"


class Worker(Protocol):
    """Interface that services need of the thread that simulates; see `SimulationWorker`."""

    begun: bool

    def pause(self) -> Future: ...
    def resume(self) -> Future: ...
    def step(self) -> Future: ...
    def reset(self) -> Future: ...
    def look(self, read: Callable[[Simulator, bool], Any]) -> Future: ...


@dataclass(frozen=True)
class Result:
    """Outcome of a request: a code, and an explanation unless it is `OK`."""

    code: int = OK
    text: str = ""


def simulator_services(
    node: Node, worker: Worker, description: Description, quit: Callable[[str], None]
) -> list[Service]:
    """Return all of them, or none where their types are not installed; the console says which.

    `quit`: ends the simulation for a reason.
    """
    try:
        from simulation_interfaces import srv
    except ImportError:
        return []
    try:
        check_is_valid_srv_type(srv.GetSimulationState)  # loads the libraries of the package
        offered = _services(srv, worker, Entities(description), quit)
    except Exception as error:  # of several kinds: a library is missing, or the package is an older one
        node.get_logger().warning(f"services of simulation_interfaces are not offered: {error}")
        return []
    names = " ".join(f"~/{service.name}" for service in offered)
    node.get_logger().info(f"services of simulation_interfaces: {names}")
    return offered


def _services(srv: Any, worker: Worker, entities: Entities, quit: Callable[[str], None]) -> list[Service]:
    def state_now(_: Any) -> Future:
        if not worker.begun:
            return answered((LOADING_WORLD, Result()))
        return _then(worker.look(state_of), lambda state: answered((state, Result())))

    def set_state(request: Any) -> Future:
        if request.state.state == QUITTING:  # also while kernels are compiled
            quit(QUIT)
            return _all_right(None)
        return _then(worker.look(state_of), partial(_change, worker, request.state.state))

    def reset(request: Any) -> Future:
        both = SCOPE_TIME | SCOPE_STATE
        if request.scope and request.scope & both != both:
            return answered(Result(UNSUPPORTED, NOT_SCOPE))
        return _then(worker.reset(), _all_right)

    def look_at(names: list[str]) -> Future:
        return worker.look(lambda simulator, _: (entities.states(simulator, names), Result()))

    def names_of(request: Any) -> Future:
        return answered(_filtered(entities, request.filters))

    def states(request: Any) -> Future:
        names, result = _filtered(entities, request.filters)
        return look_at(names) if result.code == OK else answered(([], result))

    def one_state(request: Any) -> Future:
        if request.entity not in entities.names:
            known = shortened(", ".join(entities.names), LONGEST_WARNING)
            text = f"there is no entity '{shortened(request.entity)}'; there are {known}"
            return answered(([], Result(NOT_FOUND, text)))
        return look_at([request.entity])

    def write_states(response: Any, future: Future) -> None:
        found = _result_into(response, future)
        if found:
            response.entities = [name for name, _ in found]
            response.states = [entities.to_message(state) for _, state in found]

    def write_one(response: Any, future: Future) -> None:
        for _, state in _result_into(response, future) or ():
            response.state = entities.to_message(state)

    def write_names(response: Any, future: Future) -> None:
        response.entities = _result_into(response, future) or []

    def write_features(response: Any, _: Future) -> None:
        response.features.features = FEATURES
        response.features.custom_info = "bilayer_sim_ros; a step is an output period, as of ~/step"

    def write_state(response: Any, future: Future) -> None:
        state = _result_into(response, future)
        if state is not None:
            response.state.state = state

    def refuse_state(request: Any) -> Future:
        return answered(Result(UNSUPPORTED, NOT_STATE.format(shortened(request.entity))))

    return [
        Service("get_simulator_features", srv.GetSimulatorFeatures, lambda _: answered(None), write_features),
        Service("get_simulation_state", srv.GetSimulationState, state_now, write_state),
        Service("set_simulation_state", srv.SetSimulationState, set_state, _result_into),
        Service("reset_simulation", srv.ResetSimulation, reset, _result_into),
        Service("step_simulation", srv.StepSimulation, lambda request: _steps(worker, request.steps), _result_into),
        Service("get_entities", srv.GetEntities, names_of, write_names),
        Service("get_entities_states", srv.GetEntitiesStates, states, write_states),
        Service("get_entity_state", srv.GetEntityState, one_state, write_one),
        Service("set_entity_state", srv.SetEntityState, refuse_state, _result_into),
    ]


def state_of(simulator: Simulator, paused: bool) -> int:
    """Return the standard's word for the state; a simulator that is paused at the start is stopped."""
    if not paused:
        return PLAYING
    return PAUSED if simulator.time > 0.0 else STOPPED


def _change(worker: Worker, wished: int, present: int) -> Future:
    """Go from a state to another one."""
    if wished == present:
        return answered(Result(ALREADY_THERE, "it is in that state already"))
    if wished == PLAYING:
        return _then(worker.resume(), _all_right)
    if wished == PAUSED and present == STOPPED:
        return answered(Result(WRONG_TRANSITION, "what is stopped cannot be paused: play or step first"))
    if wished == PAUSED:
        return _then(worker.pause(), _all_right)
    if wished == STOPPED:
        return _then(worker.pause(), lambda _: _then(worker.reset(), _all_right))
    return answered(Result(UNSUPPORTED, f"there is no state {wished} here: the world is the scene, which stays"))


def _steps(worker: Worker, count: int) -> Future:
    """Return several steps, one after the other; the first that is refused ends them."""
    whole: Future = Future()
    left = count

    def go_on(ended: Future) -> None:
        nonlocal left
        while ended.done():  # no recursion, however many there are
            error = ended.exception()
            if error is not None:
                whole.set_exception(error)
                return
            if left == 0:
                whole.set_result(Result())
                return
            left -= 1
            ended = worker.step()
        ended.add_done_callback(go_on)

    go_on(answered(None))
    return whole


def _filtered(entities: Entities, filters: Any) -> tuple[list[str], Result]:
    """Return the names that a filter leaves, and whether it is one."""
    if filters.categories or filters.tags.tags or filters.bounds.type:
        return [], Result(UNSUPPORTED, NOT_FILTER)
    try:
        pattern = re.compile(filters.filter)
    except re.error as error:
        return [], Result(FAILED, f"the filter '{shortened(filters.filter)}' is no regular expression: {error}")
    return [name for name in entities.names if pattern.search(name)], Result()


def _result_into(response: Any, future: Future) -> Any:
    """Write a result into a response; what else there is, if anything."""
    try:
        found = future.result()
    except BilayerError as error:
        found = Result(FAILED, str(error))
    if isinstance(found, Result):
        found = (None, found)
    rest, result = found
    response.result.result, response.result.error_message = result.code, result.text
    return rest


def _all_right(_: Any) -> Future:
    return answered(Result())


def _then(first: Future, following: Callable[[Any], Future]) -> Future:
    """Return the future of the second call; an error of the first becomes its own."""
    whole: Future = Future()

    def take_result(last: Future) -> None:
        error = last.exception()
        if error is not None:
            whole.set_exception(error)
        else:
            whole.set_result(last.result())

    def go_on(ended: Future) -> None:
        if ended.exception() is not None:
            take_result(ended)
        else:
            following(ended.result()).add_done_callback(take_result)

    first.add_done_callback(go_on)
    return whole
