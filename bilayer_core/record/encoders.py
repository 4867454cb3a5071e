"""From a `Frame` to the bytes of ROS messages, for the log and for `publish`."""

from __future__ import annotations

from bilayer_core.integrate.frame import Description, Frame
from bilayer_core.record.topics import TopicSpec


class FrameEncoder:
    """Encodes frames of one model as ROS 2 messages (CDR, little-endian, with the 4-byte header).

    Not safe to share between threads: each takes its own.

    Parameters
    ----------
    description : Description
        Of the model whose frames come.

    Attributes
    ----------
    topics : tuple of TopicSpec
        What `encode` understands, see `output_topics`.
    """

    topics: tuple[TopicSpec, ...]

    def __init__(self, description: Description):
        raise NotImplementedError

    def encode(self, name: str, frame: Frame) -> bytes:
        """The message of topic `name` (a `TopicSpec.name`) for `frame`; give it to ``publish`` as it is."""
        raise NotImplementedError


def encode_float64(value: float) -> bytes:
    """A ``std_msgs/Float64``."""
    raise NotImplementedError
