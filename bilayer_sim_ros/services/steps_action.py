"""The action `SimulateSteps` of `simulation_interfaces`: steps of a paused simulation, told one by one."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from bilayer_core.errors import BilayerError
from bilayer_sim_ros.services.simulator_services import FAILED, OK
from bilayer_sim_ros.services.trigger_services import Services

NAME = "simulate_steps"


def offer_steps(node: Node, step: Callable[[], Future], services: Services) -> bool:
    """Offer the action under a node's name where its types are installed; return whether it is.

    `step`: asks for one output period of a paused simulation. `services`: the node's others, with which an answer is
    waited for when the node ends.
    """
    try:
        from simulation_interfaces import action
    except ImportError:
        return False
    try:
        # The node keeps the server, among its waitables.
        ActionServer(
            node,
            action.SimulateSteps,
            f"~/{NAME}",
            StepsGoal(action.SimulateSteps, step, services).execute,
            callback_group=ReentrantCallbackGroup(),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
    except Exception as error:  # of several kinds: a library is missing, or the package is an older one
        node.get_logger().warning(f"the action {NAME} of simulation_interfaces is not offered: {error}")
        return False
    node.get_logger().info(f"action of simulation_interfaces: ~/{NAME}")
    return True


class StepsGoal:
    """Does what goals ask for: so many steps, one after the other, with feedback after each.

    `action`: `SimulateSteps`. `step`, `services`: as for `offer_steps`.
    """

    def __init__(self, action: Any, step: Callable[[], Future], services: Services):
        self._action, self._step, self._services = action, step, services

    async def execute(self, goal: Any) -> Any:
        """Make steps until all are done, one is refused, or the goal is cancelled, and return the result."""
        count = goal.request.steps
        with self._services.answering():
            for done in range(count):
                if goal.is_cancel_requested:
                    goal.canceled()
                    return self._result(FAILED, f"cancelled after {done} of {count} steps")
                try:
                    await self._services.in_executor(stepped := self._step())
                    stepped.result()
                except BilayerError as error:
                    goal.abort()
                    return self._result(FAILED, str(error))
                goal.publish_feedback(self._action.Feedback(completed_steps=done + 1, remaining_steps=count - done - 1))
            goal.succeed()
            return self._result(OK, "")

    def _result(self, code: int, text: str) -> Any:
        result = self._action.Result()
        result.result.result, result.result.error_message = code, text
        return result
