"""Publishers that cost an executor nothing."""

from __future__ import annotations

from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile


def create_output(node: Node, message_type: type, topic: str, quality: QoSProfile | int) -> Publisher[Any]:
    """A publisher without rclpy's watch for subscribers that cannot hear it, for which an executor looks twice a topic
    at each message that comes in: a third of what a message costs. `GraphWatch` tells of them instead.
    """
    unwatched = PublisherEventCallbacks(use_default_callbacks=False)
    return node.create_publisher(message_type, topic, quality, event_callbacks=unwatched)
