"""Bodies and carriers: what may touch what, and whether it does at the start."""

from __future__ import annotations

import numpy as np

from ..errors import PenetrationError
from ..scene.body import Body, Free, Prescribed
from ..scene.config import SceneConfig
from .model import Bodies, Carriers, Model, body_displacement
from .rods import Collected


def build_bodies(scene: SceneConfig, found: Collected) -> Bodies:
    free = [index for index, body in enumerate(scene.bodies) if not isinstance(body.motion, Prescribed)]
    count = len(scene.bodies)
    velocity, angular_velocity = np.zeros((count, 3)), np.zeros((count, 3))
    freedom, reach = [], []
    arms = found.column("attached_position", width=3)
    for place, index in enumerate(free):
        body, motion = scene.bodies[index], scene.bodies[index].motion
        allowed = np.zeros((6 * len(free), 6 if isinstance(motion, Free) else 1))
        if isinstance(motion, Free):
            velocity[index], angular_velocity[index] = motion.velocity, motion.angular_velocity
            allowed[6 * place : 6 * place + 6] = np.eye(6)
        else:
            velocity[index] = motion.speed * np.array(motion.axis)
            allowed[6 * place : 6 * place + 3, 0] = motion.axis
        freedom.append(allowed)
        own = [
            arms[found.column("attached_body", np.int64) == index],
            [point.position for point in body.contact_points],
        ]
        lengths = [np.linalg.norm(arm) for part in own for arm in part]
        gyration = np.sqrt(np.trace(_second_moment(body)) / motion.mass)
        reach.append(max([body.surface.radius if body.surface else gyration, *lengths]))
    free_index = np.full(count, -1, dtype=np.int64)
    free_index[free] = np.arange(len(free))
    moments = np.array([_second_moment(scene.bodies[index]) for index in free]).reshape(len(free), 3, 3)
    keyframes = [
        ([], []) if i in free else (b.motion.times, b.motion.displacements) for i, b in enumerate(scene.bodies)
    ]
    return Bodies(
        names=tuple(body.name for body in scene.bodies),
        free_index=free_index,
        body_of_free=np.array(free, dtype=np.int64),
        start_position=np.array([body.position for body in scene.bodies], dtype=float).reshape(count, 3),
        start_velocity=velocity,
        start_angular_velocity=angular_velocity,
        mass=np.array([scene.bodies[index].motion.mass for index in free]),
        isotropic=np.array([np.array_equal(j, j[0, 0] * np.eye(3)) for j in moments], dtype=bool),
        second_moment=moments,
        freedom=np.concatenate(freedom, axis=1) if freedom else np.zeros((0, 0)),
        reach=np.array(reach),
        radius=np.array([body.surface.radius if body.surface else 0.0 for body in scene.bodies]),
        times=tuple(np.array(times, dtype=float) for times, _ in keyframes),
        displacements=tuple(np.array(moves, dtype=float).reshape(-1, 3) for _, moves in keyframes),
    )


def _second_moment(body: Body) -> np.ndarray:
    """J = ½ tr(I) 1 − I of a free body [kg m²]; I = 2/5 m r² for a solid ball, 2/3 m r² for a shell. A guided body
    does not turn: any I.
    """
    motion = body.motion
    if not isinstance(motion, Free):
        inertia = np.eye(3)
    elif motion.inertia is not None:
        inertia = np.diag(motion.inertia)
    else:
        inertia = (2.0 / 3.0 if motion.shell else 0.4) * motion.mass * body.surface.radius**2 * np.eye(3)
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def build_carriers(scene: SceneConfig, found: Collected, bodies: Bodies) -> Carriers:
    points = [(index, point) for index, body in enumerate(scene.bodies) for point in body.contact_points]
    spheres = [index for index, body in enumerate(scene.bodies) if body.surface is not None]
    nodes = found.node_count
    first_sphere = nodes + len(points)
    free_body = np.full(first_sphere + len(spheres), -1, dtype=np.int64)
    free_body[first_sphere:] = bodies.free_index[spheres]
    first, second = [], []
    for place, body in enumerate(spheres):
        carrier = first_sphere + place
        others = [i for i in range(first_sphere) if i < nodes or points[i - nodes][0] != body]
        others += range(first_sphere, carrier)
        moving = [i for i in others if i < nodes or max(free_body[i], free_body[carrier]) >= 0]
        first += moving
        second += [carrier] * len(moving)
    return Carriers(
        weight=np.concatenate([found.column("node_weight"), [p.length for _, p in points], bodies.radius[spheres]]),
        radius=np.concatenate([found.column("node_radius"), [p.offset for _, p in points], bodies.radius[spheres]]),
        node_edges=found.column("node_edges", np.int64, 2),
        node_axis=found.column("node_axis", np.int64),
        friction=_friction_of_carriers(scene, nodes, first_sphere + len(spheres)),
        point_body=np.array([index for index, _ in points], dtype=np.int64),
        point_position=np.array([point.position for _, point in points], dtype=float).reshape(-1, 3),
        sphere_body=np.array(spheres, dtype=np.int64),
        free_body=free_body,
        pair_first=np.array(first, dtype=np.int64),
        pair_second=np.array(second, dtype=np.int64),
        plane_point=np.array([plane.point for plane in scene.obstacles], dtype=float).reshape(-1, 3),
        plane_normal=np.array([plane.normal for plane in scene.obstacles], dtype=float).reshape(-1, 3),
    )


def _friction_of_carriers(scene: SceneConfig, nodes: int, carriers: int) -> np.ndarray:
    """Friction coefficients forward, backward and sideways of each carrier, shape (n_carrier, 3)."""
    law = scene.contact.friction if scene.contact else None
    coefficients = np.full((carriers, 3), law.coefficient if law else 0.0)
    coefficients[:nodes] = law.of_rods if law else 0.0
    return coefficients


def carrier_names(model: Model) -> list[str]:
    """What each carrier is called in messages."""
    names = [f"node {k} of {s.name}" for s in model.strands for k in range(s.node_count)]
    bodies = model.bodies.names
    names += [f"contact point {k} ({bodies[body]})" for k, body in enumerate(model.carriers.point_body)]
    return names + [f"body {bodies[body]}" for body in model.carriers.sphere_body]


def start_carriers(model: Model) -> np.ndarray:
    """Positions of all carriers at the start [m], shape (n_carrier, 3)."""
    bodies, carriers = model.bodies, model.carriers
    moved = np.array(
        [
            position + body_displacement(times, displacements, 0.0)
            for position, times, displacements in zip(
                bodies.start_position, bodies.times, bodies.displacements, strict=True
            )
        ]
    ).reshape(-1, 3)
    points = moved[carriers.point_body] + carriers.point_position
    return np.concatenate([model.start_position, points, moved[carriers.sphere_body]])


def refuse_penetration(model: Model) -> None:
    carriers, position, names = model.carriers, start_carriers(model), None
    faults = []
    for plane, point, normal in zip(model.scene.obstacles, carriers.plane_point, carriers.plane_normal, strict=True):
        gap = (position - point) @ normal - carriers.radius
        faults += [(gap[i], i, plane.name) for i in np.flatnonzero(gap <= 0.0)]
    first, second = carriers.pair_first, carriers.pair_second
    gap = np.linalg.norm(position[first] - position[second], axis=1) - carriers.radius[first] - carriers.radius[second]
    names = carrier_names(model)
    faults += [(gap[k], first[k], names[second[k]]) for k in np.flatnonzero(gap <= 0.0)]
    if faults:
        depth, carrier, surface = min(faults)
        raise PenetrationError(
            f"{model.scene.name}: the scene starts in penetration: {names[carrier]} at "
            f"({', '.join(f'{1e3 * c:.3f}' for c in position[carrier])}) mm is {-1e3 * depth:.4g} mm behind "
            f"the surface of {surface}{f', and {len(faults) - 1} more' if len(faults) > 1 else ''}; "
            "all gaps must be positive at the start"
        )
