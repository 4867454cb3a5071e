"""Services that answer when another thread has done what was asked."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future as AwaitedFuture
from std_srvs.srv import Trigger

from bilayer_core.errors import BilayerError

# Longest wait for the last answers to be sent [s].
LAST_ANSWERS = 1.0


@dataclass(frozen=True)
class Service:
    """One service."""

    name: str  # Under the node's own
    type: type  # Of requests and responses
    ask: Callable[[Any], Future]
    """Has what a request says done; returns the future of what came of it. `BilayerError` is a refusal."""
    answer: Callable[[Any, Future], None]  # Writes that into a response, from the future, which is done


def trigger(name: str, ask: Callable[[], Future]) -> Service:
    """Return a service without arguments, whose answer is a text: that of the future, or the reason of a refusal."""
    return Service(name, Trigger, lambda _: ask(), _say)


def _say(response: Trigger.Response, future: Future) -> None:
    try:
        response.message, response.success = future.result(), True
    except BilayerError as error:
        response.message, response.success = str(error), False


class Services:
    """Services of a node, each answered from a future; messages and other requests are served meanwhile."""

    def __init__(self, node: Node, services: Iterable[Service]):
        self._node = node
        self._unanswered = 0
        self._answered_at = -math.inf
        self._all_answered = threading.Condition()
        group = ReentrantCallbackGroup()
        for service in services:
            answer = partial(self._answer, service)
            node.create_service(service.type, f"~/{service.name}", answer, callback_group=group)

    async def _answer(self, service: Service, request: Any, response: Any) -> Any:
        with self.answering():
            future = service.ask(request)
            await self.in_executor(future)
            service.answer(response, future)
        return response

    @contextmanager
    def answering(self) -> Iterator[None]:
        """Let `finish` wait while this lasts: something is asked, and its answer has not been given."""
        with self._all_answered:
            self._unanswered += 1
        try:
            yield
        finally:
            with self._all_answered:
                self._unanswered -= 1
                self._answered_at = time.monotonic()
                self._all_answered.notify_all()

    def in_executor(self, future: Future) -> AwaitedFuture:
        """Return a future that a coroutine of the node's executor awaits until `future` is done."""
        executor = self._node.executor
        awaited = AwaitedFuture(executor=executor)

        def done(_: Future) -> None:
            awaited.set_result(None)
            executor.wake()

        future.add_done_callback(done)
        return awaited

    def finish(self) -> None:
        """Return when the answers to all that was asked are sent; their futures are done. Nobody is to wait for longer
        than `LAST_ANSWERS`, as where the executor has ended.
        """
        with self._all_answered:
            self._all_answered.wait_for(lambda: self._unanswered == 0, LAST_ANSWERS)
        executor = self._node.executor
        if executor is None or time.monotonic() - self._answered_at > LAST_ANSWERS:
            return
        sent = threading.Event()
        executor.create_task(sent.set)
        sent.wait(LAST_ANSWERS)
