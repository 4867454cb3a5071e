"""The incremental potential of one implicit step: the sum of all terms that a scene needs, its gradient and its
Newton matrix.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..forces.bend_twist import bend_twist
from ..forces.body import body_spring
from ..forces.contact import pair_contact, plane_contact
from ..forces.coupling import bond_translation
from ..forces.drag import drag, lag_directions
from ..forces.friction import friction, lag_axes, lag_friction
from ..forces.quadratic import angle_spring, gravity, node_spring
from ..forces.stretch import stretch
from ..model.model import Model
from .assembly import expand_gradient
from .clamps import hand_gradient_to_bodies
from .configuration import Configuration
from .newton_matrix import NewtonMatrix, zeros_in_one

Array = np.ndarray


@dataclass(frozen=True)
class StepContext:
    """What is frozen over a step.

    Attributes
    ----------
    length : float
        h [s].
    start : Configuration
        At the start of the step.
    predicted_position : Array
        x̃ of nodes [m], shape (n_node, 3).
    predicted_turn : Array
        Turn of edges that inertia prefers [rad], shape (n_edge,).
    predicted_body_position, predicted_body_rotation : Array
        X̃ [m] and R̃ of free bodies, shapes (n_free, 3), (n_free, 3, 3).
    eigenstrain : Array
        η of each edge at the end of the step, shape (n_edge,).
    """

    length: float
    start: Configuration
    predicted_position: Array
    predicted_turn: Array
    predicted_body_position: Array
    predicted_body_rotation: Array
    eigenstrain: Array


class IncrementalPotential:
    """Terms of a model, their accumulators, and the frozen data of the present step.

    After `evaluate`, `terms` has each term's energy [J], `gradient` that of the unknowns (zero where nodes are held),
    shape (size,), and
    `body_gradient` that of free bodies, shape (n_free, 6). `carrier_gradient`, shape (n_carrier, 3), and
    `body_contact_gradient`
    are the parts of contact and friction alone.
    """

    def __init__(self, model: Model):
        self.model = model
        scene = model.scene
        edges = model.edge_count + model.wall_count
        joints, pairs, carriers = len(model.joint_a), len(model.pair_top), model.carriers
        self._gravity = np.array(scene.gravity)
        self.has_gravity = bool(self._gravity.any())
        self.has_damping = scene.damping.mass > 0.0
        self.has_bond = pairs > 0
        self.has_planes = scene.contact is not None and len(carriers.plane_point) > 0
        self.has_balls = scene.contact is not None and len(carriers.pair_first) > 0
        self.has_contact = self.has_planes or self.has_balls
        law = scene.contact.friction if scene.contact else None
        self.has_friction = self.has_contact and law is not None and law.acts
        self.has_drag = len(model.drag_node) > 0
        self.has_bodies = model.free_count > 0

        self.terms: dict[str, float] = {}
        self.min_gap = math.inf
        self.gradient = np.zeros(model.layout.size)
        shapes = {"node": (model.node_count, 3), "edge": (edges, 4), "pair": (pairs, 3), "body": (model.free_count, 6)}
        self._first_derivatives, parts = zeros_in_one(shapes)
        self._node_gradient, self.edge_gradient, self._pair_gradient, self.body_gradient = parts
        self.carrier_gradient = np.zeros((len(carriers.weight), 3))
        self.body_contact_gradient = np.zeros((model.free_count, 6))
        self.pair_gap = np.full(len(carriers.pair_first), math.inf)
        self.matrix = NewtonMatrix(model, self.has_contact or self.has_drag, self.has_balls, self.carrier_gradient)
        self.attached_gradient = np.zeros((len(model.attached_node), 3))
        self._attached_free, self._wall_free = model.attached_free, model.wall_free
        self._joint_count = joints
        room = len(carriers.weight) * len(carriers.plane_point) + len(carriers.pair_first) if self.has_friction else 0
        self._contact_first = np.zeros(room, dtype=np.int64)
        self._contact_second = np.zeros(room, dtype=np.int64)
        self._contact_pair = np.zeros(room, dtype=np.int64)
        self._contact_load = np.zeros(room)
        self._contact_normal = np.zeros((room, 3))
        self._contact_axis = np.zeros((room, 3))
        self._contact_count = 0
        self._drag_direction = np.zeros((len(model.drag_node), 3, 3))
        self._flow = np.array(scene.fluid.velocity if scene.fluid else (0.0, 0.0, 0.0))
        self._turn = np.zeros((model.free_count, 3, 3))
        self.context: StepContext | None = None

    def start_step(self, context: StepContext) -> None:
        """Freeze what a step depends on: friction's contacts and drag's directions among it."""
        self.context = context
        if self.has_drag:
            before, after = self.model.drag_edge.T
            start = context.start
            lag_directions(self.model.drag_node, before, after, start.tangent, start.director1, self._drag_direction)
        if self.has_friction:
            model, contact = self.model, self.model.scene.contact
            carriers = model.carriers
            self._contact_count = lag_friction(
                contact.barrier_distance,
                contact.stiffness,
                carriers.weight,
                carriers.radius,
                context.start.carrier,
                carriers.plane_point,
                carriers.plane_normal,
                carriers.pair_first,
                carriers.pair_second,
                self._contact_first,
                self._contact_second,
                self._contact_pair,
                self._contact_load,
                self._contact_normal,
            )
            lag_axes(
                self._contact_count,
                self._contact_first,
                self._contact_normal,
                carriers.node_edges,
                carriers.node_axis,
                context.start.tangent,
                context.start.director1,
                self._contact_axis,
            )

    def evaluate(self, at: Configuration, with_hessian: bool) -> float:
        """Potential at a configuration [J]; infinite behind a surface. Gradient always, second derivatives on
        request.
        """
        model, context, matrix = self.model, self.context, self.matrix
        self._first_derivatives.fill(0.0)
        if with_hessian:
            matrix.clear()
        terms = self.terms
        terms.clear()
        frames = (at.length, at.tangent, at.director1, at.director2)
        edge_out = (self.edge_gradient, matrix.edge_hessian)
        terms["stretching"] = stretch(
            model.axial_stiffness,
            model.rest_length,
            context.eigenstrain,
            at.length,
            at.tangent,
            *edge_out,
            with_hessian,
        )
        joints = (model.joint_a, model.joint_b, model.joint_stiffness, model.joint_rest, *frames)
        twist = context.start.joint_strain[:, 2]
        joint_out = (at.joint_strain, *edge_out, matrix.cross_hessian, with_hessian)
        terms["bending"], terms["twisting"] = bend_twist(0, model.bend_count, *joints, twist, *joint_out)
        if self.has_bond:
            rotation = bend_twist(model.bend_count, self._joint_count, *joints, twist, *joint_out)
            translation = bond_translation(
                at.position,
                model.edge_node,
                model.pair_top,
                model.pair_bottom,
                model.pair_stiffness,
                model.pair_rest,
                *frames,
                *edge_out,
                self._pair_gradient,
                matrix.pair_hessian,
                matrix.top_hessian,
                matrix.bottom_hessian,
                matrix.cross_hessian[model.bend_count :],
                with_hessian,
            )
            terms["bond"] = sum(rotation) + translation
        self._add_inertia_and_gravity(at, with_hessian)
        if self.has_drag:
            terms["drag"] = drag(
                model.drag_node,
                model.drag_coefficient,
                self._drag_direction,
                self._flow,
                context.length,
                at.position,
                context.start.position,
                self._node_gradient,
                matrix.carrier_hessian,
                with_hessian,
            )
        if self.has_contact:
            others = self.body_gradient.copy()
            self._add_contact(at, with_hessian)
            self._node_gradient += self.carrier_gradient[: model.node_count]
            matrix.add_carriers_to_bodies(self.carrier_gradient, at, self.body_gradient)
            self.body_contact_gradient = self.body_gradient - others
        expand_gradient(
            model.edge_node,
            model.layout.node,
            model.layout.edge,
            model.pair_top,
            model.pair_bottom,
            self.edge_gradient,
            self._pair_gradient,
            self._node_gradient,
            self.gradient,
        )
        hand_gradient_to_bodies(
            model.layout.attached,
            self._attached_free,
            at.arm,
            self._wall_free,
            at.tangent,
            self.edge_gradient,
            model.edge_count,
            self.gradient,
            self.attached_gradient,
            self.body_gradient,
        )
        return sum(terms.values())

    def _add_inertia_and_gravity(self, at: Configuration, with_hessian: bool) -> None:
        model, context, terms = self.model, self.context, self.terms
        start = context.start
        inertia = 1.0 / context.length**2
        damping = model.scene.damping.mass / context.length
        bodies = model.bodies
        body_at = (at.body_position, at.body_rotation)
        body_out = (self.body_gradient, self.matrix.body_hessian, with_hessian)
        node_out, edge_out = self._node_gradient, self.edge_gradient
        terms["inertia"] = node_spring(model.node_mass, inertia, at.position, context.predicted_position, node_out)
        terms["inertia"] += angle_spring(model.spin_inertia, inertia, at.turn, context.predicted_turn, edge_out)
        if self.has_bodies:
            predicted = (context.predicted_body_position, context.predicted_body_rotation)
            terms["inertia"] += body_spring(bodies.mass, bodies.second_moment, inertia, *body_at, *predicted, *body_out)
        if self.has_damping:
            terms["damping"] = node_spring(model.node_mass, damping, at.position, start.position, node_out)
            terms["damping"] += angle_spring(model.spin_inertia, damping, at.turn, start.turn, edge_out)
        if self.has_gravity:
            terms["gravity"] = gravity(model.node_mass, self._gravity, at.position, node_out)
            if self.has_bodies:
                terms["gravity"] += gravity(bodies.mass, self._gravity, at.body_position, self.body_gradient)

    def _add_contact(self, at: Configuration, with_hessian: bool) -> None:
        carriers, contact, matrix = self.model.carriers, self.model.scene.contact, self.matrix
        self.carrier_gradient.fill(0.0)
        law = (contact.barrier_distance, contact.stiffness, carriers.weight, carriers.radius, at.carrier)
        carrier_out = (self.carrier_gradient, matrix.carrier_hessian)
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
                matrix.ball_hessian,
                self.pair_gap,
                with_hessian,
            )
            barrier, self.min_gap = barrier + energy, min(self.min_gap, gap)
        self.terms["barrier"] = barrier
        if self.has_friction:
            start = self.context.start
            for b in range(self.model.free_count):
                self._turn[b] = at.body_rotation[b] @ start.body_rotation[b].T
            self.terms["friction"] = friction(
                self._contact_count,
                self._contact_first,
                self._contact_second,
                self._contact_pair,
                self._contact_load,
                self._contact_normal,
                self._contact_axis,
                carriers.friction,
                self.context.length,
                contact.friction.speed_threshold,
                carriers.radius,
                at.carrier,
                start.carrier,
                carriers.free_body,
                self._turn,
                self.carrier_gradient,
                self.body_gradient,
                matrix.carrier_hessian,
                matrix.ball_hessian,
                matrix.ball_turn_hessian,
                matrix.body_hessian,
                with_hessian,
            )

    def factorise(self, at: Configuration) -> bool:
        """Factorise the Newton matrix of the last evaluation, that of `at`; false if it cannot be made positive
        definite.
        """
        return self.matrix.factorise(self.diagonal_factor(), at, self.edge_gradient, self.attached_gradient)

    def newton_step(self) -> tuple[Array, Array]:
        """Minus the inverse of the factorised matrix times the present gradient; see `NewtonMatrix.newton_step`."""
        return self.matrix.newton_step(self.gradient, self.body_gradient)

    def diagonal_factor(self) -> float:
        """Factor of the mass matrix in the Hessian: 1/h² + α/h [1/s²]."""
        h = self.context.length
        return 1.0 / h**2 + self.model.scene.damping.mass / h
