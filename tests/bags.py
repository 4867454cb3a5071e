"""Bags as ``ros2 bag record`` makes them of what a node publishes."""

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

EPOCH = 1_795_620_612 * 10**9
"""When bags are recorded: 2026-11-25 15:30:12 UTC [ns]."""
TYPES = get_typestore(Stores.ROS2_JAZZY)


def write_bag(directory, messages, plugin=StoragePlugin.MCAP):
    """Write a bag's directory.

    Parameters
    ----------
    directory : Path
        That is made.
    messages : iterable of (str, str, int, bytes)
        Topic, ROS type, time of recording [ns], data.
    """
    with Writer(directory, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for topic, ros_type, time, data in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, ros_type, typestore=TYPES)
            writer.write(connections[topic], time, data)
    return directory
