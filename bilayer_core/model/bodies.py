"""Rigid bodies: where they start, how they may move, and their inertia."""

from __future__ import annotations

import numpy as np

from ..kinematics.rotation import rotation_matrix
from ..scene.body import Body, Free, Prescribed
from ..scene.config import SceneConfig
from .model import Bodies
from .plane import Plane
from .shapes import Shape, shape_of
from .strands import Collected


def build_bodies(scene: SceneConfig, found: Collected, plane: Plane | None = None) -> Bodies:
    """Bodies of a scene; free ones move in `plane` alone if one is given."""
    motions = np.eye(6) if plane is None else plane.motions
    free = [index for index, body in enumerate(scene.bodies) if not isinstance(body.motion, Prescribed)]
    count = len(scene.bodies)
    velocity, angular_velocity = np.zeros((count, 3)), np.zeros((count, 3))
    freedom = []
    for slot, index in enumerate(free):
        motion = scene.bodies[index].motion
        allowed = np.zeros((6 * len(free), motions.shape[1] if isinstance(motion, Free) else 1))
        if isinstance(motion, Free):
            velocity[index], angular_velocity[index] = motion.velocity, motion.angular_velocity
            allowed[6 * slot : 6 * slot + 6] = motions
        else:
            velocity[index] = motion.speed * np.array(motion.axis)
            allowed[6 * slot : 6 * slot + 3, 0] = motion.axis
        freedom.append(allowed)
    shapes = tuple(shape_of(body.surface) if body.surface else None for body in scene.bodies)
    free_index = np.full(count + 1, -1, dtype=np.int64)
    free_index[free] = np.arange(len(free))
    moments = np.array([_second_moment(scene.bodies[i], shapes[i]) for i in free]).reshape(len(free), 3, 3)
    schedules = [b.motion if isinstance(b.motion, Prescribed) else Prescribed(type="prescribed") for b in scene.bodies]
    return Bodies(
        names=tuple(body.name for body in scene.bodies),
        free_index=free_index,
        body_of_free=np.array(free, dtype=np.int64),
        start_position=np.array([body.position for body in scene.bodies], dtype=float).reshape(count, 3),
        start_rotation=np.array([rotation_matrix(np.array(b.rotation)) for b in scene.bodies]).reshape(count, 3, 3),
        start_velocity=velocity,
        start_angular_velocity=angular_velocity,
        mass=np.array([scene.bodies[index].motion.mass for index in free]),
        isotropic=np.array([np.array_equal(j, j[0, 0] * np.eye(3)) for j in moments], dtype=bool),
        second_moment=moments,
        freedom=np.concatenate(freedom, axis=1) if freedom else np.zeros((0, 0)),
        bounding_radius=_bounding_radii(scene, found, shapes, free, moments),
        shapes=shapes,
        times=tuple(np.array(motion.times, dtype=float) for motion in schedules),
        displacements=tuple(np.array(motion.displacements, dtype=float).reshape(-1, 3) for motion in schedules),
        rotations=tuple(np.array(motion.rotations, dtype=float).reshape(-1, 3) for motion in schedules),
    )


def _bounding_radii(
    scene: SceneConfig, found: Collected, shapes: tuple[Shape | None, ...], free: list[int], moments: np.ndarray
) -> np.ndarray:
    """Largest distance of what each body, and last the world, carries from its position [m]: nodes, points, surface; of
    a free body without a surface at least its radius of gyration.
    """
    bounding_radius = np.zeros(len(shapes) + 1)
    for index, moment in zip(free, moments, strict=True):
        bounding_radius[index] = np.sqrt(np.trace(moment) / scene.bodies[index].motion.mass)
    for index, (body, shape) in enumerate(zip(scene.bodies, shapes, strict=True)):
        if shape is not None:
            bounding_radius[index] = shape.bound if np.isfinite(shape.bound) else 0.0
        distances = (float(np.linalg.norm(point.position)) for point in body.contact_points)
        bounding_radius[index] = max([bounding_radius[index], *distances])
    arms = np.linalg.norm(found.column("attached_position", width=3), axis=1)
    np.maximum.at(bounding_radius, found.column("attached_body", np.int64), arms)
    return bounding_radius


def _second_moment(body: Body, shape: Shape | None) -> np.ndarray:
    """J = ½ tr(I) 1 − I of a free body [kg m²]. A guided body does not turn: any I."""
    motion = body.motion
    if not isinstance(motion, Free):
        inertia = np.eye(3)
    elif motion.inertia is not None:
        inertia = np.diag(motion.inertia)
    else:
        inertia = shape.inertia(motion.mass, motion.shell)
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia
