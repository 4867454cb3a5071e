"""Carriers and surfaces of a scene: what may touch what, and whether it does at the start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import PenetrationError
from ..scene.config import SceneConfig
from .model import Bodies, Carriers, Model, Surfaces
from .parties import RODS, Party, parties, points_meet, shapes_meet
from .shapes import NUMBER, Shape, obstacle_pose, shape_of, signed_distance
from .strand_arrays import StrandArrays
from .strands import Collected


@dataclass(frozen=True)
class _Owned:
    """A shape and what it belongs to: the party, its body or the world, and its pose in that frame."""

    party: Party
    shape: Shape
    body: int
    position: np.ndarray
    turn: np.ndarray


@dataclass(frozen=True)
class _Point:
    """A carrier that is no node: its body or the world, and the surfaces that it meets."""

    position: np.ndarray
    radius: float
    length: float
    body: int
    meets: list[bool]


def build_contact(scene: SceneConfig, found: Collected, bodies: Bodies) -> tuple[Carriers, Surfaces]:
    """Carriers, and the surfaces that they can meet."""
    of_bodies, _ = parties(scene)
    owned = _shapes(scene, bodies)
    surfaces = owned if scene.contact is not None else []
    owners = [surface.party for surface in surfaces]
    points = [
        _Point(np.array(p.position), p.offset, p.length, index, [points_meet(of_bodies[index], s) for s in owners])
        for index, body in enumerate(scene.bodies)
        for p in body.contact_points
    ]
    generated = [point for part in owned for point in _points_of(part, owners)]
    world = len(scene.bodies)
    shown = points + [p for p in generated if p.body != world and p.position.any()]
    hidden = [p for p in generated if p.body == world or not p.position.any()]  # obstacles and centres of balls
    others = shown + hidden

    nodes = found.node_count
    follows = np.full(nodes + len(others), -1, dtype=np.int64)
    follows[found.column("attached_node", np.int64)] = found.column("attached_body", np.int64)
    follows[nodes:] = [p.body for p in others]
    body = follows.copy()
    body[:nodes] = -1
    rows = np.zeros((nodes + len(others), len(surfaces)), dtype=bool)
    clear = scene.contact.barrier_distance if scene.contact is not None else 0.0
    rows[:nodes] = _nodes_meet(found, bodies, of_bodies, surfaces, follows, clear)
    rows[nodes:] = np.array([p.meets for p in others], dtype=bool).reshape(len(others), len(surfaces))
    used = rows.any(axis=0)
    surfaces = [surface for surface, is_used in zip(surfaces, used, strict=True) if is_used]
    groups, group = np.unique(rows[:, used], axis=0, return_inverse=True)

    carriers = Carriers(
        weight=np.concatenate([found.column("node_weight"), [p.length for p in others]]),
        radius=np.concatenate([found.column("node_radius"), [p.radius for p in others]]),
        friction=_friction_of_carriers(scene, nodes, len(follows)),
        node_edges=found.column("node_edges", np.int64, 2),
        node_axis=found.column("node_axis", np.int64),
        body=body,
        follows=follows,
        position=np.array([p.position for p in others], dtype=float).reshape(-1, 3),
        point_count=len(shown),
        group=group.reshape(-1).astype(np.int64),
    )
    return carriers, Surfaces(
        names=tuple(s.party.name for s in surfaces),
        kind=np.array([NUMBER[s.shape.kind] for s in surfaces], dtype=np.int64),
        size=np.array([s.shape.core for s in surfaces]).reshape(-1, 3),
        rounding=np.array([s.shape.rounding for s in surfaces]),
        bound=np.array([s.shape.bound for s in surfaces]),
        body=np.array([s.body for s in surfaces], dtype=np.int64),
        position=np.array([s.position for s in surfaces]).reshape(-1, 3),
        turn=np.array([s.turn @ s.shape.turn for s in surfaces]).reshape(-1, 3, 3),
        meets=np.ascontiguousarray(groups.T),
    )


def _shapes(scene: SceneConfig, bodies: Bodies) -> list[_Owned]:
    """Shapes of obstacles, then of bodies."""
    of_bodies, of_obstacles = parties(scene)
    world = len(scene.bodies)
    found = [
        _Owned(party, shape_of(obstacle), world, *obstacle_pose(obstacle))
        for party, obstacle in zip(of_obstacles, scene.obstacles, strict=True)
    ]
    return found + [
        _Owned(party, shape, party.order, np.zeros(3), np.eye(3))
        for party, shape in zip(of_bodies, bodies.shapes, strict=True)
        if shape is not None
    ]


def _points_of(part: _Owned, owners: list[Party]) -> list[_Point]:
    """Centre, corners or rims of a shape, if they meet a surface."""
    meets = [shapes_meet(part.party, surface) for surface in owners]
    if not any(meets):
        return []
    points, radius, length = part.shape.points()
    return [_Point(part.position + part.turn @ point, radius, length, part.body, meets) for point in points]


def _nodes_meet(
    found: Collected,
    bodies: Bodies,
    of_bodies: list[Party],
    surfaces: list[_Owned],
    follows: np.ndarray,
    clear: float,
) -> np.ndarray:
    """Which nodes meet which surfaces, shape (n_node, n_surface).

    A node that a body holds does not meet the body's own surface, nor do its neighbours along the strand up to the
    first that is clear of the barrier: a rod may grow out of a body.
    """
    nodes = found.node_count
    rows = np.zeros((nodes, len(surfaces)), dtype=bool)
    position, radius = found.column("position", width=3), found.column("node_radius")
    for column, surface in enumerate(surfaces):
        rows[:, column] = points_meet(RODS, surface.party)
        for node in np.flatnonzero(follows[:nodes] >= 0):
            rows[node, column] = points_meet(of_bodies[follows[node]], surface.party)
        if surface.body == len(bodies.names):
            continue
        place, turn = bodies.start_position[surface.body], bodies.start_rotation[surface.body]
        gap = signed_distance(surface.shape, (position - place) @ turn) - radius
        for node in np.flatnonzero(follows[:nodes] == surface.body):
            strand = next(s for s in found.strands if s.first_node <= node < s.first_node + s.node_count)
            rows[_from_clamp(node, strand, gap, clear), column] = False
    return rows


def _from_clamp(node: int, strand: StrandArrays, gap: np.ndarray, clear: float) -> list[int]:
    """Nodes of a strand from its held end to the first whose gap is at least `clear`, that one excluded."""
    last = strand.first_node + strand.node_count - 1
    order = range(node, last + 1) if node == strand.first_node else range(node, strand.first_node - 1, -1)
    held = [node]
    for other in order[1:]:
        if gap[other] >= clear:
            break
        held.append(other)
    return held


def _friction_of_carriers(scene: SceneConfig, nodes: int, carriers: int) -> np.ndarray:
    """Friction coefficients forward, backward and sideways of each carrier, shape (n_carrier, 3)."""
    law = scene.contact.friction if scene.contact else None
    coefficients = np.full((carriers, 3), law.coefficient if law else 0.0)
    coefficients[:nodes] = law.of_rods if law else 0.0
    return coefficients


def carrier_names(model: Model) -> list[str]:
    """What each carrier is called in messages."""
    names = [f"node {k} of {s.name}" for s in model.strands for k in range(s.node_count)]
    parts = [*model.bodies.names, "an obstacle"]
    carriers = model.carriers
    for k, body in enumerate(carriers.body[model.node_count :]):
        centre = k >= carriers.point_count and not carriers.position[k].any()
        names.append(f"body {parts[body]}" if centre else f"contact point {k} ({parts[body]})")
    return names


def start_carriers(model: Model) -> np.ndarray:
    """Positions of all carriers at the start [m], shape (n_carrier, 3)."""
    bodies, body = model.bodies, model.carriers.body[model.node_count :]
    place = np.concatenate([bodies.start_position, np.zeros((1, 3))])[body]
    turn = np.concatenate([bodies.start_rotation, np.eye(3)[None]])[body]
    return np.concatenate([model.start_position, place + np.einsum("kij,kj->ki", turn, model.carriers.position)])


def refuse_penetration(model: Model) -> None:
    """Raise PenetrationError if a carrier starts behind a surface that it meets, or touching it."""
    carriers, surfaces, bodies = model.carriers, model.surfaces, model.bodies
    position, faults = start_carriers(model), []
    place = np.concatenate([bodies.start_position, np.zeros((1, 3))])[surfaces.body]
    turn = np.concatenate([bodies.start_rotation, np.eye(3)[None]])[surfaces.body]
    for s, name in enumerate(surfaces.names):
        core = Shape(_KIND[int(surfaces.kind[s])], surfaces.size[s], 0.0, turn[s] @ surfaces.turn[s])
        origin = place[s] + turn[s] @ surfaces.position[s]
        gap = signed_distance(core, position - origin) - surfaces.rounding[s] - carriers.radius
        behind = np.flatnonzero((gap <= 0.0) & surfaces.meets[s][carriers.group])
        faults += [(gap[i], i, name) for i in behind]
    if faults:
        depth, carrier, surface = min(faults)
        names = carrier_names(model)
        surface = f"body {surface}" if surface in bodies.names else surface
        raise PenetrationError(
            f"{model.scene.name}: the scene starts in penetration: {names[carrier]} at "
            f"({', '.join(f'{1e3 * c:.3f}' for c in position[carrier])}) mm is {abs(1e3 * depth):.4g} mm behind "
            f"the surface of {surface}{f', and {len(faults) - 1} more' if len(faults) > 1 else ''}; "
            "all gaps must be positive at the start"
        )


_KIND = {number: kind for kind, number in NUMBER.items()}
