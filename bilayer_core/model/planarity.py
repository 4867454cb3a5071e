"""Planarity of a scene: whether everything in it stays in one plane, and if not, what leaves it.

A scene stays in a plane if it is its own mirror image there: its rods lie in the plane with their width across it, what
acts on them and how they move lies in it, surfaces and free bodies are symmetric about it. Then nothing pushes out of
it. A surface may also be unsymmetric but run on along the normal as far as anything can touch it.
(In space a rod may buckle out of the plane; in two dimensions it cannot.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.errors import SceneError
from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.plane import Plane
from bilayer_core.model.shape_numbers import Shape, obstacle_pose, shape_of
from bilayer_core.scene.body import Body, Free, Guided, Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.joint import TURNS
from bilayer_core.scene.profile import extremes
from bilayer_core.scene.rod import Rod, RodCopy

Array = np.ndarray
ROUNDING = 1e-9
"""Of directions, and of positions as multiples of the longest rod: no further from a plane than typed numbers are."""


def find_plane(scene: SceneConfig) -> tuple[Plane | None, str]:
    """Return the plane of a scene and why it stays in it, or None and what leaves the plane of its first rod."""
    return scene.keep("plane", (), lambda: _find_plane(scene))


def _find_plane(scene: SceneConfig) -> tuple[Plane | None, str]:
    plane = _plane_of(scene.rods[0].copies[0])
    offence = next(_Survey(scene, plane).offences(), None)
    return (plane, f"all stays in {plane}") if offence is None else (None, offence)


def require_plane(scene: SceneConfig) -> Plane:
    """Return the plane of a scene.

    Raises
    ------
    SceneError
        If it does not stay in one.
    """
    plane, reason = find_plane(scene)
    if plane is None:
        raise SceneError(
            f"{scene.name}: solver.dimension: found 2, but {reason}; for this scene it must be 'auto' or 3"
        )
    return plane


def _frames(copy: RodCopy, arc: Array) -> tuple[Array, Array, Array]:
    """Return the points [m], tangents and normals of the path of a rod at lengths along it [m]."""
    points, tangents, normals = copy.rod.frames_at(arc)
    place = copy.place
    return place.points(points), place.directions(tangents), place.directions(normals)


def _plane_of(copy: RodCopy) -> Plane:
    """Return the plane of the path and normal of a rod."""
    point, p, q = (part[0] for part in _frames(copy, np.zeros(1)))
    normal = cross(p[None], q[None])[0]
    axis = int(np.argmax(np.abs(normal)))
    others = [other for other in range(3) if other != axis]
    if np.all(np.abs(normal[others]) < ROUNDING):
        axes = np.eye(3)[others]
    else:
        q = np.cross(normal / np.linalg.norm(normal), p)
        axes = np.stack([p, q / np.linalg.norm(q)])
    return Plane(point, axes)


class _Survey:
    def __init__(self, scene: SceneConfig, plane: Plane):
        self._scene, self._plane, self._normal = scene, plane, plane.normal
        self._size = max(rod.path.length for rod in scene.rods)
        self._extent = max(
            (abs(self._height(self._place(body, p.position))) for body in scene.bodies for p in body.contact_points),
            default=0.0,
        )
        self._free_surface = any(isinstance(body.motion, Free) and body.surface for body in scene.bodies)

    def _height(self, point) -> float:
        """Return the height of a point over the plane [m]."""
        return float(self._normal @ (np.array(point) - self._plane.point))

    def _lies_in(self, *vectors) -> bool:
        """Return whether all vectors are directions in the plane, or zero."""
        v = np.array(vectors).reshape(-1, 3)
        return bool(np.all(np.abs(v @ self._normal) <= ROUNDING * np.linalg.norm(v, axis=1)))

    def _is_on(self, *points) -> bool:
        heights = (np.array(points).reshape(-1, 3) - self._plane.point) @ self._normal
        return bool(np.all(np.abs(heights) <= ROUNDING * self._size))

    def _along_normal(self, *vectors) -> bool:
        """Return whether all vectors are parallel to the normal, or zero."""
        return all(np.linalg.norm(np.cross(v, self._normal)) <= ROUNDING * np.linalg.norm(v) for v in vectors)

    def _place(self, body: Body, point) -> Array:
        """Return where a point of a body's frame is at the start [m]."""
        return np.array(body.position) + rotation_matrix(np.array(body.rotation)) @ np.array(point)

    def offences(self) -> Iterator[str]:
        """Yield a sentence for each part of the scene that leaves the plane or is not symmetric about it."""
        scene, plane = self._scene, self._plane
        for what in self._vectors():
            yield f"{what} leaves {plane}"
        for rod in scene.rods:
            if rod.imperfection is not None and rod.imperfection.direction != "normal":
                yield f"rods.{rod.name}.imperfection leaves {plane}"
            for layer in rod.layers:
                if layer.natural_curvature_across is not None and any(extremes(layer.natural_curvature_across)):
                    yield f"rods.{rod.name}.layers.{layer.name}.natural_curvature_across leaves {plane}"
                least, most = extremes(layer.fibres.angle) if layer.fibres is not None else (0.0, 0.0)
                if least != most or abs(np.sin(2.0 * least)) > ROUNDING:
                    yield f"rods.{rod.name}.layers.{layer.name}.fibres turn the rod out of {plane}"
                if any(extremes(layer.natural_twist)):
                    yield f"rods.{rod.name}.layers.{layer.name}.natural_twist turns the rod out of {plane}"
        for body in scene.bodies:
            if self._carries_points(body) and not self._mirrored(self._points(body)):
                yield f"the points by which bodies.{body.name} touches are not symmetric about {plane}"
            if body.surface is not None:
                shape, rotation = shape_of(body.surface), rotation_matrix(np.array(body.rotation))
                if not self._fits(shape, np.array(body.position), rotation, isinstance(body.motion, Free)):
                    yield f"bodies.{body.name}.surface is not symmetric about {plane}"
        for obstacle in scene.obstacles:
            if not self._fits(shape_of(obstacle), *obstacle_pose(obstacle)):
                yield f"obstacles.{obstacle.name} is not symmetric about {plane}"

    def _vectors(self) -> Iterator[str]:
        """Yield the keys of rods, directions and motions that leave the plane."""
        scene = self._scene
        for rod in scene.rods:
            for copy in rod.copies:
                points, *directions = _frames(copy, 0.5 * rod.edge_length * np.arange(2 * rod.stations - 1))
                if not (self._is_on(points) and self._lies_in(*directions)):
                    yield f"rods.{copy.name}"
        if not self._lies_in(scene.gravity):
            yield "gravity"
        for name, channel in scene.stimuli.items():
            if channel.light is not None and not self._lies_in(channel.light.from_direction):
                yield f"stimuli.{name}.light.from"
        if scene.fluid is not None and not self._lies_in(scene.fluid.velocity):
            yield "fluid.velocity"
        yield from self._velocities("", scene)
        for rod in scene.rods:
            yield from self._velocities(f"rods.{rod.name}.", rod)
        for body in scene.bodies:
            yield from (f"bodies.{body.name}.{key}" for key in self._motions(body))
        for joint in scene.joints:
            for key, axis in (("axis", joint.axis), ("second_axis", joint.second_axis)):
                if axis is None or self._along_normal(axis):
                    continue
                if joint.type in TURNS or not self._lies_in(axis):
                    yield f"joints.{joint.name}.{key}"
            if not self._is_on(joint.point):
                yield f"joints.{joint.name}.point"
        for what, axis in self._friction_axes():
            if not (self._lies_in(axis) or self._along_normal(axis)):
                yield what
        for load in scene.loads:
            force, moment = self._of_load(load)
            if not self._lies_in(force):
                yield f"loads.{load.name}.force"
            if not self._along_normal(moment):
                yield f"loads.{load.name}.moment"

    def _friction_axes(self) -> Iterator[tuple[str, Array]]:
        """Yield the directions by which friction differs, in the world at the start."""
        scene = self._scene
        law = scene.friction
        if law is not None and law.axis is not None:
            yield "contact.friction.axis", np.array(law.axis)
        for body in scene.bodies:
            if body.surface is not None and body.surface.grain is not None:
                yield f"bodies.{body.name}.surface.grain", self._place(body, body.surface.grain) - body.position
        for obstacle in scene.obstacles:
            if obstacle.grain is not None:
                yield f"obstacles.{obstacle.name}.grain", obstacle_pose(obstacle)[1] @ np.array(obstacle.grain)

    def _motions(self, body: Body) -> Iterator[str]:
        """Yield the keys of a body's motion that leave the plane."""
        motion = body.motion
        if isinstance(motion, Prescribed):
            if not self._lies_in(*motion.displacements):
                yield "motion.displacements"
            if not self._along_normal(*motion.rotations):
                yield "motion.rotations"
        elif isinstance(motion, Guided):
            if motion.axis is not None and not self._lies_in(motion.axis):
                yield "motion.axis"
            if motion.hinge is not None and not self._along_normal(motion.hinge):
                yield "motion.hinge"
            if motion.pinned:
                yield from self._inertia(body)
        else:
            if not self._is_on(body.position):
                yield "position"
            yield from self._velocities("motion.", motion)
            yield from self._inertia(body)

    def _velocities(self, where: str, part: SceneConfig | Rod | Free) -> Iterator[str]:
        """Yield the keys of a part's motion at the start that leave the plane."""
        if part.velocity is not None and not self._lies_in(part.velocity):
            yield f"{where}velocity"
        if part.angular_velocity is not None and not self._along_normal(part.angular_velocity):
            yield f"{where}angular_velocity"

    def _inertia(self, body: Body) -> Iterator[str]:
        """Yield the key of the inertia of a body that turns, if it would turn it out of the plane."""
        motion, rotation = body.motion, rotation_matrix(np.array(body.rotation))
        if motion.inertia is not None:
            inertia = np.diag(motion.inertia)
        elif motion.mass > 0.0:
            inertia = shape_of(body.surface).inertia(motion.mass)
        else:
            return  # that of rods in the plane
        if not self._along_normal(rotation @ inertia @ rotation.T @ self._normal):
            yield "motion.inertia, of which no principal axis is along its normal,"

    def _of_load(self, load) -> tuple[Array, Array]:
        """Return the force and moment of a load in the world's axes at the start, but that of a rod in the axes of the
        first.
        """
        force, moment = np.array(load.force), np.array(load.moment)
        if load.frame == "world":
            return force, moment
        if load.body is not None:
            body = next(body for body in self._scene.bodies if body.name == load.body)
            rotation = rotation_matrix(np.array(body.rotation))
            return rotation @ force, rotation @ moment
        return force[2] * self._normal, moment  # along path × normal, which is ± the plane's

    def _carries_points(self, body: Body) -> bool:
        """Return whether forces on a body's points could turn a free body out of the plane: it, or one whose surface
        they meet.
        """
        return not isinstance(body.motion, Prescribed) and body.motion.turns or self._free_surface

    def _points(self, body: Body) -> Array:
        """Return the places of its contact points and those of its surface, with radius and length [m], shape
        (·, 5).
        """
        points = [(*self._place(body, p.position), p.offset, p.length) for p in body.contact_points]
        if body.surface is not None:
            of_surface, radius, length = shape_of(body.surface).points()
            points += [(*self._place(body, point), radius, length) for point in of_surface]
        return np.array(points).reshape(-1, 5)

    def _mirrored(self, points: Array) -> bool:
        """Return whether a set of points is its own mirror image in the plane."""
        image = points.copy()
        image[:, :3] -= 2.0 * np.outer((points[:, :3] - self._plane.point) @ self._normal, self._normal)
        apart = np.abs(points[:, None] - image[None]).max(axis=2, initial=0.0)
        return bool(np.all(apart.min(axis=1, initial=np.inf) <= ROUNDING * self._size)) if len(points) else True

    def _fits(self, shape: Shape, position: Array, rotation: Array, free: bool = False) -> bool:
        """Return whether a surface is symmetric about the plane, or runs on along the normal wherever it can be
        touched.
        """
        axes = rotation @ shape.rotation
        if shape.kind == "plane":
            return self._lies_in(axes[:, 2])
        if shape.kind == "sphere":
            return self._is_on(position)
        along = next((k for k in range(3) if self._along_normal(axes[:, k])), None)
        if shape.kind == "cylinder" and along != 2:
            return self._is_on(position) and self._lies_in(axes[:, 2])
        if along is None:
            return False
        if free or self._free_surface:
            return self._is_on(position)
        return self._is_on(position) or abs(self._height(position)) + self._extent <= shape.core[along]
