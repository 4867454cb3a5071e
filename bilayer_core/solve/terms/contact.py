"""Contact and friction of carriers. These terms add to the derivatives of carriers, and of bodies' rotations."""

from __future__ import annotations

import math

import numpy as np

from ...forces.contact import pair_contact, plane_contact
from ...forces.friction import friction, lag_axes, lag_friction
from ...model.model import Model
from ..configuration import Configuration
from .term import Accumulators, Kind, StepContext, Term


class Barrier(Term):
    """Barrier of carriers against planes and each other.

    Attributes
    ----------
    min_gap : float
        Smallest gap at the last evaluation [m].
    pair_gap : Array
        Gap of each pair there [m], shape (n_pair,).
    """

    names = ("barrier",)

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        carriers = model.carriers
        self.has_planes = len(carriers.plane_point) > 0
        self.has_balls = len(carriers.pair_first) > 0
        self.min_gap = math.inf
        self.pair_gap = np.full(len(carriers.pair_first), math.inf)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        carriers, contact, out = self.model.carriers, self.model.scene.contact, self.out
        law = (contact.barrier_distance, contact.stiffness, carriers.weight, carriers.radius, at.carrier)
        carrier_out = (out.carrier, out.matrix.carrier_hessian)
        barrier, self.min_gap = 0.0, math.inf
        if self.has_planes:
            barrier, self.min_gap = plane_contact(
                *law, carriers.plane_point, carriers.plane_normal, *carrier_out, with_hessian
            )
        if self.has_balls:
            energy, gap = pair_contact(
                *law,
                carriers.pair_first,
                carriers.pair_second,
                *carrier_out,
                out.matrix.ball_hessian,
                self.pair_gap,
                with_hessian,
            )
            barrier, self.min_gap = barrier + energy, min(self.min_gap, gap)
        out.energy["barrier"] = barrier


class Friction(Term):
    """Friction of the contacts at the start of the step."""

    names = ("friction",)
    kind = Kind.DISSIPATIVE

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        carriers = model.carriers
        room = len(carriers.weight) * len(carriers.plane_point) + len(carriers.pair_first)
        self._first = np.zeros(room, dtype=np.int64)
        self._second = np.zeros(room, dtype=np.int64)
        self._pair = np.zeros(room, dtype=np.int64)
        self._load = np.zeros(room)
        self._normal = np.zeros((room, 3))
        self._axis = np.zeros((room, 3))
        self._count = 0
        self._turn, self._origin_turn = np.zeros((2, model.free_count, 3, 3))

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        contact, carriers, start = self.model.scene.contact, self.model.carriers, context.start
        self._origin_turn[:] = context.origin_body_rotation @ start.body_rotation.transpose(0, 2, 1)
        self._count = lag_friction(
            contact.barrier_distance,
            contact.stiffness,
            carriers.weight,
            carriers.radius,
            start.carrier,
            carriers.plane_point,
            carriers.plane_normal,
            carriers.pair_first,
            carriers.pair_second,
            self._first,
            self._second,
            self._pair,
            self._load,
            self._normal,
        )
        lag_axes(
            self._count,
            self._first,
            self._normal,
            carriers.node_edges,
            carriers.node_axis,
            start.tangent,
            start.director1,
            self._axis,
        )

    def add(self, at: Configuration, with_hessian: bool) -> None:
        carriers, contact, out = self.model.carriers, self.model.scene.contact, self.out
        context, matrix = self.context, self.out.matrix
        for b in range(self.model.free_count):
            self._turn[b] = at.body_rotation[b] @ context.start.body_rotation[b].T
        out.energy["friction"] = friction(
            self._count,
            self._first,
            self._second,
            self._pair,
            self._load,
            self._normal,
            self._axis,
            carriers.friction,
            context.length,
            contact.friction.speed_threshold,
            carriers.radius,
            at.carrier,
            context.origin_carrier,
            carriers.free_body,
            self._turn,
            self._origin_turn,
            out.carrier,
            out.body,
            matrix.carrier_hessian,
            matrix.ball_hessian,
            matrix.ball_turn_hessian,
            matrix.body_hessian,
            with_hessian,
        )
