"""Point masses and loads: on which nodes and bodies they act."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bilayer_core.model.model import Bodies, LoadShares, PointLoads
from bilayer_core.model.section import outline
from bilayer_core.model.strands import Collected, Span
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.rod import Rod


def add_point_masses(scene: SceneConfig, found: Collected) -> None:
    """Add point masses to the masses of nodes [kg], and their heights over these to the moments of mass [kg m]."""
    node_mass, moment = found.column("node_mass"), found.column("mass_moment")
    node_edges = found.column("node_edges", np.int64, 2)
    for point in scene.masses:
        for rod, spans, height in _copies(scene, found, point.rod):
            nodes, shares = _shares(rod, spans, point.position)
            np.add.at(node_mass, nodes, point.mass * shares)
            if height:
                for edges in node_edges[nodes].T:  # numpy 2.4 reads past the values if it is given both at once
                    np.add.at(moment, edges, 0.5 * height * point.mass * shares)
    found.columns["node_mass"], found.columns["mass_moment"] = [node_mass], [moment]


def build_loads(scene: SceneConfig, found: Collected, bodies: Bodies, frame: str) -> PointLoads:
    """Arrays of the loads whose components are in one of the two frames."""
    if not scene.loads:
        return NO_LOADS
    nodes, forces, moments = [], [], []  # target, load, vector
    for index, load in enumerate(scene.loads):
        if load.frame != frame:
            continue
        if load.body is not None:
            free = bodies.free_index[bodies.names.index(load.body)]
            forces += [(free, index, load.force)] if any(load.force) else []
            moments += [(free, index, load.moment)] if any(load.moment) else []
            continue
        for rod, spans, _ in _copies(scene, found, load.rod):
            parts = zip(*_shares(rod, spans, load.position), strict=True)
            nodes += [(node, index, share * np.array(load.force)) for node, share in parts]
    return PointLoads(*(_load_shares(parts) for parts in (nodes, forces, moments)))


def _load_shares(parts: list[tuple[int, int, np.ndarray]]) -> LoadShares:
    target, load, vector = zip(*parts, strict=True) if parts else ((), (), ())
    return LoadShares(
        np.array(target, dtype=np.int64), np.array(load, dtype=np.int64), np.array(vector, dtype=float).reshape(-1, 3)
    )


NO_LOADS = PointLoads(*(_load_shares([]) for _ in range(3)))


def _copies(scene: SceneConfig, found: Collected, name: str) -> Iterator[tuple[Rod, list[Span], float]]:
    """Rods of a name, or the copies of a pattern, each with its strands and the height of its path over these [m]."""
    spans = iter(zip(found.rods, found.path_height, strict=True))
    for rod in scene.rods:
        for copy in rod.copy_names:
            own = next(spans)
            if name in (copy, rod.name):
                yield rod, *own


def _shares(rod: Rod, spans: list[Span], position: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes next to a place on the path, and the part of a force or of a mass that each takes.

    Between stations the parts are linear in the position; where two layers cover a station, the path is their
    interface, and each strand takes a part in proportion to the other's thickness. Force, moment and mass centre are
    thus those of a point on the path; a single strand for both layers takes all, at its own height.
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
