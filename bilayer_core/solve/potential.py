"""The incremental potential of one implicit step: the sum of all terms that a scene needs, its gradient and its
Newton matrix.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..forces.slip import held_up
from ..model.model import Model
from .assembly import expand_gradient
from .clamps import hand_gradient_to_bodies
from .configuration import Configuration
from .terms.contact import Barrier, Friction
from .terms.elastic import BendingAndTwisting, BendingOffAxis, Bond, Stretching
from .terms.fluid import AddedMass, Drag
from .terms.inertial import Damping, Gravity, Inertia
from .terms.loads import Followers, Loads, Moments
from .terms.planar import PlanarElasticity
from .terms.rod_contact import RodBarrier, RodFriction
from .terms.term import Accumulators, Kind, StepContext, Term

Array = np.ndarray


class IncrementalPotential:
    """Terms of a model, their accumulators, and the frozen data of the present step.

    After `evaluate`, `terms` has each term's energy [J], `gradient` that of the unknowns (zero where nodes are held),
    shape (size,), and
    `body_gradient` that of free bodies, shape (n_free, 6). `carrier_gradient`, shape (n_carrier, 3), and
    `contact_gradient`, of all bodies and of the world, shape (n_body + 1, 6), are the parts of contact and friction
    alone. `near` lists the pairs that can touch, None without contact.
    """

    def __init__(self, model: Model):
        self.model = model
        contact = model.scene.contact
        has_surfaces, has_rods = model.meets_surfaces, model.rod_surfaces is not None
        self.has_contact = has_surfaces or has_rods
        has_drag, has_added_mass = len(model.drag_node) > 0, len(model.fluid_mass) > 0
        in_plane = model.plane is not None
        has_node_blocks = self.has_contact or has_drag or has_added_mass

        self.gradient = np.zeros(model.layout.size)
        self.accumulators = Accumulators(model, has_node_blocks)
        self.terms = self.accumulators.energy
        self.matrix = self.accumulators.matrix
        self.edge_gradient = self.accumulators.edge
        self.body_gradient = self.accumulators.body
        self.carrier_gradient = self.accumulators.carrier
        self.contact_gradient = self.accumulators.contact
        self.attached_gradient = np.zeros((len(model.attached_node), 3))
        self._attached_free, self._wall_free = model.attached_free, model.wall_free
        self.context: StepContext | None = None

        # The register, in the order of the sum: what adds to nodes, edges, pairs and bodies; then to carriers.
        law = contact.friction if contact else None
        slides = law is not None and law.acts
        self._barrier = Barrier(model, self.accumulators) if has_surfaces else None
        self.near = self._barrier.near if self._barrier else None
        self._of_rods_and_bodies = self._needed(
            (Stretching, not in_plane),
            (BendingAndTwisting, not in_plane and len(model.coupled_joint) == 0),
            (BendingOffAxis, not in_plane and len(model.coupled_joint) > 0),
            (Bond, not in_plane and len(model.pair_top) > 0),
            (PlanarElasticity, in_plane),
            (Inertia, True),
            (Damping, model.scene.damping.mass > 0.0),
            (Gravity, any(model.scene.gravity)),
            (Loads, model.dead_loads.forces > 0),
            (Followers, model.follower_loads.forces > 0),
            (Moments, model.has_moments),
            (Drag, has_drag),
            (AddedMass, has_added_mass),
        )
        self._of_carriers = [self._barrier] if has_surfaces else []
        if has_surfaces and slides:
            self._of_carriers.append(Friction(model, self.accumulators, self.near))
        self._of_carriers += self._needed(
            (RodBarrier, has_rods),
            (RodFriction, has_rods and slides and law.coefficient > 0.0),
        )

        self._names = [name for term in (*self._of_rods_and_bodies, *self._of_carriers) for name in term.names]

    def _needed(self, *register: tuple[type[Term], bool]) -> list[Term]:
        return [term(self.model, self.accumulators) for term, needed in register if needed]

    @property
    def min_gap(self) -> float:
        """Smallest gap at the last evaluation [m]; infinite without contact. Between rods those below the barrier
        distance count.
        """
        rods = self.matrix.rods.min_gap if self.matrix.rods else math.inf
        return min(self._barrier.min_gap, rods) if self._barrier else rods

    @property
    def energies(self) -> dict[str, float]:
        """Energies of the configuration last evaluated [J], by term; what is lost or supplied over a step is none."""
        terms = (*self._of_rods_and_bodies, *self._of_carriers)
        names = [name for term in terms if term.kind is Kind.CONSERVATIVE for name in term.names]
        return {name: float(self.terms[name]) for name in names}

    def start_step(self, context: StepContext) -> None:
        """Freeze what a step depends on: friction's contacts and drag's directions among it."""
        self.context = context
        for term in (*self._of_rods_and_bodies, *self._of_carriers):
            term.start_step(context)

    def follow(self, at: Configuration) -> bool:
        """Let terms take from a configuration what they hold fixed between moves; false if none does so."""
        return any([term.follow(at) for term in self._of_rods_and_bodies])

    def evaluate(self, at: Configuration, with_hessian: bool) -> float:
        """Potential at a configuration [J]; infinite behind a surface. Gradient always, second derivatives on
        request.
        """
        out = self.accumulators
        out.clear(with_hessian)
        for term in self._of_rods_and_bodies:
            term.add(at, with_hessian)
        if self._of_carriers:
            out.clear_contact()
            for term in self._of_carriers:
                term.add(at, with_hessian)
            out.node += out.carrier[: self.model.node_count]
            out.body += out.contact[self.model.bodies.body_of_free]
        self._expand(at)
        return sum(self.terms.values())

    def one_by_one(self, at: Configuration, only: tuple[str, ...] | None = None) -> Iterator[tuple[Term, str, float]]:
        """Evaluate the terms at a configuration each by itself, those of inertia left out, or `only` those named.

        Yields
        ------
        term, name, energy : Term, str, float
            [J]; meanwhile `accumulators` holds the first derivatives of this term alone, nothing of it handed on to
            unknowns or bodies.
        """
        out = self.accumulators
        for term in (*self._of_rods_and_bodies, *self._of_carriers):
            if term.kind is Kind.INERTIAL:
                continue
            for part in term.parts():
                if only is not None and part.names[0] not in only:
                    continue
                out.clear(False)
                out.clear_contact()
                part.add(at, False)
                yield part, part.names[0], float(self.terms[part.names[0]])

    def take_over(self, energies: dict[str, float], gap: float) -> None:
        """Note energies [J] and the smallest gap [m] that a compiled loop left with the derivatives in these arrays."""
        self.terms.clear()
        self.terms.update({name: energies.get(name, 0.0) for name in self._names})
        if self._barrier:
            self._barrier.min_gap = gap
        if self.matrix.rods:
            self.matrix.rods.min_gap = gap

    def _expand(self, at: Configuration) -> None:
        """From nodes, edges, pairs and bodies to the unknowns."""
        model, layout, out = self.model, self.model.layout, self.accumulators
        expand_gradient(
            model.edge_node,
            layout.node,
            layout.edge,
            model.pair_top,
            model.pair_bottom,
            out.edge,
            out.pair,
            out.node,
            self.gradient,
        )
        hand_gradient_to_bodies(
            layout.attached,
            self._attached_free,
            at.arm,
            self._wall_free,
            at.tangent,
            out.edge,
            model.edge_count,
            self.gradient,
            self.attached_gradient,
            out.body,
        )

    def factorise(self, at: Configuration) -> bool:
        """Factorise the Newton matrix of the last evaluation, that of `at`; false if it cannot be made positive
        definite.
        """
        return self.matrix.factorise(self.diagonal_factor(), at, self.edge_gradient, self.attached_gradient)

    def count_unstable(self, at: Configuration, rate: float) -> int:
        """Number of directions away from a configuration in which disturbances grow faster than `rate` [1/s].

        `at` is that of the last evaluation, made with second derivatives and in a step so long that inertia does not
        count.
        """
        return self.matrix.count_negative(rate**2, at, self.edge_gradient, self.attached_gradient)

    def newton_step(self) -> tuple[Array, Array]:
        """Minus the inverse of the factorised matrix times the present gradient; see `NewtonMatrix.newton_step`."""
        return self.matrix.newton_step(self.gradient, self.body_gradient)

    def held_up(self, at: Configuration, node_step: Array, body_motion: Array, slope: float, bound: float) -> float:
        """Fraction of a Newton step, at most `bound`, at which friction holds it up; see `forces.slip`.

        Parameters
        ----------
        at : Configuration
            That of the last evaluation and of the matrix.
        node_step : Array
            Displacement of nodes [m], shape (n_node, 3); those that bodies hold follow their bodies.
        body_motion : Array
            Displacement [m] and rotation vector [rad] of bodies and of the world, shape (n_body + 1, 6).
        slope : float
            Of the potential along the step [J].
        bound : float
        """
        ways = [term.slip_along(at, node_step, body_motion) for term in self._of_carriers]
        if sum(map(len, ways)) == 0:
            return bound
        way = np.concatenate(ways)
        return held_up(len(way), way, self.model.scene.contact.friction.speed_threshold, slope, float(bound))

    def diagonal_factor(self) -> float:
        """Factor of the mass matrix in the Hessian: that of inertia and α/(γ h) of damping [1/s²]."""
        return self.context.inertia_factor + self.model.scene.damping.mass / self.context.length
