"""Bags as ``ros2 bag record`` makes them of what a node publishes."""

from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from bilayer_core.log.messages.cdr import Template
from bilayer_core.log.messages.description_text import to_json
from bilayer_core.log.run.log_reader import read_description, read_messages

EPOCH = 1_795_620_612 * 10**9
"""When bags are recorded: 2026-11-25 15:30:12 UTC [ns]."""
TYPES = get_typestore(Stores.ROS2_JAZZY)
LATENCY = 50_000
"""Between messages that a node sends one after the other [ns]."""
UNSENT = ("/bilayer_sim/state", "/bilayer_sim/inputs", "/bilayer_sim/stimulus/humidity")
"""Topics of a log that the tests' nodes do not send."""


def text_message(text) -> bytes:
    """A ``std_msgs/String``."""
    template = Template()
    template.text(text)
    return template.to_bytes()


def live_messages(log, node="/bilayer_sim", begin=EPOCH, described=True):
    """Topic, ROS type, time of recording [ns] and data of what a node would have sent in the run of a log."""
    if described:
        text = to_json(read_description(log))
        yield f"{node}/description", "std_msgs/msg/String", begin, text_message(text)
    for number, (topic, ros_type, time, data) in enumerate(read_messages(log)):
        if data is not None and topic not in UNSENT:
            name = topic.replace("/bilayer_sim", node)
            yield name, ros_type, begin + time + LATENCY * (number % 15), data


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


def write_mcap(path, messages, encoding="cdr", sent=lambda time: time, **options):
    """Write an MCAP file by the library's own writer, with its options; `sent` makes times of sending of those of
    recording.
    """
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="ros2", library="tests")
        channels = {}
        for topic, ros_type, time, data in messages:
            if topic not in channels:
                schema = writer.register_schema(ros_type, "ros2msg", b"") if ros_type else 0
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], time, data, sent(time))
        writer.finish()
    return path
