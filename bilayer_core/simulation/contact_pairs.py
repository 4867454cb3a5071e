"""What touches what: which rods, bodies and obstacles are nearer to each other than the barrier distance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.model import Model

if TYPE_CHECKING:
    from ..engine.engine import Engine

Array = np.ndarray
Pairs = tuple[tuple[str, str], ...]
AN_OBSTACLE = "an obstacle"
"""Whose corners touch a body: points of the world are not told apart."""


class ContactOwners:
    """Whose the contact points and surfaces of a model are.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        rods = list(dict.fromkeys(strand.rod for strand in model.strands))
        bodies = list(model.bodies.names)
        surfaces = [name for name in model.surfaces.names if name not in bodies]
        self._names = [*rods, *bodies, *surfaces, AN_OBSTACLE]
        slot = {name: index for index, name in reversed(list(enumerate(self._names)))}
        self._of_node = np.zeros(model.node_count, dtype=np.int64)
        for strand in model.strands:
            self._of_node[strand.first_node : strand.first_node + strand.node_count] = rods.index(strand.rod)
        points, world = model.contact_points, len(self._names) - 1
        # nodes, points of bodies and of the world, points of rods with an arm from a node
        of_bodies = np.array([*range(len(rods), len(rods) + len(bodies)), world])
        others = points.body[model.node_count : len(points.body) - len(points.rod_point_node)]
        self._of_point = np.concatenate([self._of_node, of_bodies[others], self._of_node[points.rod_point_node]])
        self._of_surface = np.array([slot[name] for name in model.surfaces.names], dtype=np.int64)

    def touching(self, engine: Engine) -> list[tuple[Array, Array]]:
        """What touches at the configuration that was evaluated last: contact points with surfaces, nodes with nodes."""
        surfaces, rods, found = engine.surfaces, engine.rod_contact, []
        if surfaces.exists and surfaces.near_count[0]:
            near = slice(int(surfaces.near_count[0]))
            touches = surfaces.near_gap[near] < surfaces.d_hat
            point, surface = surfaces.near_contact_point[near][touches], surfaces.near_surface[near][touches]
            found.append((self._of_point[point], self._of_surface[surface]))
        if rods.exists and rods.contacts.count[0]:
            node = self._of_node[rods.contacts.node[: int(rods.contacts.count[0])]]
            found.append((node[:, 0], node[:, 1]))
        return found

    def names_of(self, touching: list[tuple[Array, Array]]) -> Pairs:
        """The same by names, each pair once: a rod comes before a body, and a body before an obstacle."""
        count = len(self._names)
        codes = [np.minimum(a, b) * count + np.maximum(a, b) for a, b in touching]
        found = np.unique(np.concatenate(codes)).tolist() if codes else []
        return tuple((self._names[code // count], self._names[code % count]) for code in found)
