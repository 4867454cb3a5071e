"""Contact and friction of carriers with surfaces. These terms add to the derivatives of carriers and of bodies."""

from __future__ import annotations

import math

import numpy as np

from ...forces.contact import surface_contact
from ...forces.friction import friction, lag_axes, lag_friction, slip_along
from ...forces.slip import WAY
from ...model.model import Model
from ..configuration import Configuration
from ..neighbours import Neighbours
from .term import Accumulators, Kind, StepContext, Term

Array = np.ndarray


class Barrier(Term):
    """Barrier of carriers against the surfaces near them.

    Attributes
    ----------
    near : Neighbours
    min_gap : float
        Smallest gap at the last evaluation [m].
    """

    names = ("barrier",)

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self.near = Neighbours(model)
        self.min_gap = math.inf

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self.near.update(context.start)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        model, near, out, matrix = self.model, self.near, self.out, self.out.matrix
        carriers, surfaces, contact = model.carriers, model.surfaces, model.scene.contact
        if with_hessian:
            matrix.make_room_for_links(near.count)
        out.energy["barrier"], self.min_gap, links = surface_contact(
            contact.barrier_distance,
            contact.stiffness,
            near.count,
            near.carrier,
            near.surface,
            at.carrier,
            carriers.radius,
            carriers.weight,
            carriers.body,
            surfaces.kind,
            surfaces.size,
            surfaces.rounding,
            at.surface_place,
            at.surface_turn,
            surfaces.body,
            at.place,
            model.bodies.free_index if model.free_count else None,
            out.carrier,
            out.contact,
            near.gap,
            matrix.node_hessian,
            matrix.body_hessian,
            matrix.links,
            matrix.link_node,
            matrix.link_body,
            matrix.link_hessian,
            with_hessian,
        )
        if with_hessian:
            matrix.links = links


class Friction(Term):
    """Friction of the contacts at the start of the step."""

    names = ("friction",)
    kind = Kind.DISSIPATIVE

    def __init__(self, model: Model, out: Accumulators, near: Neighbours):
        super().__init__(model, out)
        self._near = near
        self._count = 0
        self._turn, self._origin_turn, self._back = np.zeros((3, len(model.bodies.names) + 1, 3, 3))
        self._make_room(0)

    def _make_room(self, room: int) -> None:
        self._first = np.zeros(room, dtype=np.int64)
        self._surface = np.zeros(room, dtype=np.int64)
        self._load = np.zeros(room)
        self._normal = np.zeros((room, 3))
        self._axis = np.zeros((room, 3))
        self._arm = np.zeros((room, 3))
        self._lever = np.zeros((room, 3))

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        near, start = self._near, context.start
        carriers, surfaces, contact = self.model.carriers, self.model.surfaces, self.model.scene.contact
        self._back = start.rotation.transpose(0, 2, 1).copy()
        np.matmul(context.origin_rotation, self._back, out=self._origin_turn)
        if near.count > len(self._first):
            self._make_room(len(near.carrier))
        self._count = lag_friction(
            contact.barrier_distance,
            contact.stiffness,
            near.count,
            near.carrier,
            near.surface,
            start.carrier,
            carriers.radius,
            carriers.weight,
            carriers.body,
            surfaces.kind,
            surfaces.size,
            surfaces.rounding,
            start.surface_place,
            start.surface_turn,
            surfaces.body,
            start.place,
            self._first,
            self._surface,
            self._load,
            self._normal,
            self._arm,
            self._lever,
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
        model, out, matrix, context = self.model, self.out, self.out.matrix, self.context
        carriers, surfaces, contact = model.carriers, model.surfaces, model.scene.contact
        np.matmul(at.rotation, self._back, out=self._turn)
        if with_hessian:
            matrix.make_room_for_links(matrix.links + self._count)
        out.energy["friction"], links = friction(
            self._count,
            self._first,
            self._surface,
            self._load,
            self._normal,
            self._axis,
            self._arm,
            self._lever,
            carriers.friction,
            context.length,
            contact.friction.speed_threshold,
            at.position,
            context.origin_position,
            carriers.body,
            surfaces.body,
            at.place,
            context.origin_place,
            self._turn,
            self._origin_turn,
            model.bodies.free_index if model.free_count else None,
            out.carrier,
            out.contact,
            matrix.node_hessian,
            matrix.body_hessian,
            matrix.links,
            matrix.link_node,
            matrix.link_body,
            matrix.link_hessian,
            with_hessian,
        )
        if with_hessian:
            matrix.links = links

    def slip_along(self, at: Configuration, node_step: Array, body_motion: Array) -> Array:
        carriers, context, way = self.model.carriers, self.context, np.empty((self._count, WAY))
        slip_along(
            self._count,
            self._first,
            self._surface,
            self._load,
            self._normal,
            self._axis,
            self._arm,
            self._lever,
            carriers.friction,
            context.length,
            at.position,
            context.origin_position,
            carriers.body,
            self.model.surfaces.body,
            at.place,
            context.origin_place,
            self._turn,
            self._origin_turn,
            node_step,
            body_motion,
            way,
        )
        return way
