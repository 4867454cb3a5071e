"""Contact between rods over a run: the list of near pairs, the barrier, lagged friction, and what the Newton matrix
needs of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..contact.rod_bound import largest_travel, rod_step_bound
from ..contact.segment import facing_contacts
from ..forces.rod_contact import rod_barrier, rod_friction
from ..model.model import Model
from ..model.rod_surfaces import NearPairs

Array = np.ndarray
LEAST_MARGIN = 2.0  # of the barrier distance plus the thickest layer: how far beyond contact pairs are listed
LARGEST_MARGIN = 20.0
STEPS_AHEAD = 4.0  # moves of the present size for which a list is made


@dataclass
class Contacts:
    """Arrays with room for some contacts, the first `count` of which are in use; see `forces.rod_contact`."""

    room: int

    def __post_init__(self):
        room = self.room
        self.count = 0
        self.point, self.edge, self.times = (np.zeros(room, dtype=np.int64) for _ in range(3))
        self.fraction, self.gap, self.inner = np.zeros(room), np.zeros(room), np.zeros(room, dtype=bool)
        self.node = np.zeros((room, 2), dtype=np.int64)
        self.weight, self.turn = np.zeros((room, 4)), np.zeros((room, 4, 3))
        self.normal, self.load, self.side = np.zeros((room, 3)), np.zeros(room), np.zeros(room)
        self.matrix = np.zeros((room, 3, 3))
        self.lean, self.along = np.zeros(room), np.zeros((room, 3))

    def curvature(self, simplified: int) -> tuple[Array, Array]:
        """M and κ of the contacts in use; simplified once, without what is negative across the two edges, twice,
        without all that is negative. Friction has nothing negative.
        """
        used = slice(self.count)
        matrix, side = self.matrix[used], self.side[used]
        if not simplified or not self.lean.any():
            return matrix, side
        across = np.cross(self.normal[used], self.along[used])
        lean = self.lean[used, None, None]
        matrix = matrix - lean * across[:, :, None] * across[:, None, :]
        if simplified == 1:
            return matrix, side
        along = self.along[used]
        return matrix - lean * along[:, :, None] * along[:, None, :], np.zeros_like(side)


class RodContact:
    """Contact of the rods of a model with each other and with themselves.

    Pairs are listed with a margin and listed anew once a node has moved by half of it. What is computed does not depend
    on the list, which holds all contacts at any time, always in the same order.

    Attributes
    ----------
    contacts, sliding, none : Contacts
        Those of the last `barrier`, those that `start_step` froze for friction, and room for none.
    pairs, base, margin : NearPairs, Array, float
        The list of near pairs, the positions [m] for which it was made, shape (n_node, 3), and how far it reaches [m].
    unit : float
        Barrier distance and thickest layer together [m].
    listed : object
        Another one after each list.
    min_gap : float
        Smallest gap below d̂ at the last `barrier` [m], infinite without one.
    """

    def __init__(self, model: Model):
        self._model = model
        contact, surfaces = model.scene.contact, model.rod_surfaces
        self._d_hat, self._stiffness = contact.barrier_distance, contact.stiffness
        law = contact.friction
        self._coefficient = law.coefficient if law else 0.0
        self._threshold = law.speed_threshold if law else math.inf
        self._surfaces = surfaces
        self.unit = self._d_hat + 2.0 * float(surfaces.edge_radius.max())
        self.pairs = NearPairs(surfaces, model.edge_node, model.start_position, self._d_hat)
        self.base = np.full((model.node_count, 3), math.inf)
        self.margin = -1.0
        self.listed = object()
        self._no_step = np.zeros((model.node_count, 3))
        self._scratch = np.zeros((model.node_count, 3))
        self.contacts, self.sliding, self.none = Contacts(0), Contacts(0), Contacts(0)
        self.min_gap = math.inf

    def _list(self, position: Array, move: float) -> None:
        """List pairs about `position`, for moves of size `move` [m]."""
        self.margin = min(max(2.0 * STEPS_AHEAD * move, LEAST_MARGIN * self.unit), LARGEST_MARGIN * self.unit)
        self.base[:] = position
        self.listed = object()
        self.pairs.find(self.base, self._d_hat + self.margin)

    def list_about(self, position: Array, move: float) -> None:
        """List pairs so that a step of size `move` [m] from positions of nodes can be bounded."""
        self._list(position, move)

    def _find(self, position: Array) -> float:
        """Contacts at `position`; returns the smallest gap [m]."""
        travel, _ = largest_travel(position, self._no_step, self.base)
        if not travel <= 0.5 * self.margin:
            self._list(position, 0.0)
        pairs, surfaces = self.pairs, self._surfaces
        while True:
            contacts = self.contacts
            contacts.count, gap = facing_contacts(
                position,
                pairs.count,
                pairs.point,
                pairs.edge,
                pairs.before,
                pairs.after,
                self._model.edge_node,
                surfaces.edge_radius,
                surfaces.point_edge,
                surfaces.point_fraction,
                self._d_hat,
                contacts.point,
                contacts.edge,
                contacts.fraction,
                contacts.inner,
                contacts.times,
                contacts.gap,
            )
            if contacts.count <= contacts.room:
                break
            self.contacts = Contacts(2 * contacts.count)
        return gap if gap < self._d_hat else math.inf

    def barrier(self, position: Array, gradient: Array) -> float:
        """Add the barrier's gradient [N] and return its energy [J], infinite if rods overlap."""
        self.min_gap = self._find(position)
        contacts, surfaces = self.contacts, self._surfaces
        if contacts.count == 0:
            return 0.0
        return rod_barrier(
            self._d_hat,
            self._stiffness,
            position,
            contacts.count,
            contacts.point,
            contacts.edge,
            contacts.fraction,
            contacts.inner,
            contacts.times,
            contacts.gap,
            self._model.edge_node,
            surfaces.edge_radius,
            surfaces.point_edge,
            surfaces.point_fraction,
            surfaces.point_weight,
            gradient,
            contacts.node,
            contacts.weight,
            contacts.normal,
            contacts.load,
            contacts.matrix,
            contacts.side,
            contacts.turn,
            contacts.lean,
            contacts.along,
        )

    def start_step(self, position: Array) -> None:
        """Freeze the contacts of friction."""
        self.barrier(position, self._scratch)
        found, sliding = self.contacts, self.sliding
        if sliding.room < found.count:
            self.sliding = sliding = Contacts(2 * found.count)
        sliding.count = found.count
        used = slice(found.count)
        for name in ("node", "weight", "normal", "load"):
            getattr(sliding, name)[used] = getattr(found, name)[used]

    def friction(self, position: Array, origin_position: Array, step_length: float, gradient: Array) -> float:
        """Add the gradient of the lagged friction [N] and return its dissipation potential [J]."""
        sliding = self.sliding
        if sliding.count == 0:
            return 0.0
        return rod_friction(
            self._coefficient,
            self._threshold,
            step_length,
            position,
            origin_position,
            sliding.count,
            sliding.node,
            sliding.weight,
            sliding.normal,
            sliding.load,
            gradient,
            sliding.matrix,
        )

    def step_bound(self, position: Array, step: Array) -> tuple[float, int]:
        """Largest fraction of a step of nodes [m], shape (n_node, 3), that keeps all gaps open, and the node that sets
        it (−1: none).
        """
        travel, move = largest_travel(position, step, self.base)
        now, _ = largest_travel(position, self._no_step, self.base)
        limit = 1.0
        if not max(travel, now) <= 0.5 * self.margin:
            self._list(position, move)
            limit = min(1.0, 0.5 * self.margin / max(move, 1e-300))
        pairs, surfaces = self.pairs, self._surfaces
        if pairs.count == 0:
            return limit, -1
        return rod_step_bound(
            position,
            step,
            limit,
            pairs.count,
            pairs.point,
            pairs.edge,
            self._model.edge_node,
            surfaces.edge_radius,
            surfaces.point_edge,
            surfaces.point_fraction,
        )
