"""Publishers that cost an executor nothing."""

from __future__ import annotations

from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile


def create_output(node: Node, message_type: type, topic: str, quality: QoSProfile | int) -> Publisher[Any]:
    """Return a publisher without rclpy's watch for incompatible subscribers; `GraphWatch` reports these instead.

    Because of that watch an executor looks twice at each topic whenever a message arrives, a third of the cost of a
    message.
    """
    unwatched = PublisherEventCallbacks(use_default_callbacks=False)
    return node.create_publisher(message_type, topic, quality, event_callbacks=unwatched)
