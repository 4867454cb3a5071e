"""From a `Frame` to the bytes of ROS messages, for the log and for `publish`.

Each message is a template whose arrays are overwritten: some microseconds instead of milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from bilayer_core.log.messages.cdr import SEPARATOR, Template, read_float64_multi_array
from bilayer_core.log.messages.markers import MarkerEncoder
from bilayer_core.log.messages.node_frames import NodeFrames
from bilayer_core.log.messages.tf_frames import TfEncoder
from bilayer_core.log.messages.topics import CONTACT_PAIRS, FRAME_ID, JOINTS, MARKERS, SECTION_POINTS, TF, output_topics
from bilayer_core.observed.frame import Description, Frame
from bilayer_core.observed.inputs import OPTIONAL, SIZES, Input
from bilayer_core.printable import shortened

POINT_FIELDS = ("x", "y", "z", "strain", "curvature", "fx", "fy", "fz")
SECTION_FIELDS = ("x", "y", "z", "curvature")
SOLVER_LABELS = ("iterations", "residual", "substeps", "min_gap", "cpu_time")
_FLOAT32_FIELD = 7  # sensor_msgs/PointField.FLOAT32


def state_template(description: Description) -> Template:
    """Return the template of a state; each name is ``name:shape`` of a part, for example ``positions:393x3``."""
    layout = description.state_layout
    names = (f"{name}:{'x'.join(map(str, shape))}" for name, shape in layout)
    return multi_array_template(names, sum(math.prod(shape) for _, shape in layout))


def contact_pairs_template(description: Description) -> Template:
    """Return the template of forces between pairs; each name is that of both, with a space between."""
    return multi_array_template(map(" ".join, description.contact_pairs))


def clock_template() -> Template:
    """Return ``rosgraph_msgs/Clock``."""
    template = Template()
    template.stamp()
    return template


def float64_template() -> Template:
    """Return ``std_msgs/Float64``: field ``data``."""
    template = Template()
    template.array("data", "<f8", (1,))
    return template


def multi_array_template(names: Iterable[str], size: int | None = None) -> Template:
    """Return ``std_msgs/Float64MultiArray``: one dimension of so many values, by default one for each name; its label
    has the names, with commas between.
    """
    names = list(names)
    size = len(names) if size is None else size
    template = Template()
    template.put("<u4", 1)
    template.text(SEPARATOR.join(names))
    template.put("<u4", size, size)  # size, stride
    template.put("<u4", 0, size)  # data_offset, length of data
    template.array("data", "<f8", (size,))
    return template


def stamped_template(numbers: int) -> Template:
    """Return the template of a header and some float64 in a field ``data``.

    These are PointStamped (3 numbers), WrenchStamped (6) and PoseStamped (7).
    """
    template = Template()
    template.header(FRAME_ID)
    template.array("data", "<f8", (numbers,))
    return template


def pose_array_template(count: int) -> Template:
    """Return ``geometry_msgs/PoseArray``: field ``poses``, rows x y z and quaternion x y z w."""
    template = Template()
    template.header(FRAME_ID)
    template.put("<u4", count)
    template.array("poses", "<f8", (count, 7))
    return template


def point_cloud_template(count: int, fields: tuple[str, ...] = POINT_FIELDS) -> Template:
    """Return ``sensor_msgs/PointCloud2``: field ``points``, rows of float32 with these names."""
    step = 4 * len(fields)
    template = Template()
    template.header(FRAME_ID)
    template.put("<u4", 1, count, len(fields))  # height, width, number of fields
    for index, name in enumerate(fields):
        template.text(name)
        template.put("<u4", 4 * index)
        template.put("u1", _FLOAT32_FIELD)
        template.put("<u4", 1)
    template.put("u1", 0)  # is_bigendian
    template.put("<u4", step, step * count, step * count)  # point_step, row_step, length of data
    template.array("points", "<f4", (count, len(fields)), alignment=1)
    template.put("u1", 1)  # is_dense
    return template


def encode_float64(value: float) -> bytes:
    """Return a ``std_msgs/Float64`` as bytes."""
    template = float64_template()
    template.views()["data"][0] = value
    return template.to_bytes()


def encode_input(told: Input) -> bytes:
    """Return an input as a message of `topics.INPUTS`."""
    template = multi_array_template(("step", "time", f"{told.kind}:{told.name}"), 2 + len(told.values))
    template.views()["data"][:] = (told.step, told.time, *told.values)
    return template.to_bytes()


def decode_input(data: bytes) -> Input:
    """Return the input of such a message; ValueError if it is of no kind, or has not the values of its kind."""
    (_, _, label), values = read_float64_multi_array(data)
    kind, _, name = label.partition(":")
    given = values[2:].tolist()
    if kind not in SIZES or not SIZES[kind] - OPTIONAL.get(kind, 0) <= len(given) <= SIZES[kind]:
        raise ValueError(f"an input {shortened(kind)!r} with {len(given)} values is not known")
    return Input(int(values[0]), float(values[1]), kind, name, tuple(given))


class FrameEncoder:
    """Encodes frames of one model as ROS 2 messages (CDR, little-endian, with the 4-byte header).

    Not safe to share between threads: each takes its own.

    `description`: of the model whose frames come. `tf`: what the names of frames on ``/tf`` begin with; empty: there is
    no such topic.
    """

    def __init__(self, description: Description, tf: str = ""):
        self.topics = output_topics(description, bool(tf))  # What `encode` understands, see `output_topics`
        self._node_frames = NodeFrames(description)
        self._energy: tuple[tuple[str, ...], SmallMessage] = ((), SmallMessage(multi_array_template(())))
        self._markers = MarkerEncoder(description, self._node_frames)
        self._encoders: dict[str, Callable[[Frame], bytes]] = {
            "/clock": SmallMessage(clock_template()),
            "stimulus_applied": SmallMessage(multi_array_template(description.channels), lambda frame: frame.stimulus),
            "com": SmallMessage(stamped_template(3), lambda frame: frame.com),
            "energy": self._encode_energy,
            "solver": SmallMessage(
                multi_array_template(SOLVER_LABELS),
                lambda frame: [getattr(frame, name) for name in SOLVER_LABELS],
            ),
            CONTACT_PAIRS.name: SmallMessage(contact_pairs_template(description), lambda frame: frame.pair_forces),
            JOINTS.name: SmallMessage(
                multi_array_template(description.joint_labels), lambda frame: frame.joint_figures
            ),
            "state": SmallMessage(state_template(description), lambda frame: frame.state),
            "nodes": SmallMessage(pose_array_template(len(self._node_frames.order)), self._poses),
            "points": SmallMessage(
                point_cloud_template(description.node_count),
                lambda frame: np.column_stack([frame.positions, frame.strain, frame.curvature, frame.contact_forces]),
            ),
            SECTION_POINTS.name: SmallMessage(
                point_cloud_template(description.node_count, SECTION_FIELDS),
                lambda frame: np.column_stack([frame.positions, frame.section_curvature]),
            ),
            MARKERS: self._markers.encode,
        }
        if tf:
            self._encoders[TF.name] = TfEncoder(description, self._node_frames, tf).encode
        for index, body in enumerate(description.bodies):
            self._encoders[f"body_pose/{body.name}"] = SmallMessage(
                stamped_template(7),
                lambda frame, i=index: np.concatenate([frame.body_positions[i], frame.body_quaternions[i]]),
            )
            self._encoders[f"contact_wrench/{body.name}"] = SmallMessage(
                stamped_template(6), lambda frame, i=index: frame.contact_wrenches[i]
            )
            if body.holds_rods:
                self._encoders[f"clamp_wrench/{body.name}"] = SmallMessage(
                    stamped_template(6), lambda frame, i=index: frame.clamp_wrenches[i]
                )

    def encode(self, name: str, frame: Frame) -> bytes:
        """Return the message of topic `name` (a `TopicSpec.name`) for `frame`, ready for ``publish``."""
        return self._encoders[name](frame)

    def least_size(self, name: str) -> int:
        """Return the size of the messages of a topic but `TF` [bytes]: of energies without terms, of markers without
        contacts.
        """
        templates = {"energy": self._energy[1].template, MARKERS: self._markers.template}
        return len(templates.get(name) or self._encoders[name].template)

    def _encode_energy(self, frame: Frame) -> bytes:
        return self._energy_message(frame)(frame)

    def _energy_message(self, frame: Frame) -> SmallMessage:
        # The terms are known from the first frame on and do not change in a run.
        if self._energy[0] != tuple(frame.energy):
            message = SmallMessage(multi_array_template(frame.energy), lambda frame: list(frame.energy.values()))
            self._energy = (tuple(frame.energy), message)
        return self._energy[1]

    def _poses(self, frame: Frame) -> np.ndarray:
        self._node_frames.update(frame)
        return np.hstack([self._node_frames.positions, self._node_frames.quaternions])


class SmallMessage:
    """Encoder of a message with stamps and at most one array. `values`: takes that array from a frame."""

    def __init__(self, template: Template, values: Callable[[Frame], np.ndarray | list[float]] | None = None):
        self.template, self.values = template, values
        self._data = next(iter(template.views().values()), None)

    def __call__(self, frame: Frame) -> bytes:
        """Return the message for `frame`."""
        if self.values is not None:
            self._data[:] = self.values(frame)
        self.template.set_time(frame.time)
        return self.template.to_bytes()
