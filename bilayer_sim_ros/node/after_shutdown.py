"""Publishing after ROS has been shut down under a running simulation: it does nothing, and that is no error.

`rclpy.shutdown`, or the signal handlers of rclpy, may do so at any moment, and what runs in other threads learns it
from the failure of a publisher alone. The simulation goes on until it is stopped, and finishes its files.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec

from rclpy.node import Node

from bilayer_core.log.messages.events import Event
from bilayer_core.observed.frame import Frame

Arguments = ParamSpec("Arguments")


def is_valid(node: Node) -> bool:
    """Return whether a node's context is valid, without waiting for its lock, which is held while nodes are ended."""
    handle = node.context.handle
    if handle is None:
        return False
    with handle:
        return handle.ok()


def while_valid(node: Node, publish: Callable[Arguments, None]) -> Callable[Arguments, None]:
    """Return `publish`, which does nothing when the node's context has been shut down."""

    def publish_or_not(*arguments: Arguments.args, **named: Arguments.kwargs) -> None:
        try:
            publish(*arguments, **named)
        except Exception:
            if is_valid(node):
                raise

    return publish_or_not


class WhileValid:
    """A publisher of frames to whom the same applies; see `worker.Publisher`."""

    def __init__(self, node: Node, publisher: Any):
        self._node, self._publisher = node, publisher
        self._publish = while_valid(node, publisher.publish)
        self.set_rates = publisher.set_rates
        self.tell: Callable[[Event], None] = while_valid(node, publisher.tell)
        self.finish: Callable[[], None] = while_valid(node, publisher.finish)

    @property
    def wanted(self) -> bool:
        """True if anybody subscribes to anything."""
        return self._if_valid(lambda: self._publisher.wanted)

    def is_shown(self) -> bool:
        """Return whether anybody shows the run while it goes on."""
        return self._if_valid(self._publisher.is_shown)

    def publish(self, frame: Frame, everything: bool = False) -> None:
        """Send what somebody listens to."""
        self._publish(frame, everything)

    def _if_valid(self, ask: Callable[[], bool]) -> bool:
        try:
            return ask()
        except Exception:
            if is_valid(self._node):
                raise
            return False
