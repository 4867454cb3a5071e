"""Which carriers of a scene can meet which surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from ..scene.body import Body, Prescribed
from ..scene.config import SceneConfig


class Mobility(IntEnum):
    """How something moves."""

    FIXED = 0
    SCHEDULED = 1
    FREE = 2


@dataclass(frozen=True)
class Party:
    """What carries points, a surface, or both.

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


RODS = Party("rods", -1, "", Mobility.FREE)


def mobility_of(body: Body) -> Mobility:
    """How a body moves; one on a schedule that never leaves its place is fixed."""
    if not isinstance(body.motion, Prescribed):
        return Mobility.FREE
    return Mobility.SCHEDULED if body.motion.moves else Mobility.FIXED


def parties(scene: SceneConfig) -> tuple[list[Party], list[Party]]:
    """Bodies and obstacles."""
    bodies = [
        Party(body.name, index, body.surface.shape if body.surface else "", mobility_of(body))
        for index, body in enumerate(scene.bodies)
    ]
    first = len(bodies)
    obstacles = [Party(o.name, first + i, o.type, Mobility.FIXED) for i, o in enumerate(scene.obstacles)]
    return bodies, obstacles


def points_meet(carrier: Party, surface: Party) -> bool:
    """Whether nodes or contact points of one can meet the surface of another: one of the two must move."""
    return surface.kind != "" and carrier.order != surface.order and max(carrier.mobility, surface.mobility) > 0


def shapes_meet(carrier: Party, surface: Party) -> bool:
    """Whether the centre of a ball, corners or rims of one are to meet the surface of another: one of them must be
    free.

    Against a ball its own centre is all that is needed, and of two balls one is the carrier, the first of the bodies.
    """
    if not (carrier.kind and surface.kind) or carrier.order == surface.order:
        return False
    if max(carrier.mobility, surface.mobility) < Mobility.FREE or carrier.kind == "plane":
        return False
    return surface.kind != "sphere" or (carrier.kind == "sphere" and carrier.order < surface.order)


def contact_pairs(scene: SceneConfig) -> tuple[str, ...]:
    """Which parts of a scene can meet, each with how it is resolved."""
    if scene.contact is None:
        return ()
    bodies, obstacles = parties(scene)
    pairs = [f"rods – {s.name} (nodes against {s.kind})" for s in (*obstacles, *bodies) if points_meet(RODS, s)]
    for carrier in (*bodies, *obstacles):
        for surface in (*obstacles, *bodies):
            how = []
            if carrier.order < len(bodies) and scene.bodies[carrier.order].contact_points:
                how += ["contact points"] if points_meet(carrier, surface) else []
            if shapes_meet(carrier, surface):
                how += [{"sphere": "ball", "box": "corners", "cylinder": "rims"}[carrier.kind]]
            if how:
                pairs.append(f"{carrier.name} – {surface.name} ({' and '.join(how)} against {surface.kind})")
    return tuple(pairs)
