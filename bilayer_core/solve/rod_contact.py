"""Contact between rods over a run: the list of near pairs, the barrier, lagged friction, and what the Newton matrix
needs of them.
"""

from __future__ import annotations

import math

import numpy as np

from ..contact.rod_bound import rod_step_bound
from ..contact.rod_list import FIRST, PATH, list_rods, reachable
from ..contact.segment import facing_contacts
from ..forces.rod_contact import rod_barrier, rod_friction, rod_slip_along
from ..forces.slip import WAY
from ..model.model import Model
from ..model.rod_surfaces import NearPairs

Array = np.ndarray
PAIRS_PER_POINT = 8
"""That there is room for at first."""


class Contacts:
    """Arrays with room for some contacts, the first `count` of which are in use; see `forces.rod_contact`.

    `counted` is their number as compiled loops share it, shape (1,).
    """

    def __init__(self, room: int):
        self.room = room
        self.counted = np.zeros(1, dtype=np.int64)
        self.point, self.edge, self.times = (np.zeros(room, dtype=np.int64) for _ in range(3))
        self.fraction, self.gap, self.inner = np.zeros(room), np.zeros(room), np.zeros(room, dtype=bool)
        self.node = np.zeros((room, 2), dtype=np.int64)
        self.weight, self.turn = np.zeros((room, 4)), np.zeros((room, 4, 3))
        self.normal, self.load, self.side = np.zeros((room, 3)), np.zeros(room), np.zeros(room)
        self.matrix = np.zeros((room, 3, 3))
        self.lean, self.along = np.zeros(room), np.zeros((room, 3))

    @property
    def count(self) -> int:
        """Contacts in use."""
        return int(self.counted[0])

    @property
    def found(self) -> tuple[Array, ...]:
        """What `facing_contacts` writes."""
        return self.point, self.edge, self.fraction, self.inner, self.times, self.gap

    def grown(self, room: int) -> Contacts:
        """A copy with room for so many."""
        larger, used = Contacts(room), slice(min(self.count, self.room))
        for name, values in vars(self).items():
            if name not in ("room", "counted"):
                getattr(larger, name)[used] = values[used]
        larger.counted[:] = self.counted
        return larger


class RodContact:
    """Contact of the rods of a model with each other and with themselves.

    What is computed does not depend on the list of near pairs, which holds all contacts at any time, always in the same
    order; see `contact.rod_list`.

    Attributes
    ----------
    contacts, sliding : Contacts
        Those of the last `barrier`, and those that `start_step` froze for friction.
    pairs, base, tip, last, ways : NearPairs, Array, Array, Array, Array
        The list of near pairs, for which motion it was made, and the path since; see `contact.rod_list.list_rods`.
    unit : float
        Barrier distance and thickest layer together [m].
    room : int
        Changes whenever arrays are replaced by larger ones.
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
        points = len(surfaces.point_edge)
        self.pairs = NearPairs(surfaces, model.edge_node, PAIRS_PER_POINT * points)
        self.base, self.tip, self.last = np.zeros((3, model.node_count, 3))
        self.ways = np.array([0.0, -1.0, 0.0, -math.inf])
        self.start_position = np.array(model.start_position)
        self.no_step, self.scratch = np.zeros((2, model.node_count, 3))
        self.contacts, self.sliding = Contacts(points), Contacts(points)
        self.min_gap = math.inf

    @property
    def room(self) -> int:
        """Of pairs and contacts together."""
        return len(self.pairs.point) + self.contacts.room + self.sliding.room

    def make_room(self) -> None:
        """Have room for what was counted and not written."""
        if self.pairs.count > len(self.pairs.point):
            self.pairs.make_room(2 * self.pairs.count)
            self.pairs.counted[0] = 0
        if self.contacts.count > self.contacts.room:
            self.contacts = Contacts(2 * self.contacts.count)
        if self.sliding.room < self.contacts.room:
            self.sliding = self.sliding.grown(self.contacts.room)

    def _list(self, position: Array, step: Array, fraction: float, move: float) -> None:
        """Have a list for a part of a step of nodes [m] from `position`, in which they move by `move`."""
        pairs = self.pairs
        while not list_rods(
            position,
            step,
            fraction,
            move,
            self.unit,
            self._d_hat,
            self.start_position,
            *pairs.geometry,
            self.base,
            self.tip,
            self.last,
            self.ways,
            pairs.counted,
            *pairs.outputs,
        ):
            self.make_room()

    def _find(self, position: Array) -> float:
        """Contacts at `position`; returns the smallest gap [m]."""
        self._list(position, self.no_step, 0.0, 0.0)
        pairs, surfaces = self.pairs, self._surfaces
        while True:
            contacts = self.contacts
            contacts.counted[0], gap, self.ways[FIRST] = facing_contacts(
                position,
                pairs.count,
                *pairs.outputs,
                self.ways[PATH],
                self._model.edge_node,
                surfaces.edge_radius,
                surfaces.point_edge,
                surfaces.point_fraction,
                self._d_hat,
                *contacts.found,
            )
            if contacts.count <= contacts.room:
                break
            self.make_room()
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
        self.barrier(position, self.scratch)
        found, sliding = self.contacts, self.sliding
        sliding.counted[:] = found.counted
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

    def slip_along(self, position: Array, origin_position: Array, step_length: float, node_step: Array) -> Array:
        """Way of the lagged contacts along a step of nodes [m], shape (n_node, 3); see `forces.slip`."""
        sliding = self.sliding
        way = np.empty((sliding.count, WAY))
        rod_slip_along(
            self._coefficient,
            step_length,
            position,
            origin_position,
            sliding.count,
            sliding.node,
            sliding.weight,
            sliding.normal,
            sliding.load,
            node_step,
            0,
            way,
        )
        return way

    def step_bound(self, position: Array, step: Array) -> tuple[float, int]:
        """Largest fraction of a step of nodes [m], shape (n_node, 3), that keeps all gaps open, and the node that sets
        it (−1: none).
        """
        move, limit = reachable(step, self.unit)
        self._list(position, self.no_step, 0.0, 0.0)
        self._list(position, step, limit, limit * move)
        pairs, surfaces = self.pairs, self._surfaces
        return rod_step_bound(
            position,
            step,
            limit,
            self._d_hat,
            pairs.count,
            pairs.point,
            pairs.edge,
            pairs.until,
            self.ways[PATH],
            2.0 * limit * move,
            self._model.edge_node,
            surfaces.edge_radius,
            surfaces.point_edge,
            surfaces.point_fraction,
        )
