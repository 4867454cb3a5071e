"""Services that answer when another thread has done what was asked."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future as AwaitedFuture
from std_srvs.srv import Trigger

from bilayer_core.errors import BilayerError

# Longest wait for the last answers to be sent [s].
LAST_ANSWERS = 1.0


class Services:
    """Services of a node, each answered from a future; messages and other requests are served meanwhile.

    Parameters
    ----------
    node : Node
    asks : mapping
        Name under the node's own -> what asks, and returns the future of what to say; `BilayerError` is a refusal.
    """

    def __init__(self, node: Node, asks: Mapping[str, Callable[[], Future]]):
        self._node = node
        self._unanswered = 0
        self._all_answered = threading.Condition()
        group = ReentrantCallbackGroup()
        for name, ask in asks.items():
            node.create_service(Trigger, f"~/{name}", partial(self._answer, ask), callback_group=group)

    async def _answer(
        self, ask: Callable[[], Future], _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        with self._all_answered:
            self._unanswered += 1
        future = ask()
        await self._in_executor(future)
        try:
            response.message, response.success = future.result(), True
        except BilayerError as error:
            response.message, response.success = str(error), False
        with self._all_answered:
            self._unanswered -= 1
            self._all_answered.notify_all()
        return response

    def _in_executor(self, future: Future) -> AwaitedFuture:
        """What a coroutine of the node's executor awaits until `future` is done."""
        executor = self._node.executor
        awaited = AwaitedFuture(executor=executor)

        def done(_: Future) -> None:
            awaited.set_result(None)
            executor.wake()

        future.add_done_callback(done)
        return awaited

    def finish(self) -> None:
        """Return when the answers to all that was asked are sent; their futures are done."""
        with self._all_answered:
            self._all_answered.wait_for(lambda: self._unanswered == 0, LAST_ANSWERS)
        sent = threading.Event()
        self._node.executor.create_task(sent.set)
        sent.wait(LAST_ANSWERS)
