"""Point masses and loads: on which nodes and bodies they act."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bilayer_core.jit import UNALLOCATED
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.raised_edges import directions_at, halves_at
from bilayer_core.model.records.parts import Moments, PointForces
from bilayer_core.model.section import outline
from bilayer_core.model.strands import Collected, Span
from bilayer_core.model.unknown_order import columns
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.rod import Rod

MOMENTS = ("first_moment", float, 2), ("second_moment",)
LAST_CELL = np.array([1.5, 1.0, 1.5])
"""Compliance of a joint with the half edge to the end, of its own, about m2, m1 and t."""


def add_point_masses(scene: SceneConfig, found: Collected) -> None:
    """Add point masses to the masses of nodes [kg], and where they are off the curve to the moments of half edges."""
    node_mass, first, second = (found.column(*of) for of in (("node_mass",), MOMENTS[0], MOMENTS[1]))
    raised: list[np.ndarray] = []
    for point in scene.masses:
        for rod, spans, height in _copies(scene, found, point.rod):
            nodes, shares = _shares(rod, spans, point.position)
            np.add.at(node_mass, nodes, point.mass * shares)
            if height:
                raised.append(nodes)
                edges, halves, parts = (of.ravel() for of in halves_at(found, nodes))
                masses = parts * np.repeat(point.mass * shares, 2)
                np.add.at(first, (edges, halves), height * masses)
                np.add.at(second, edges, height**2 * masses)
    if raised:
        _soften_ends(found, np.concatenate(raised))
    found.columns |= {"node_mass": [node_mass], "first_moment": [first], "second_moment": [second]}


def _soften_ends(found: Collected, nodes: np.ndarray) -> None:
    """Give the last joints before free ends among nodes the compliance of the half edge beyond the last edge's middle.

    A mass off the curve at an end exerts a moment M by its inertia, and moves with m1 at the end, where the last edge
    has that of its middle: M l/2EI of turn is missing, an error of first order. With 1.5 times the compliance in
    bending about m2 and in twist, the last edge has the direction of the end, since M is all but uniform there; nodes
    move by M l²/2EI, at second order. Turns at rest stay as they are.
    """
    nodes = np.setdiff1d(nodes, found.column("attached_node", np.int64))
    edges, edge_node = found.column("node_edges", np.int64, 2)[nodes], found.column("edge_node", np.int64)
    ends = edges[:, 0] == edges[:, 1]
    beside = 2 * edge_node[edges[ends, 0]] + 1 - nodes[ends]
    stiffness = found.column("joint_stiffness", width=3)
    stiffness[np.isin(found.column("joint_node", np.int64), beside)] /= LAST_CELL
    found.columns["joint_stiffness"] = [stiffness]


def edges_of_loads(scene: SceneConfig, found: Collected) -> np.ndarray:
    """Return edges whose halves carry loads off the curve."""
    nodes = [
        _shares(rod, spans, load.position)[0]
        for load in scene.loads
        if load.body is None
        for rod, spans, height in _copies(scene, found, load.rod)
        if height
    ]
    return np.unique(halves_at(found, np.concatenate(nodes))[0]) if nodes else np.zeros(0, dtype=np.int64)


def build_loads(
    scene: SceneConfig, found: Collected, names: Sequence[str], free_index: np.ndarray, raised: np.ndarray
) -> tuple[PointForces, PointForces, Moments]:
    """Return forces of fixed direction, forces that turn with what they act on, and moments; absent without loads.

    Parameters
    ----------
    scene : SceneConfig
    found : Collected
    names : sequence of str
        Of bodies.
    free_index : ndarray
        As in `Bodies`.
    raised : ndarray
        Number of each edge in `Raised`, −1 of the others.
    """
    if not scene.loads:
        return PointForces.absent(), PointForces.absent(), Moments.absent()
    parts: dict[str, tuple[list, list, list]] = {"world": ([], [], []), "material": ([], [], [])}
    for index, load in enumerate(scene.loads):
        on_nodes, on_bodies, moments = parts[load.frame]  # target, load, vector
        if load.body is not None:
            free = free_index[names.index(load.body)]
            on_bodies += [(free, index, load.force)] if any(load.force) else []
            moments += [(free, index, load.moment)] if any(load.moment) else []
            continue
        for rod, spans, height in _copies(scene, found, load.rod):
            shares = zip(*_shares(rod, spans, load.position), strict=True)
            on_nodes += [(node, index, share * np.array(load.force), height) for node, share in shares]
    (*dead, dead_moments), (*following, following_moments) = parts.values()
    body, number, vector = _arrays(dead_moments + following_moments)
    all_moments = Moments.zeros(UNALLOCATED, dead=len(dead_moments), body=body, load=number, vector=vector)
    return (
        _point_forces("loads", found, raised, *dead),
        _point_forces("followers", found, raised, *following),
        all_moments,
    )


def _arrays(parts: list[tuple[int, int, np.ndarray]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return targets, loads and vectors of parts of loads."""
    target, load, vector = zip(*parts, strict=True) if parts else ((), (), ())
    return np.array(target, dtype=np.int64), np.array(load, dtype=np.int64), np.array(vector, float).reshape(-1, 3)


def _point_forces(name: str, found: Collected, raised: np.ndarray, on_nodes: list, on_bodies: list) -> PointForces:
    heights = np.array([height for *_, height in on_nodes])
    node, node_load, node_vector = _arrays([part[:3] for part in on_nodes])
    body, body_load, body_vector = _arrays(on_bodies)
    mixed, mixed_parts = directions_at(found, node)
    before, after = columns(mixed)
    edges, _, parts = halves_at(found, node)
    arms = parts * heights[:, None]
    lever, side = columns(np.argwhere(arms != 0.0))
    return PointForces.zeros(
        UNALLOCATED,
        energy_slot=slot_of(name),
        node=node,
        node_load=node_load,
        node_vector=node_vector,
        body=body,
        body_load=body_load,
        body_vector=body_vector,
        edge_before=before,
        edge_after=after,
        part=mixed_parts,
        lever=lever,
        lever_raised=raised[edges[lever, side]],
        lever_height=arms[lever, side],
    )


def _copies(scene: SceneConfig, found: Collected, name: str) -> Iterator[tuple[Rod, list[Span], float]]:
    """Yield the rods of a name, or the copies of a pattern, each with its strands and the height of its path over these
    [m].
    """
    spans = iter(zip(found.rods, found.path_height, strict=True))
    for rod in scene.rods:
        for copy in rod.copy_names:
            own = next(spans)
            if name in (copy, rod.name):
                yield rod, *own


def _shares(rod: Rod, spans: list[Span], position: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes next to a place on the path, and the part of a force or of a mass that each takes.

    Between stations the parts are linear in the position; where two layers cover a station, the path is their
    interface, and each strand takes a part in proportion to the other's thickness. Force, moment and mass centre are
    thus those of a point on the path; a single strand for both layers takes all, and half edges the lever to the path.
    A mass m in two parts has the moment of inertia m h₁h₂/4 about the path, which a point has not: five times the mass
    of a strip at its end, layers of 1 and 4 mm, 0.1 m long, lowers its second frequency by 0.9 %, the first by 0.01 %.
    """
    along = min(position / rod.edge_length, rod.stations - 1.0)
    before = min(int(along), rod.stations - 2)
    nodes, shares = [], []
    for station, part in ((before, before + 1.0 - along), (before + 1, along - before)):
        if part == 0.0:
            continue
        if rod.closed and station == 0:
            station = rod.stations - 1  # the node with both edges next to it
        thickness = outline(rod, np.array([station]))[1][:, 0] if len(spans) > 1 else np.ones(1)
        covering = np.flatnonzero(thickness)
        for k in covering:
            first, _, first_node, _ = spans[k]
            nodes.append(first_node + station - first)
            shares.append(part * (1.0 if len(covering) == 1 else 1.0 - thickness[k] / thickness.sum()))
    return np.array(nodes, dtype=np.int64), np.array(shares)
