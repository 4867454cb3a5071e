"""Pairs of rods, bodies and obstacles: which are nearer to each other than the barrier distance, and their forces."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice, product

import numpy as np

from bilayer_core.model.model import Model
from bilayer_core.model.rod_pairs import rod_pairs

Array = np.ndarray
Pairs = tuple[tuple[str, str], ...]
MOST_TOLD = 1000
"""Pairs of rods, or with a surface, up to which the force of each is told; a heap of rods has too many."""


class ContactOwners:
    """Whose the contact points and surfaces of a model are.

    Parameters
    ----------
    model : Model

    Attributes
    ----------
    of_point, of_surface : Array
        Number of the owner of each contact point and surface, shape (n_contact_point,), (n_surface,).
    count : int
        How many owners there are.
    pairs : tuple of (str, str)
        Those that can touch, and whose forces are told.
    seen_pair : Array
        Their numbers a · count + b, a ≤ b, ascending, shape (n_pair,).
    """

    def __init__(self, model: Model):
        scene, points = model.scene, model.surfaces
        rods = list(dict.fromkeys(strand.rod for strand in model.strands))
        self._names = [*rods, *model.bodies.names, *(obstacle.name for obstacle in scene.obstacles)]
        of_node = np.zeros(model.node_count, dtype=np.int64)
        for strand in model.strands:
            of_node[strand.first_node : strand.first_node + strand.node_count] = rods.index(strand.rod)
        # nodes, points of bodies and of obstacles, points of rods with an arm from a node
        others = slice(model.node_count, model.node_count + len(points.point_body))
        copies = len(rods) - len(scene.rods)  # friction knows rods by their patterns
        self.of_point = np.concatenate([of_node, model.sliding.owner[others] + copies, of_node[points.rod_points.node]])
        self.of_surface = model.sliding.surface_owner + copies
        numbers = {name: number for number, name in enumerate(self._names)}
        of_rods = ((numbers[a], numbers[b]) for a, b in _pairs_of_rods(model))
        kinds = (set(islice(of, MOST_TOLD + 1)) for of in (of_rods, self._with_surfaces(model)))
        found = sorted(pair for of in kinds if len(of) <= MOST_TOLD for pair in of)
        self.pairs, self.count = tuple((self._names[a], self._names[b]) for a, b in found), len(self._names)
        self.seen_pair = np.array([a * self.count + b for a, b in found], dtype=np.int64)

    def _with_surfaces(self, model: Model) -> Iterator[tuple[int, int]]:
        points = model.surfaces
        for surface, can_collide in zip(self.of_surface.tolist(), points.can_collide, strict=True):
            for owner in np.unique(self.of_point[can_collide[points.group]]).tolist():
                yield min(owner, surface), max(owner, surface)

    def names_of(self, touching: Array) -> Pairs:
        """Return the names of the pairs of what `engine.observables` saw touch: a rod comes before a body, and a body
        before an obstacle.
        """
        pairs = (divmod(code, self.count) for code in sorted(touching.tolist()))
        return tuple((self._names[a], self._names[b]) for a, b in pairs)


def _pairs_of_rods(model: Model) -> Iterator[tuple[str, str]]:
    """Yield the names of rods that can touch, copies one by one."""
    rods = model.scene.rods
    for pair in rod_pairs(model.scene):
        if pair.active:
            first, second = rods[pair.first].copy_names, rods[pair.second].copy_names
            if pair.copies:
                yield from combinations(first, 2)
            elif pair.first == pair.second:
                yield from zip(first, first, strict=True)
            else:
                yield from product(first, second)
