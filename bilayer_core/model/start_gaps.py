"""Gaps at the start of all that can meet, and refusal of scenes that start with some closed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from bilayer_core.contact.broad_phase import RodSearch
from bilayer_core.contact.facet import INSIDE
from bilayer_core.errors import PenetrationError
from bilayer_core.model.contact_points import contact_point_names, start_contact_points
from bilayer_core.model.findings import told
from bilayer_core.model.implausible_numbers import implausible_numbers
from bilayer_core.model.model import Model
from bilayer_core.model.points_between import core_of, points_between
from bilayer_core.model.rod_surfaces import NearPairs
from bilayer_core.model.shape_numbers import signed_distance

Array = np.ndarray
MOST_SHOWN = 1_000_000
"""Of places of rods within the barrier distance: among how many the deepest is looked for."""
ROUNDING = 1e-9
"""Of the radii of two rods: a gap that is no more than that is none."""


@dataclass(frozen=True)
class RodGaps:
    """Points of rods and edges that they are near; all shapes (n_pair,)."""

    point: Array  # see `contact.broad_phase.RodSearch`
    own: Array  # edge of the point
    own_fraction: Array  # where on it
    edge: Array
    fraction: Array  # where on that
    gap: Array  # [m]

    def names(self, model: Model, pair: int) -> tuple[str, str]:
        """Return the names of the two places of a pair for messages."""
        first = _place(model, self.own[pair], self.own_fraction[pair])
        return first, _place(model, self.edge[pair], self.fraction[pair])


@dataclass(frozen=True)
class SurfaceGaps:
    """Contact points that a surface meets, with their gaps, Δl and places [m]; those between stations count as their
    nodes.
    """

    surface: int
    point: Array
    gap: Array
    weight: Array
    place: Array


def surface_gaps(model: Model, within: float) -> Iterator[SurfaceGaps]:
    """Yield, for each surface, the contact points that it meets and that are nearer than `within` [m]."""
    surfaces, bodies, position = model.surfaces, model.bodies, start_contact_points(model)
    base = np.concatenate([bodies.start_position, np.zeros((1, 3))])[surfaces.body]
    rotation = np.concatenate([bodies.start_rotation, np.eye(3)[None]])[surfaces.body]
    everything, of_rods = np.arange(len(position)), surfaces.contact_point_body < 0
    node = np.where(everything < model.node_count, everything, 0)
    if surfaces.rod_points.exists:
        node[surfaces.rod_points.first :] = surfaces.rod_points.node
    for s in range(len(model.surface_names)):
        core = core_of(model, s)
        origin = base[s] + rotation[s] @ surfaces.position[s]
        meets = surfaces.can_collide[s][surfaces.group]
        weight = np.where(of_rods & surfaces.node_between[s][node], 0.0, surfaces.weight)
        parts = [(everything[meets], position[meets], surfaces.radius[meets], weight[meets])]
        cells = points_between(model, s, origin, within)
        found = []
        for point, place, radius, share in chain(
            parts, ((np.full(len(cell.radius), cell.node), cell.place, cell.radius, cell.weight) for cell in cells)
        ):
            gap = signed_distance(core, place - origin) - surfaces.rounding[s] - radius
            near = gap < within
            found.append((point[near], gap[near], share[near], place[near]))
        yield SurfaceGaps(s, *(np.concatenate(of_all) for of_all in zip(*found, strict=True)))


def rod_gaps(model: Model, within: float) -> RodGaps:
    """Return the places of rods that are nearer to each other than `within` [m]."""
    rods = model.rod_search
    if not rods.exists:
        none, nowhere = np.zeros(0, dtype=np.int64), np.zeros(0)
        return RodGaps(none, none, nowhere, none, nowhere, nowhere)
    position = rods.start_position
    pairs = NearPairs(rods)
    pairs.find(position, model.scene.contact.barrier_distance, within, most=MOST_SHOWN)
    point, edge = pairs.search.point[: pairs.count], pairs.search.edge[: pairs.count]
    own, i, j = rods.point_edge[point], rods.edge_node[rods.point_edge[point]], rods.edge_node[edge]
    s, along = rods.point_fraction[point][:, None], position[j + 1] - position[j]
    between = (1.0 - s) * position[i] + s * position[i + 1] - position[j]
    t = np.clip((between * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    radii = rods.edge_radius[own] + rods.edge_radius[edge]
    gap = pairs.search.until[: pairs.count] + model.scene.contact.barrier_distance
    gap[np.abs(gap) <= ROUNDING * radii] = 0.0
    twice = rods.point_sees[point] == INSIDE
    twice[twice] = _are_beside(rods, point[twice], edge[twice], (gap + radii)[twice])
    point, own, s, edge, t, gap = (of_all[~twice] for of_all in (point, own, s, edge, t, gap))
    return RodGaps(point, own, s[:, 0], edge, t, gap)


def _are_beside(rods: RodSearch, point: Array, edge: Array, distance: Array) -> Array:
    """Return whether the places of ribbons nearest to points are on their borders, where other points count."""
    at, s, v = rods.start_position, rods.point_fraction[point][:, None], rods.point_across[point][:, None]
    own = rods.point_edge[point]

    def along(rail: Array, fraction: Array) -> Array:
        return (1.0 - fraction) * at[rail] + fraction * at[rail + 1]

    place = (1.0 - v) * along(rods.edge_node[own], s) + v * along(rods.edge_right[own], s)
    nearest = np.full(len(point), np.inf)
    for rail in (rods.edge_node[edge], rods.edge_right[edge]):
        way = at[rail + 1] - at[rail]
        t = np.clip(((place - at[rail]) * way).sum(axis=1) / (way * way).sum(axis=1), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(place - along(rail, t[:, None]), axis=1))
    return nearest <= distance * (1.0 + ROUNDING)


def _place(model: Model, edge: int, fraction: float) -> str:
    """Return the name of a point of an edge for messages."""
    strand = next(s for s in model.strands if s.first_edge <= edge < s.first_edge + s.node_count - 1)
    return f"node {edge - strand.first_edge + int(round(fraction))} of {strand.name}"


def refuse_penetration(model: Model) -> None:
    """Raise PenetrationError if a contact point starts behind a surface that it meets, or touching it."""
    found = [gaps for gaps in surface_gaps(model, np.nextafter(0.0, 1.0)) if len(gaps.gap)]
    if found:
        count = sum(len(gaps.gap) for gaps in found)
        worst = min(found, key=lambda gaps: gaps.gap.min())
        k = int(worst.gap.argmin())
        depth, contact_point, place = float(worst.gap[k]), int(worst.point[k]), worst.place[k]
        surface = surface_name(model, model.surface_names[worst.surface])
        raise _refusal(
            model,
            f"the scene starts in penetration: {contact_point_names(model)[contact_point]} at "
            f"({', '.join(f'{1e3 * c:.3f}' for c in place)}) mm is {abs(1e3 * depth):.4g} mm behind "
            f"the surface of {surface}{f', and {count - 1} more' if count > 1 else ''}; "
            "all gaps must be positive at the start",
        )


def _refusal(model: Model, fault: str) -> PenetrationError:
    """Return the error for a scene that starts so; a number without its unit is a likely cause."""
    questions = told(implausible_numbers(model.scene))
    return PenetrationError("; ".join([f"{model.scene.name}: {fault}", *questions]))


def surface_name(model: Model, name: str) -> str:
    """Return the name of a surface for messages."""
    return f"body {name}" if name in model.bodies.names else name


def refuse_meeting_rods(model: Model) -> None:
    """Raise PenetrationError if rods start in each other, or touching each other; it names two places."""
    if not model.rod_search.exists:
        return
    found = rod_gaps(model, model.scene.contact.barrier_distance)
    if not len(found.gap) or found.gap.min() > 0.0:
        return
    worst = int(np.argmin(found.gap))
    first, second = found.names(model, worst)
    depth = -1e3 * found.gap[worst]
    raise _refusal(
        model,
        f"the scene starts in {'penetration' if depth else 'touch'}: "
        f"{first} {f'is {depth:.4g} mm inside' if depth else 'touches'} {second}"
        "; all gaps must be positive at the start (contact.rods: false lets rods pass through each other)",
    )
