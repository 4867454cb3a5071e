"""Pairs in contact: rods, bodies and obstacles that are nearer to each other than the barrier distance."""

from __future__ import annotations

import numpy as np

from bilayer_core.model.model import Model

Array = np.ndarray
Pairs = tuple[tuple[str, str], ...]
AN_OBSTACLE = "an obstacle"
"""Whose corners touch a body: points of the world are not told apart."""


class ContactOwners:
    """Whose the contact points and surfaces of a model are.

    Parameters
    ----------
    model : Model

    Attributes
    ----------
    count : int
        How many owners there are.
    of_point, of_surface : Array
        Number of the owner of each contact point and surface, shape (n_contact_point,), (n_surface,).
    """

    def __init__(self, model: Model):
        rods = list(dict.fromkeys(strand.rod for strand in model.strands))
        bodies = list(model.bodies.names)
        surfaces = [name for name in model.surface_names if name not in bodies]
        self._names = [*rods, *bodies, *surfaces, AN_OBSTACLE]
        slot = {name: index for index, name in reversed(list(enumerate(self._names)))}
        self.count = len(self._names)
        of_node = np.zeros(model.node_count, dtype=np.int64)
        for strand in model.strands:
            of_node[strand.first_node : strand.first_node + strand.node_count] = rods.index(strand.rod)
        points, world = model.surfaces, self.count - 1
        # nodes, points of bodies and of the world, points of rods with an arm from a node
        of_bodies = np.array([*range(len(rods), len(rods) + len(bodies)), world])
        self.of_point = np.concatenate([of_node, of_bodies[points.point_body], of_node[points.rod_points.node]])
        self.of_surface = np.array([slot[name] for name in model.surface_names], dtype=np.int64)

    def names_of(self, touching: Array) -> Pairs:
        """Return the names of the pairs of what `engine.observables` saw touch: a rod comes before a body, and a body
        before an obstacle.
        """
        pairs = (divmod(code, self.count) for code in sorted(touching.tolist()))
        return tuple((self._names[a], self._names[b]) for a, b in pairs)
