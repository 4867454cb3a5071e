"""Frames of bodies and of the ends of rods, as the message ``tf2_msgs/TFMessage`` of ROS 2's topic ``/tf``.

Every frame is a child of the world. Names begin with that of the node, so that two nodes in one graph do not collide:
``bilayer_sim/hub`` is a body, at its mass centre as in ``body_pose``; ``bilayer_sim/arm_0/start`` and
``bilayer_sim/arm_0/end`` are the first and the last node of a rod, turned as in ``nodes``: x through the thickness,
y along the width, z along the tangent. A closed rod has no ends; of one whose layers are curves of their own (model
``two_rod``) those of the first layer count.
"""

from __future__ import annotations

import struct

import numpy as np

from bilayer_core.log.messages.cdr import Template
from bilayer_core.log.messages.node_frames import NodeFrames
from bilayer_core.log.messages.topics import FRAME_ID
from bilayer_core.observed.frame import Description, Frame

Array = np.ndarray
ENDS = ("start", "end")


class TfEncoder:
    """Encodes frames as such messages.

    `nodes`: of the same description. `prefix`: what names begin with, such as ``bilayer_sim``; a leading slash is left
    out, which tf2 does not allow.
    """

    def __init__(self, description: Description, nodes: NodeFrames, prefix: str):
        self._nodes, self._bodies = nodes, len(description.bodies)
        ends = _rows_of_ends(description)
        self._rows = np.array([row for rows in ends.values() for row in rows], dtype=np.intp)
        names = [body.name for body in description.bodies]
        names += [f"{rod}/{end}" for rod in ends for end in ENDS]
        self.names = tuple(f"{prefix.strip('/')}/{name}" for name in names)  # Of all frames
        self._template = Template()
        self._template.put("<u4", len(self.names))
        for k, name in enumerate(self.names):
            self._template.header(FRAME_ID)
            self._template.text(name)
            self._template.array(str(k), "<f8", (7,))
        places = [self._template.place(str(k)) for k in range(len(self.names))]
        self._places = np.array(places, dtype=np.intp)[:, None] + np.arange(7)
        self._numbers = self._template.numbers("<f8")
        self._poses = np.empty((len(self.names), 7))

    def encode(self, frame: Frame) -> bytes:
        """Return the message of a frame."""
        poses, bodies = self._poses, self._bodies
        poses[:bodies, :3], poses[:bodies, 3:] = frame.body_positions, frame.body_quaternions
        if len(self._rows):
            self._nodes.update(frame)
            poses[bodies:, :3] = self._nodes.positions[self._rows]
            poses[bodies:, 3:] = self._nodes.quaternions[self._rows]
        self._numbers[self._places] = poses
        self._template.set_time(frame.time)
        return self._template.to_bytes()


def read_prefix(description: Description, message: bytes) -> str:
    """Return what names of frames in a message of `TfEncoder` begin with; empty if it is no such message."""
    names = TfEncoder(description, NodeFrames(description), "").names
    lead = Template()
    lead.put("<u4", len(names))
    lead.header(FRAME_ID)
    lead.put("<u4", 0)  # the length of the first name
    begin = len(lead)
    (length,) = struct.unpack_from("<I", message, begin - 4) if len(message) >= begin else (0,)
    name = message[begin : begin + max(length - 1, 0)].decode(errors="replace")
    return name.removesuffix(names[0]) if names and name.endswith(names[0]) else ""


def _rows_of_ends(description: Description) -> dict[str, tuple[int, int]]:
    """Return the first and last node of the first strand of each open rod, as rows of `NodeFrames`."""
    found: dict[str, tuple[int, int]] = {}
    count = 0
    for strand in description.strands:
        size = strand.nodes.stop - strand.nodes.start
        if not strand.closed:
            found.setdefault(strand.rod, (count, count + size - 1))
        count += size
    return found
