"""Which contact points of a scene can meet which surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from bilayer_core.model.section import outline
from bilayer_core.model.validity import bend_of
from bilayer_core.scene.body import Body, Prescribed
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.rod import Rod

ROUND = 2.0
"""Width over thickness up to which a section counts as round where rods meet."""


class Mobility(IntEnum):
    """How something moves."""

    FIXED = 0
    SCHEDULED = 1
    FREE = 2


@dataclass(frozen=True)
class Collider:
    """Object of a scene that carries points, a surface, or both.

    Attributes
    ----------
    name : str
    order : int
        Rods first, then bodies and obstacles in the scene's order.
    kind : str
        Of its surface; empty without one.
    mobility : Mobility
    """

    name: str
    order: int
    kind: str
    mobility: Mobility


RODS = Collider("rods", -1, "", Mobility.FREE)


def mobility_of(body: Body) -> Mobility:
    """Return how a body moves; one on a schedule that never leaves its place is fixed."""
    if not isinstance(body.motion, Prescribed):
        return Mobility.FREE
    return Mobility.SCHEDULED if body.motion.moves else Mobility.FIXED


def colliders(scene: SceneConfig) -> tuple[list[Collider], list[Collider]]:
    """Return the bodies and obstacles."""
    bodies = [
        Collider(body.name, index, body.surface.shape if body.surface else "", mobility_of(body))
        for index, body in enumerate(scene.bodies)
    ]
    first = len(bodies)
    obstacles = [Collider(o.name, first + i, o.type, Mobility.FIXED) for i, o in enumerate(scene.obstacles)]
    return bodies, obstacles


def points_can_collide(point: Collider, surface: Collider) -> bool:
    """Return whether nodes or contact points of one can meet the surface of another: one of the two must move."""
    return surface.kind != "" and point.order != surface.order and max(point.mobility, surface.mobility) > 0


def shapes_can_collide(point: Collider, surface: Collider) -> bool:
    """Return whether the centre of a ball, corners or rims of one are to meet the surface of another: one of them must
    be free.

    Against a ball its own centre is all that is needed, and of two balls the first of the bodies has it.
    """
    if not (point.kind and surface.kind) or point.order == surface.order:
        return False
    if max(point.mobility, surface.mobility) < Mobility.FREE or point.kind == "plane":
        return False
    return surface.kind != "sphere" or (point.kind == "sphere" and point.order < surface.order)


@dataclass(frozen=True)
class ContactPair:
    """Two parts of a scene that can meet, and how that is resolved."""

    what: str
    how: str

    def __str__(self) -> str:
        return f"{self.what} ({self.how})"


def contact_pairs(scene: SceneConfig, dimension: int = 3) -> tuple[ContactPair, ...]:
    """Return which parts of a scene can meet, each with how it is resolved in a dimension."""
    return scene.keep(("contact pairs", dimension), (), lambda: _contact_pairs(scene, dimension))


def _contact_pairs(scene: SceneConfig, dimension: int) -> tuple[ContactPair, ...]:
    if scene.contact is None:
        return ()
    bodies, obstacles = colliders(scene)
    pairs = [
        ContactPair(f"rods – {s.name}", _points_of_rods(scene, dimension, s.kind))
        for s in (*obstacles, *bodies)
        if points_can_collide(RODS, s)
    ]
    for point in (*bodies, *obstacles):
        for surface in (*obstacles, *bodies):
            how = []
            if point.order < len(bodies) and scene.bodies[point.order].contact_points:
                how += ["contact points"] if points_can_collide(point, surface) else []
            if shapes_can_collide(point, surface):
                how += [{"sphere": "ball", "box": "corners", "cylinder": "rims"}[point.kind]]
            if how:
                pairs.append(
                    ContactPair(f"{point.name} – {surface.name}", f"{' and '.join(how)} against {surface.kind}")
                )
    return tuple(pairs)


def is_ribbon(rod: Rod, times: float = 1.0) -> bool:
    """Return whether a rod is somewhere wider than thick, or than some times its thickness."""
    return rod.keep(("ribbon", times), (), lambda: _is_ribbon(rod, times))


def meets_with_borders(rod: Rod) -> bool:
    """Return whether a rod has borders for other rods in space: `contact.rails`."""
    return is_ribbon(rod, ROUND)


def _is_ribbon(rod: Rod, times: float) -> bool:
    stations = np.arange(rod.stations)
    width, thickness = outline(rod, stations)
    return bool(np.any(width > times * thickness.sum(axis=0) * (1.0 + 1e-9)))


def _points_of_rods(scene: SceneConfig, dimension: int, kind: str) -> str:
    """Return which points of rods meet a surface, and what a plane leaves out."""
    bent = kind == "plane" and any(bend_of(scene, rod) >= 0.0 for rod in scene.rods)
    between = ", and points between them where rods are bent," if bent else ""
    along = f"nodes{between}" if kind == "plane" else "points along rods"
    if not any(is_ribbon(rod) for rod in scene.rods):
        return f"{along} against {kind}"
    if dimension == 3:
        ribbons = f"nodes and borders of ribbons{between}" if kind == "plane" else "points all over ribbons"
        return f"{ribbons} against {kind}"
    if kind == "plane":
        return f"{along} against {kind}; borders of ribbons touch as they do"
    return (
        f"{along} against {kind}; where it is not the same across, a plane leaves out that borders of ribbons touch "
        "later"
    )
