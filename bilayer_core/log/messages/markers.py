"""Markers for RViz and Foxglove: few, with many points and steady ids, each in a namespace of its own.

================================ =============================================================================
``strands/<rod>/<layer>``        LINE_LIST: one bar across the width at each node, as thick as the spacing of
                                 nodes, so that the bars tile the ribbon; coloured by the strain in its middle, full at
                                 `STRAIN_LIMIT`
``bodies/<name>``                SPHERE, CUBE or CYLINDER (edges sharp, whatever their rounding); a small CUBE for a
                                 body without a surface
``obstacles/<name>``             the same; a plane is a CUBE of `PLANE_SIZE`, its upper face on the plane
``joints/<name>``                SPHERE for pins and universal joints, CYLINDER along an axis, CUBE for a weld; those of
                                 guided bodies are ``guides/<body>`` and ``rails/<body>``
``clamp_forces``                 LINE_LIST of arrows: the force of rods on each body that holds some, from its position,
``clamp_moments``                and their moment about it, as long as `ARROW_MOMENT` says; like contact forces
``contact_forces``               LINE_LIST of arrows from nodes and contact points. Contact forces of one scene
                                 differ by decades, so length is logarithmic: `ARROW_DECADE` times
                                 log10(1 + force / `ARROW_FORCE`). Deleted while nothing touches.
================================ =============================================================================

Viewers keep markers until something deletes them, also those of a robot that was shown before on the same topic. So the
first array of a log, and the first one that a viewer gets from a node, starts with a marker that deletes all
(`deleting_all_first`).
"""

from __future__ import annotations

import struct

import numpy as np

from bilayer_core.kinematics.marker_lines import ArrowArrays, place_arrows
from bilayer_core.kinematics.rotation import matrix_from_quaternion, quaternion_product
from bilayer_core.log.messages.cdr import HEADER, Template
from bilayer_core.log.messages.node_frames import NodeFrames, layer_rows
from bilayer_core.log.messages.ribbons import Ribbons
from bilayer_core.log.messages.topics import FRAME_ID
from bilayer_core.observed.frame import Description, Frame, ShapeInfo

STRAIN_LIMIT = 0.05
PLANE_SIZE = 1.0  # edge of the square drawn for a plane [m]
PLANE_THICKNESS = 1e-3  # [m]
ARROW_DECADE = 0.01  # length of an arrow for each power of ten [m]
ARROW_FORCE = 1e-4  # force from which arrows grow [N]
ARROW_MOMENT = 1e-6  # moment from which arrows of moments grow [N m]
ARROW_SHOWN = 1e-6  # forces below this have no arrow [N]
ARROW_WIDTH = 6e-4  # [m]
HEAD_SHARE = 0.25  # of an arrow's length
HEAD_HALF_WIDTH = 0.1  # of an arrow's length

BODY_COLOUR = (0.93, 0.62, 0.13, 1.0)
OBSTACLE_COLOUR = (0.42, 0.45, 0.50, 0.6)
ARROW_COLOUR = (0.10, 0.75, 0.35, 1.0)
JOINT_COLOUR = (0.80, 0.82, 0.86, 1.0)
CLAMP_FORCE_COLOUR = (0.20, 0.55, 0.95, 1.0)
CLAMP_MOMENT_COLOUR = (0.75, 0.35, 0.90, 1.0)

CLAMP_ARROWS = (
    ("clamp_forces", CLAMP_FORCE_COLOUR, slice(0, 3), ARROW_FORCE),
    ("clamp_moments", CLAMP_MOMENT_COLOUR, slice(3, 6), ARROW_MOMENT),
)
"""Namespace and colour of arrows, what of a wrench they show, and from which size they grow [N, N m]."""
CUBE, SPHERE, CYLINDER, LINE_LIST = 1, 2, 3, 5
ADD, DELETE, DELETE_ALL = 0, 2, 3
_IDENTITY = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_COUNT = struct.Struct("<I")
_MARKERS_START = len(HEADER) + _COUNT.size


def force_arrows(origins: np.ndarray, forces: np.ndarray, unit: float | np.ndarray = ARROW_FORCE) -> np.ndarray:
    """Return the end points of the lines that draw arrows.

    Each arrow has a shaft and two barbs; all points of a zero force are at its origin.

    `origins`, `forces`: [m, N], shape (arrows, 3). `unit`: force from which arrows grow [N], of all or of each, shape
    (arrows,). Returns pairs of points [m], shape (6 arrows, 3).
    """
    points = np.empty((len(forces), 6, 3))
    arrows = ArrowArrays(
        origin=np.ascontiguousarray(origins),
        force=np.ascontiguousarray(forces),
        unit=np.full(len(forces), unit),
        decade=ARROW_DECADE,
        head=HEAD_SHARE,
        half_width=HEAD_HALF_WIDTH,
        points=points,
    )
    place_arrows(arrows)
    return points.reshape(-1, 3)


def shape_marker(shape: ShapeInfo) -> tuple[int, tuple[float, ...], np.ndarray]:
    """Return type, scale [m] and pose (position, quaternion x y z w) in the owner's frame of the marker of a shape."""
    pose = np.array([*shape.position, *shape.quaternion])
    if shape.kind != "plane":
        return {"sphere": SPHERE, "box": CUBE, "cylinder": CYLINDER}[shape.kind], tuple(shape.size), pose
    pose[:3] -= 0.5 * PLANE_THICKNESS * matrix_from_quaternion(pose[3:])[:, 2]
    return CUBE, (PLANE_SIZE, PLANE_SIZE, PLANE_THICKNESS), pose


def delete_all() -> bytes:
    """Return a ``visualization_msgs/MarkerArray`` that deletes all markers which a viewer has on its topic."""
    template = Template()
    template.put("<u4", 1)
    _head(template, "", CUBE, (0.0,) * 4, (0.0,) * 3, action=DELETE_ALL)
    template.put("<u4", 0, 0)
    _tail(template)
    return template.to_bytes()


def deleting_all_first(message: bytes) -> bytes:
    """Return a ``MarkerArray`` of a `MarkerEncoder` with one marker more: the first, which deletes all before it.

    A viewer handles all markers of an array before it draws, so those that it shows already do not flicker. An array
    that begins so already stays as it is.
    """
    deletion = delete_all()[_MARKERS_START:]
    # The markers that follow keep their alignment: this one takes a multiple of 8 bytes.
    deletion += bytes(-len(deletion) % 8)
    if message.startswith(deletion, _MARKERS_START):
        return message
    (count,) = _COUNT.unpack_from(message, len(HEADER))
    return message[: len(HEADER)] + _COUNT.pack(count + 1) + deletion + message[_MARKERS_START:]


class MarkerEncoder:
    """Encodes frames as ``visualization_msgs/MarkerArray``; the only marker of changing size, arrows, comes last.

    `node_frames`: of the same model.
    """

    def __init__(self, description: Description, node_frames: NodeFrames):
        self._nodes = node_frames
        template = Template()
        layers = list(zip(description.layers, layer_rows(description), strict=True))
        self._holding = np.flatnonzero([body.holds_rods for body in description.bodies])
        arrows = CLAMP_ARROWS if len(self._holding) else ()
        shapes = len(description.bodies) + len(description.obstacles) + len(description.joints)
        template.put("<u4", len(layers) + shapes + len(arrows) + 1)
        for index, (layer, rows) in enumerate(layers):
            count = 2 * (rows.stop - rows.start)
            _head(template, f"strands/{layer.name}", LINE_LIST, (1.0, 1.0, 1.0, 1.0), scale_field=f"spacing{index}")
            template.put("<u4", count)
            template.array(f"points{index}", "<f8", (count, 3))
            template.put("<u4", count)
            template.array(f"colours{index}", "<f4", (count, 4))
            _tail(template)
        carried: list[tuple[int, np.ndarray, str]] = []
        hub = max(strand.width.max() for strand in description.strands)
        for index, body in enumerate(description.bodies):
            shape, size, pose = CUBE, (hub,) * 3, np.array(_IDENTITY)
            if body.shape:
                shape, size, pose = shape_marker(body.shape)
            carried.append((index, pose, f"pose{index}"))
            _head(template, f"bodies/{body.name}", shape, BODY_COLOUR, size, pose_field=f"pose{index}")
            template.put("<u4", 0, 0)
            _tail(template)
        for obstacle in description.obstacles:
            shape, size, pose = shape_marker(obstacle.shape)
            _head(template, f"obstacles/{obstacle.name}", shape, OBSTACLE_COLOUR, size, pose)
            template.put("<u4", 0, 0)
            _tail(template)
        for index, joint in enumerate(description.joints):
            shape, size, pose = shape_marker(joint.shape)
            if joint.body >= 0:
                carried.append((joint.body, pose, f"joint{index}"))
            moving = f"joint{index}" if joint.body >= 0 else ""
            _head(template, joint.name, shape, JOINT_COLOUR, size, pose, pose_field=moving)
            template.put("<u4", 0, 0)
            _tail(template)
        for name, colour, _, _ in arrows:
            count = 6 * len(self._holding)
            _head(template, name, LINE_LIST, colour, (ARROW_WIDTH, 0.0, 0.0))
            template.put("<u4", count)
            template.array(name, "<f8", (count, 3))
            template.put("<u4", 0)
            _tail(template)
        _head(template, "contact_forces", LINE_LIST, ARROW_COLOUR, (ARROW_WIDTH, 0.0, 0.0), action_field="arrows")
        template.array("arrow_count", "<u4", (1,))
        self._arrows_offset = len(template)
        template.align(8)
        self._arrows_start = len(template)
        template.put("<u4", 0)  # colours: none, the marker's own counts
        _tail(template)
        self.template = template  # The message without contact forces

        views = template.views()
        self._arrow_action, self._arrow_count = views["arrows"], views["arrow_count"]
        self._ribbons = Ribbons(description, node_frames, STRAIN_LIMIT, template)
        _ = place_arrows.address  # loaded now, and not where a log's first frame waits for it
        self._clamp_arrows = [(views[name], part, unit) for name, _, part, unit in arrows]
        self._carried = [(body, _Carried(own), views[field]) for body, own, field in carried]

    def encode(self, frame: Frame) -> bytes:
        """Return the message for `frame`."""
        nodes = self._nodes
        nodes.update(frame)
        self._ribbons.show(frame)
        positions, quaternions = frame.body_positions, frame.body_quaternions
        for body, carried, pose in self._carried:
            carried.place(positions[body], quaternions[body], pose)
        self.template.set_time(frame.time)

        forces = frame.contact_forces
        touching = np.flatnonzero(np.einsum("ij,ij->i", forces, forces) > ARROW_SHOWN**2)
        self._arrow_action[0] = ADD if len(touching) else DELETE
        self._arrow_count[0] = 6 * len(touching)
        arrows = self._arrows(frame, touching)
        message = self.template.to_bytes()
        if not len(touching):
            return message[: self._arrows_offset] + message[self._arrows_start :]
        return message[: self._arrows_start] + arrows.astype("<f8").tobytes() + message[self._arrows_start :]

    def _arrows(self, frame: Frame, touching: np.ndarray) -> np.ndarray:
        """Write the arrows of clamps, and return those of contacts, all made at once [m], shape (6 touching, 3)."""
        wrenches, held = frame.clamp_wrenches[self._holding], frame.body_positions[self._holding]
        origins = [*(held for _ in self._clamp_arrows), frame.positions[touching]]
        forces = [*(wrenches[:, part] for _, part, _ in self._clamp_arrows), frame.contact_forces[touching]]
        units = [unit for _, _, unit in self._clamp_arrows for _ in held] + [ARROW_FORCE] * len(touching)
        arrows = force_arrows(np.concatenate(origins), np.concatenate(forces), np.array(units))
        begin = 0
        for points, _, _ in self._clamp_arrows:
            points[:] = arrows[begin : begin + len(points)]
            begin += len(points)
        return arrows[begin:]


class _Carried:
    """Part with a pose of its own in the frame of a body, or of the world."""

    def __init__(self, own: np.ndarray):
        self._own, self._is_away, self._is_turned = own, bool(own[:3].any()), bool(own[6] != 1.0)

    def place(self, position: np.ndarray, quaternion: np.ndarray, pose_out: np.ndarray) -> None:
        """Write its pose in the world."""
        pose_out[:3], pose_out[3:] = position, quaternion
        if self._is_away:
            pose_out[:3] += matrix_from_quaternion(quaternion) @ self._own[:3]
        if self._is_turned:
            pose_out[3:] = quaternion_product(quaternion, self._own[3:])


def _head(
    template: Template,
    namespace: str,
    shape: int,
    colour: tuple[float, ...],
    scale: tuple[float, ...] = (),
    pose: np.ndarray | tuple[float, ...] = _IDENTITY,
    *,
    scale_field: str = "",
    pose_field: str = "",
    action: int = ADD,
    action_field: str = "",
) -> None:
    """Append a Marker up to its points; fields with a name change from frame to frame (of the scale, x alone)."""
    template.header(FRAME_ID)
    template.text(namespace)
    template.put("<i4", 0, shape)
    if action_field:
        template.array(action_field, "<i4", (1,))
    else:
        template.put("<i4", action)
    if pose_field:
        template.array(pose_field, "<f8", (7,))
    else:
        template.put("<f8", *pose)
    if scale_field:
        template.array(scale_field, "<f8", (1,))
        template.put("<f8", 0.0, 0.0)
    else:
        template.put("<f8", *scale)
    template.put("<f4", *colour)
    template.put("<i4", 0, 0)  # lifetime: for ever
    template.put("u1", 0)  # frame_locked


def _tail(template: Template) -> None:
    """Append a Marker's fields after its colours, all empty: texture, text and mesh."""
    template.text("")  # texture_resource
    template.put("<i4", 0, 0)  # stamp of the texture
    template.text("")  # frame_id of the texture
    template.text("")  # format of the texture
    template.put("<u4", 0, 0)  # texture data, uv_coordinates
    template.text("")  # text
    template.text("")  # mesh_resource
    template.text("")  # filename of the mesh
    template.put("<u4", 0)  # mesh data
    template.put("u1", 0)  # mesh_use_embedded_materials
