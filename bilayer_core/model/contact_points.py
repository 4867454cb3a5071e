"""Contact points and surfaces of a scene: what may touch what, and whether it does at the start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.colliders import RODS, Collider, colliders, points_can_collide, shapes_can_collide
from bilayer_core.model.friction_pairs import friction_values
from bilayer_core.model.model import Model, PlacedBodies
from bilayer_core.model.points_between import demand_of, spacing
from bilayer_core.model.records import contacts
from bilayer_core.model.records.contacts import Sliding, Surfaces
from bilayer_core.model.rod_points import RodPoints, rod_points
from bilayer_core.model.shape_numbers import NUMBER, Shape, obstacle_pose, shape_of, signed_distance
from bilayer_core.model.strand_arrays import StrandArrays
from bilayer_core.model.strands import Collected
from bilayer_core.model.validity import bend_of
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.shape import Obstacle, Surface


@dataclass(frozen=True)
class Owned:
    """A shape and what it belongs to: its collider, its body or the world, and its pose in that frame."""

    collider: Collider
    shape: Shape
    body: int
    position: np.ndarray
    rotation: np.ndarray
    grain: np.ndarray


@dataclass(frozen=True)
class _Point:
    """A contact point of a body or of the world, and the surfaces that it meets."""

    position: np.ndarray
    radius: float
    length: float
    body: int
    can_collide: list[bool]
    grain: np.ndarray
    collider: Collider


def build_contact(
    scene: SceneConfig, found: Collected, bodies: PlacedBodies, free_index: np.ndarray, in_plane: bool
) -> dict[str, Any]:
    """Return the parts of a model that are of contact points and the surfaces that they can meet, by their names;
    `free_index` as in `Bodies`.
    """
    of_bodies, _ = colliders(scene)
    owned = owned_shapes(scene, bodies)
    surfaces = owned if scene.contact is not None else []
    owners = [surface.collider for surface in surfaces]
    points = [
        _Point(
            np.array(p.position),
            p.offset,
            p.length,
            index,
            [points_can_collide(of_bodies[index], s) for s in owners],
            _grain(body.surface),
            of_bodies[index],
        )
        for index, body in enumerate(scene.bodies)
        for p in body.contact_points
    ]
    generated = [point for part in owned for point in _points_of(part, owners)]
    world = len(scene.bodies)
    shown = points + [p for p in generated if p.body != world and p.position.any()]
    hidden = [p for p in generated if p.body == world or not p.position.any()]  # obstacles and centres of balls
    others = shown + hidden

    nodes, of_rods = found.node_count, rod_points(found, in_plane)
    held_by = np.full(nodes, -1, dtype=np.int64)
    held_by[found.column("attached_node", np.int64)] = found.column("attached_body", np.int64)
    own, free = np.array([p.body for p in others], dtype=np.int64), np.full(len(of_rods.node), -1)
    contact, node_edges = scene.contact, found.column("node_edges", np.int64, 2)
    clear = contact.barrier_distance if contact is not None else 0.0
    of_nodes, of_sections = _nodes_can_collide(found, of_rods, bodies, of_bodies, surfaces, held_by, clear)
    of_others = np.array([p.can_collide for p in others], dtype=bool).reshape(len(others), len(surfaces))
    rows = np.concatenate([of_nodes & (of_rods.node_weight > 0.0)[:, None], of_others, of_nodes[of_rods.node]])
    used = rows.any(axis=0)
    surfaces = [surface for surface, is_used in zip(surfaces, used, strict=True) if is_used]
    groups, group = _distinct(rows[:, used])

    point_body, moved_by = np.concatenate([np.full(nodes, -1), own, free]), np.concatenate([held_by, own, free])
    section = of_rods.section
    bends = {name: bend_of(scene, rod) for rod in scene.rods for name in rod.copy_names}
    radius_of_bend = np.concatenate([np.full(strand.node_count, bends[strand.rod]) for strand in found.strands])
    bent = radius_of_bend >= 0.0
    bend = min((radius for radius in bends.values() if radius >= 0.0), default=-1.0)
    flat = np.array([surface.shape.kind == "plane" for surface in surfaces], dtype=bool)
    node_between = np.where(flat[:, None], bent, True) & (section[:, 3] > 0.0)
    sharpest = np.array([demand_of(surface.shape, bend) for surface in surfaces], dtype=float)
    met = of_nodes[:, used].any(axis=0)
    divides = any(of and surface.shape.kind in DIVIDING for of, surface in zip(met, surfaces, strict=True))
    dense = bool((sharpest >= 0.0).any())
    arms = np.hypot(section[:, 1], section[:, 2]) if dense else np.linalg.norm(of_rods.arm, axis=1)
    at_edges = node_edges if dense else node_edges[of_rods.node]
    record = Surfaces.zeros(
        UNALLOCATED,
        d_hat=clear,
        stiffness=0.0,
        radius=np.concatenate([of_rods.node_radius, [p.radius for p in others], of_rods.radius]),
        weight=np.concatenate([of_rods.node_weight, [p.length for p in others], of_rods.weight]),
        contact_point_body=point_body,
        free_index=free_index if (free_index >= 0).any() else free_index[:0],
        moved_by=moved_by,
        node_free=held_by < 0,
        group=group.astype(np.int64),
        point_position=np.array([p.position for p in others], dtype=float).reshape(-1, 3),
        point_body=own,
        node_edges=node_edges,
        rod_points=(
            contacts.RodPoints(
                first=nodes + len(others),
                node=of_rods.node,
                arm=of_rods.arm,
                longest=float(arms.max()),
                node_factor=NODES_BETWEEN if dense else 1.0,
            )
            if len(arms)
            else contacts.RodPoints.absent()
        ),
        arm_factor=_arm_factor(found, arms, at_edges, dense),
        section=section,
        node_part=_node_part(node_edges),
        edge_length=found.column("rest_length"),
        node_can_collide=np.ascontiguousarray(of_nodes[:, used].T),
        edge_can_collide=_of_edges(found, of_sections[:, used]),
        node_between=node_between,
        dense=dense,
        divides=divides,
        sharpest=sharpest,
        coarsest=np.where(bent, spacing(radius_of_bend, section[:, 0], clear), np.inf),
        kind=np.array([NUMBER[s.shape.kind] for s in surfaces], dtype=np.int64),
        size=np.array([s.shape.core for s in surfaces]).reshape(-1, 3),
        rounding=np.array([s.shape.rounding for s in surfaces]),
        bound=np.array([s.shape.bound for s in surfaces]),
        body=np.array([s.body for s in surfaces], dtype=np.int64),
        position=np.array([s.position for s in surfaces]).reshape(-1, 3),
        rotation=np.array([s.rotation @ s.shape.rotation for s in surfaces]).reshape(-1, 3, 3),
        can_collide=np.ascontiguousarray(groups.T),
        edge_can_cross=_of_edges(found, of_nodes[:, used]) & ~flat[:, None],
        margin=np.zeros(1),
        room=np.zeros(1),
    )
    surface_grain = np.array([s.grain for s in surfaces]).reshape(-1, 3)
    point_grain = np.zeros((len(point_body), 3))
    point_grain[nodes : nodes + len(others)] = np.array([p.grain for p in others]).reshape(-1, 3)
    rod_number = {name: number for number, rod in enumerate(scene.rods) for name in rod.copy_names}
    rod_of_node = np.concatenate([np.full(s.node_count, rod_number[s.rod], dtype=np.int64) for s in found.strands])
    owner_of_others = np.array([len(scene.rods) + p.collider.order for p in others], dtype=np.int64)
    surface_owner = np.array([len(scene.rods) + s.collider.order for s in surfaces], dtype=np.int64)
    return dict(
        surfaces=record,
        sliding=Sliding.zeros(
            UNALLOCATED,
            owner=np.concatenate([rod_of_node, owner_of_others, rod_of_node[of_rods.node]]),
            surface_owner=surface_owner,
            node_axis=found.column("node_axis", np.int64),
            surface_grain=surface_grain,
            point_grain=point_grain,
            spreads=bool(flat.any() or divides),
            **friction_values(scene, scene.friction, surface_owner, surface_grain, point_grain),
        ),
        surface_names=tuple(s.collider.name for s in surfaces),
        point_count=len(shown),
        rod_point_start=of_rods.position,
    )


DIVIDING = ("box", "cylinder")
"""Shapes that divide rods in lists of near pairs."""
NODES_BETWEEN = 1.25
"""Sum of the magnitudes of the parts that three nodes have in it, in the middle of an edge, where that is largest."""


def _node_part(edges: np.ndarray) -> np.ndarray:
    """Return the parts of the edges before and after each node, shape (n_node, 2), in its directions, likewise."""
    end = edges[:, 0] == edges[:, 1]
    first = end & (np.append(edges[1:, 0], -1) == edges[:, 1])
    return np.where(end[:, None], np.stack([~first, first], axis=1), 0.5)


def _arm_factor(found: Collected, arm: np.ndarray, edges: np.ndarray, between: bool) -> float:
    """Return how many times farther than nodes, and borders of edges by a turn, a contact point of a rod moves at most.

    Its arm [m], shape (n_rod_point,), turns with the edges next to it, shape (n_rod_point, 2), by at most the motion of
    one end against the other over their length, of which half is left at least. If there are points between stations,
    the factor of `NODES_BETWEEN` comes to that.
    """
    slope = arm / found.column("rest_length")[edges].min(axis=1)
    turn = arm / found.column("half_width")[edges].min(axis=1)
    return float(np.max((NODES_BETWEEN if between else 1.0) + 4.0 * slope + turn, initial=1.0))


BITS = 62
"""Of the integers by which rows of truths are told apart."""


def _distinct(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct rows of truth values in ascending order, and the number of each row among them."""
    count = rows.shape[1]
    if count > BITS:
        distinct, number = np.unique(rows, axis=0, return_inverse=True)
        return distinct, number.reshape(-1)
    _, first, number = np.unique(rows @ (1 << np.arange(count)[::-1]), return_index=True, return_inverse=True)
    return rows[first], number


def _grain(surface: Surface | Obstacle | None) -> np.ndarray:
    """Return the grain in the frame of the body or the obstacle, 0 without one, shape (3,)."""
    return np.zeros(3) if surface is None or surface.grain is None else np.array(surface.grain)


def owned_shapes(scene: SceneConfig, bodies: PlacedBodies) -> list[Owned]:
    """Return the shapes of obstacles, then of bodies."""
    of_bodies, of_obstacles = colliders(scene)
    world = len(scene.bodies)
    found = []
    for collider, obstacle in zip(of_obstacles, scene.obstacles, strict=True):
        position, rotation = obstacle_pose(obstacle)
        found.append(Owned(collider, shape_of(obstacle), world, position, rotation, rotation @ _grain(obstacle)))
    return found + [
        Owned(collider, shape, collider.order, np.zeros(3), np.eye(3), _grain(body.surface))
        for collider, shape, body in zip(of_bodies, bodies.shapes, scene.bodies, strict=True)
        if shape is not None
    ]


def _points_of(part: Owned, owners: list[Collider]) -> list[_Point]:
    """Return the centre, corners or rims of a shape, if they meet a surface."""
    can_collide = [shapes_can_collide(part.collider, surface) for surface in owners]
    if not any(can_collide):
        return []
    points, radius, length = part.shape.points()
    positions = part.position + points @ part.rotation.T
    return [
        _Point(position, radius, length, part.body, can_collide, part.grain, part.collider) for position in positions
    ]


def _nodes_can_collide(
    found: Collected,
    points: RodPoints,
    bodies: PlacedBodies,
    of_bodies: list[Collider],
    surfaces: list[Owned],
    held_by: np.ndarray,
    clear: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return which nodes meet which surfaces, and which would if no body held them, shape (n_node, n_surface); their
    points with arms meet the same.

    A node that a body holds does not meet the body's own surface, nor do its neighbours along the strand up to the
    first that is clear of the barrier: a rod may grow out of a body.
    """
    nodes = found.node_count
    rows, sections = np.zeros((2, nodes, len(surfaces)), dtype=bool)
    position = found.column("position", width=3)
    for column, surface in enumerate(surfaces):
        rows[:, column] = sections[:, column] = points_can_collide(RODS, surface.collider)
        for node in np.flatnonzero(held_by >= 0):
            rows[node, column] = points_can_collide(of_bodies[held_by[node]], surface.collider)
        if surface.body == len(bodies.names):
            continue
        base, rotation = bodies.start_position[surface.body], bodies.start_rotation[surface.body]
        gap = signed_distance(surface.shape, (position - base) @ rotation) - points.node_radius
        of_points = signed_distance(surface.shape, (points.position - base) @ rotation) - points.radius
        np.minimum.at(gap, points.node, of_points)
        for node in np.flatnonzero(held_by == surface.body):
            strand = next(s for s in found.strands if s.first_node <= node < s.first_node + s.node_count)
            own = _from_clamp(node, strand, gap, clear)
            rows[own, column] = sections[own, column] = False
    return rows, sections


def _of_edges(found: Collected, of_nodes: np.ndarray) -> np.ndarray:
    """Return the edges of which both nodes meet a surface, shape (n_surface, n_edge)."""
    first = found.column("edge_node", np.int64)
    return np.ascontiguousarray((of_nodes[first] & of_nodes[first + 1]).T)


def _from_clamp(node: int, strand: StrandArrays, gap: np.ndarray, clear: float) -> list[int]:
    """Return the nodes of a strand from its held end to the first whose gap is at least `clear`, that one excluded."""
    last = strand.first_node + strand.node_count - 1
    order = range(node, last + 1) if node == strand.first_node else range(node, strand.first_node - 1, -1)
    held = [node]
    for other in order[1:]:
        if gap[other] >= clear:
            break
        held.append(other)
    return held


def contact_point_names(model: Model) -> list[str]:
    """Return the name of each contact point in messages."""
    names = [f"node {k} of {s.name}" for s in model.strands for k in range(s.node_count)]
    parts = [*model.bodies.names, "an obstacle"]
    surfaces = model.surfaces
    of_rods = [
        f"the border of {names[node]}" if across else names[node]
        for node, (_, across) in zip(surfaces.rod_points.node, surfaces.rod_points.arm, strict=True)
    ]
    for k, (position, body) in enumerate(zip(surfaces.point_position, surfaces.point_body, strict=True)):
        centre = k >= model.point_count and not position.any()
        names.append(f"body {parts[body]}" if centre else f"contact point {k} ({parts[body]})")
    return names + of_rods


def start_contact_points(model: Model) -> np.ndarray:
    """Return the positions of all contact points at the start [m], shape (n_contact_point, 3)."""
    bodies, body = model.bodies, model.surfaces.point_body
    base = np.concatenate([bodies.start_position, np.zeros((1, 3))])[body]
    rotation = np.concatenate([bodies.start_rotation, np.eye(3)[None]])[body]
    of_bodies = base + np.einsum("kij,kj->ki", rotation, model.surfaces.point_position)
    return np.concatenate([model.start_position, of_bodies, model.rod_point_start])
