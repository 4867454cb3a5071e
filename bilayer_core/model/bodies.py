"""Rigid bodies: where they start, how they may move, and their inertia."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.model import PlacedBodies
from bilayer_core.model.plane import Plane
from bilayer_core.model.records.parts import Bodies
from bilayer_core.model.shape_numbers import Shape, shape_of
from bilayer_core.model.strands import Collected
from bilayer_core.scene.body import Body, Free, Guided, Prescribed
from bilayer_core.scene.config import SceneConfig

ROLL_OF_BODY = 0.25
"""Of the moment of an edge about the path, what a body without mass has that holds the edge's end."""


def build_bodies(scene: SceneConfig, found: Collected, plane: Plane | None = None) -> tuple[PlacedBodies, Bodies]:
    """Return the bodies of a scene, and their numbers and inertia; free ones move in `plane` alone if one is given."""
    motions = np.eye(6) if plane is None else plane.motions
    free = [index for index, body in enumerate(scene.bodies) if not isinstance(body.motion, Prescribed)]
    count = len(scene.bodies)
    allowed = []
    for slot, index in enumerate(free):
        motion = scene.bodies[index].motion
        own = motions if isinstance(motion, Free) else guided_motions(motion, motions)
        columns = np.zeros((6 * len(free), own.shape[1]))
        columns[6 * slot : 6 * slot + 6] = own
        allowed.append(columns)
    shapes = tuple(shape_of(body.surface) if body.surface else None for body in scene.bodies)
    free_index = np.full(count + 1, -1, dtype=np.int64)
    free_index[free] = np.arange(len(free))
    held = _inertia_of_held(found, count)
    _hand_over_roll(scene, found)
    moments = np.array([_second_moment(scene.bodies[i], shapes[i], held[i]) for i in free]).reshape(len(free), 3, 3)
    mass = np.array([scene.bodies[index].motion.mass for index in free], dtype=float)
    freedom = np.concatenate(allowed, axis=1) if free else np.zeros((0, 0))
    prescribed = ((index, body.motion) for index, body in enumerate(scene.bodies) if index not in free)
    placed = PlacedBodies(
        names=tuple(body.name for body in scene.bodies),
        start_position=np.array([body.position for body in scene.bodies], dtype=float).reshape(count, 3),
        start_rotation=np.array([rotation_matrix(np.array(b.rotation)) for b in scene.bodies]).reshape(count, 3, 3),
        shapes=shapes,
        controlled=np.array([index for index, motion in prescribed if motion.controlled], dtype=np.int64),
    )
    return placed, Bodies(
        free_index=free_index,
        body_of_free=np.array(free, dtype=np.int64),
        prescribed=np.flatnonzero(free_index[:-1] < 0),
        mass=mass,
        second_moment=moments,
        inertia=np.ravel([np.repeat([m, np.trace(j)], 3) for m, j in zip(mass, moments, strict=True)]),
        freedom=freedom,
        freedom_first=6 * (np.argmax(freedom != 0.0, axis=0) // 6) if free else free_index[:0],
        freedom_alone=_alone(freedom) if free else free_index[:0],
        bounding_radius=_bounding_radii(scene, found, shapes, free, moments),
        rotates=np.array([index in free or body.motion.turns for index, body in enumerate(scene.bodies)], dtype=bool),
    )


def robot_bodies(scene: SceneConfig, holders: Iterable[int], apart: Iterable[int] = ()) -> list[int]:
    """Return the bodies that hold rods, or are joined to such a body, without prescribed ones and those set `apart`."""
    places = {body.name: index for index, body in enumerate(scene.bodies)}
    moving = {index for index, body in enumerate(scene.bodies) if not isinstance(body.motion, Prescribed)} - {*apart}
    robot, size = moving & {*holders}, -1
    while size != len(robot):
        size = len(robot)
        for joint in scene.joints:
            pair = {places[name] for name in joint.bodies}
            robot |= pair & moving if pair & robot else set()
    return sorted(robot)


def robot_mass(scene: SceneConfig, found: Collected, bodies: Bodies) -> np.ndarray:
    """Return the mass of each body that belongs to the robot, 0 of others [kg], shape (n_body,)."""
    mass, own = np.zeros(len(scene.bodies)), robot_bodies(scene, found.column("attached_body", np.int64).tolist())
    mass[own] = bodies.mass[bodies.free_index[own]]
    return mass


def _bounding_radii(
    scene: SceneConfig, found: Collected, shapes: tuple[Shape | None, ...], free: list[int], moments: np.ndarray
) -> np.ndarray:
    """Return the largest distance of what each body, and last the world, carries from its position [m]: nodes, points,
    surface; of a free body without a surface at least its radius of gyration.
    """
    bounding_radius = np.zeros(len(shapes) + 1)
    for index, moment in zip(free, moments, strict=True):
        if scene.bodies[index].motion.mass > 0.0:
            bounding_radius[index] = np.sqrt(np.trace(moment) / scene.bodies[index].motion.mass)
    for index, (body, shape) in enumerate(zip(scene.bodies, shapes, strict=True)):
        if shape is not None:
            bounding_radius[index] = shape.bound if np.isfinite(shape.bound) else 0.0
        distances = (float(np.linalg.norm(point.position)) for point in body.contact_points)
        bounding_radius[index] = max([bounding_radius[index], *distances])
    arms = np.linalg.norm(found.column("attached_position", width=3), axis=1)
    np.maximum.at(bounding_radius, found.column("attached_body", np.int64), arms)
    return bounding_radius


def guided_motions(motion: Guided, motions: np.ndarray) -> np.ndarray:
    """Return the motions (X, φ) of a body that a rail, a hinge and a pin leave, a column each, shape (6, ·)."""
    columns = []
    if motion.axis is not None:
        columns.append([*motion.axis, 0.0, 0.0, 0.0])
    if motion.hinge is not None:
        columns.append([0.0, 0.0, 0.0, *motion.hinge])
    if motion.pinned:
        columns += [column for column in motions.T if not column[:3].any()]
    return np.array(columns).T


def _alone(freedom: np.ndarray) -> np.ndarray:
    """Return the row of each column that is a unit vector, −1 for others."""
    units = (freedom == 1.0) & (np.sum(freedom != 0.0, axis=0) == 1)
    return np.where(units.any(axis=0), np.argmax(units, axis=0), -1)


def _inertia_of_held(found: Collected, count: int) -> np.ndarray:
    """Return the moments of inertia of the half edges that bodies hold [kg m²], in the bodies' axes, shape (n_body, 3,
    3).

    A half edge of the length l and the mass m, with the moment I of its section along the tangent t, has about its end

        I t tᵀ + (m l²/3 + I/2) (1 − t tᵀ)

    (of its section the mean of both directions across). Its mass is that of its node, which moves with the body. Of the
    moment about the path a body has the part that is nearer to it than to the middle of the edge, `ROLL_OF_BODY` of the
    whole edge's; the rest is the edge's own.
    """
    inertia = np.zeros((count, 3, 3))
    node, tangents = found.column("attached_node", np.int64), found.column("clamp_edge_tangent", width=3)
    edge = found.column("node_edges", np.int64, 2)[node, 0]
    roll = found.column("spin_inertia")[edge]
    along = ROLL_OF_BODY * roll
    across = found.column("edge_mass")[edge] * found.column("rest_length")[edge] ** 2 / 24.0 + 0.25 * roll
    on_axis = tangents[:, :, None] * tangents[:, None]
    held = along[:, None, None] * on_axis + across[:, None, None] * (np.eye(3) - on_axis)
    np.add.at(inertia, found.column("attached_body", np.int64), held)
    return inertia


def _hand_over_roll(scene: SceneConfig, found: Collected) -> None:
    """Take from the edges next to bodies without mass the moment about the path that these bodies have of them."""
    node, body = found.column("attached_node", np.int64), found.column("attached_body", np.int64)
    without = np.array([_moves_with_rods(one) for one in scene.bodies], dtype=bool)
    edge = found.column("node_edges", np.int64, 2)[node[without[body]], 0]
    spin_inertia = found.column("spin_inertia").copy()
    np.subtract.at(spin_inertia, edge, ROLL_OF_BODY * found.column("spin_inertia")[edge])
    found.columns["spin_inertia"] = [spin_inertia]


def _moves_with_rods(body: Body) -> bool:
    """Return whether the inertia of a body is that of the half edges it holds."""
    motion = body.motion
    return not isinstance(motion, Prescribed) and motion.turns and motion.inertia is None and motion.mass == 0.0


def _second_moment(body: Body, shape: Shape | None, of_held: np.ndarray) -> np.ndarray:
    """Return J = ½ tr(I) 1 − I of a free body [kg m²]; `of_held` is the inertia of the half edges that it holds.

    A guided body that does not turn has any I, and one on a hinge a moment about every axis that is its own about the
    hinge: so its angular momentum stays along that.
    """
    motion = body.motion
    if isinstance(motion, Guided) and not motion.turns:
        inertia = np.eye(3)
    elif motion.inertia is not None:
        inertia = np.diag(motion.inertia)
    elif motion.mass == 0.0:
        inertia = of_held
    else:
        inertia = shape.inertia(motion.mass, isinstance(motion, Free) and motion.shell)
    if isinstance(motion, Guided) and motion.hinge is not None:
        hinge = rotation_matrix(np.array(body.rotation)).T @ np.array(motion.hinge)
        inertia = hinge @ inertia @ hinge * np.eye(3)
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia
