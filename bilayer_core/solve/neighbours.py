"""Which carriers are near which surfaces: a list that is made anew only when something has moved far enough."""

from __future__ import annotations

import numpy as np

from ..contact.near import largest_motion, list_near, moved_since
from ..contact.step_bound import step_bound
from ..model.model import Model
from .configuration import Configuration

Array = np.ndarray
MOTION_MARGIN = 4.0  # margin of a list, in units of the motion that demands it


class Neighbours:
    """Pairs of a carrier and a surface that are near each other, and the bound on their approach.

    Attributes
    ----------
    counted, margin : Array
        Number of pairs, and margin of the list [m], as compiled loops share them, shape (1,).
    carrier, surface : Array
        The pairs, by surfaces and then by carriers; only the first `count` count.
    gap : Array
        Gaps [m] as the last evaluation of the barrier found them.
    """

    def __init__(self, model: Model):
        self._model = model
        surfaces, carriers = model.surfaces, model.carriers
        self._reach = model.scene.contact.barrier_distance if model.scene.contact else 0.0
        self.node_free = carriers.follows[: model.node_count] < 0
        self.extent = np.zeros(len(surfaces.kind))
        self.margin = np.full(1, -1.0)  # no list yet
        self.listed_carrier = np.zeros((len(carriers.weight), 3))
        self.listed_place = np.zeros((len(surfaces.kind), 3))
        self.listed_turn = np.zeros((len(surfaces.kind), 3, 3))
        self.counted = np.zeros(1, dtype=np.int64)
        self._make_room(len(carriers.weight) if len(surfaces.kind) else 0)

    @property
    def count(self) -> int:
        """Pairs in the list."""
        return int(self.counted[0])

    def _make_room(self, room: int) -> None:
        self.carrier = np.zeros(room, dtype=np.int64)
        self.surface = np.zeros(room, dtype=np.int64)
        self.gap = np.zeros(room)

    def grow(self) -> None:
        """Have room for twice as many pairs, none of which is listed then."""
        self._make_room(2 * max(1, len(self.carrier)))
        self.counted[0], self.margin[0] = 0, -1.0

    def update(self, at: Configuration, motion: float = 0.0) -> bool:
        """Make the list valid at a configuration and whatever can be reached from it by `motion` [m]; whether that took
        a new one.
        """
        moved = moved_since(
            at.carrier,
            self.listed_carrier,
            at.surface_place,
            self.listed_place,
            at.surface_turn,
            self.listed_turn,
            self.extent,
        )
        if moved + motion <= self.margin[0]:
            return False
        self._list(at, max(self._reach, MOTION_MARGIN * motion))
        return True

    def _list(self, at: Configuration, margin: float) -> None:
        surfaces, carriers = self._model.surfaces, self._model.carriers
        while True:
            self.counted[0] = list_near(
                self._reach,
                margin,
                surfaces.kind,
                surfaces.size,
                surfaces.rounding,
                surfaces.bound,
                at.surface_place,
                at.surface_turn,
                carriers.radius,
                carriers.group,
                surfaces.meets,
                at.carrier,
                self.carrier,
                self.surface,
                self.extent,
            )
            if self.count <= len(self.carrier):
                break
            self._make_room(2 * self.count)
        self.margin[0] = margin
        self.listed_carrier[:] = at.carrier
        self.listed_place[:] = at.surface_place
        self.listed_turn[:] = at.surface_turn

    def bound(self, at: Configuration, node_step: Array, body_motion: Array) -> tuple[float, int]:
        """`contact.step_bound` at a configuration: the fraction, and the carrier and surface that set it.

        Parameters
        ----------
        at : Configuration
        node_step : Array
            Displacement of nodes [m], shape (n_node, 3); those that bodies hold follow their bodies.
        body_motion : Array
            Displacement [m] and rotation vector [rad] of bodies and of the world, shape (n_body + 1, 6).

        Returns
        -------
        alpha : float
        blocking : int
            Place in the list of the pair that sets the bound, −1 if none.
        """
        surfaces, carriers, reach = self._model.surfaces, self._model.carriers, self._model.bodies.reach
        moving = node_step, self.node_free, body_motion, reach, surfaces.body, self.extent
        motion = largest_motion(*moving)
        if self.update(at, motion):
            motion = largest_motion(*moving)  # extents are those of the list
        return step_bound(
            self.count,
            self.carrier,
            self.surface,
            at.carrier,
            carriers.radius,
            carriers.follows,
            node_step,
            surfaces.kind,
            surfaces.size,
            surfaces.rounding,
            at.surface_place,
            at.surface_turn,
            surfaces.body,
            at.place,
            body_motion,
            motion,
        )
