"""What all terms have in common, the data that a step freezes for them, and the arrays to which they add."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from ...forces.slip import WAY
from ...model.force_list import Kind
from ...model.model import Model
from ...model.rest_strains import RestStrains
from ..configuration import Configuration
from ..newton_matrix import NewtonMatrix, zeros_in_one
from ..planar_matrix import PlanarMatrix

Array = np.ndarray


@dataclass(frozen=True)
class StepContext:
    """What is frozen over a stage of a step: it reads as an implicit Euler step from an origin (`integrate.method`).

    The velocity of whatever is at q is (q − origin)/length.

    Attributes
    ----------
    length : float
        γ h [s].
    start : Configuration
        From which Newton begins, where frames were last re-based, and where contacts for friction are looked up.
    origin_position : Array
        Of nodes [m], shape (n_node, 3).
    origin_turn : Array
        Of edges, counted from `start` [rad], shape (n_edge,).
    origin_body_position, origin_body_rotation : Array
        Of free bodies, shapes (n_free, 3), (n_free, 3, 3); R̄ is no rotation but the matrix with dR/dt = (R − R̄)/length.
    origin_place, origin_rotation : Array
        Likewise of all bodies and last of the world, shapes (n_body + 1, 3), (n_body + 1, 3, 3).
    origin_fluid_momentum : Array
        P̄ of the fluid at nodes [N s], shape (n_node, 3); (0, 3) without added mass.
    predicted_position : Array
        x̃ of nodes [m], shape (n_node, 3).
    predicted_turn : Array
        Turn of edges that inertia prefers, counted from `start` [rad], shape (n_edge,).
    predicted_body_position, predicted_body_rotation : Array
        X̃ [m] and R̃ of free bodies, shapes (n_free, 3), (n_free, 3, 3).
    rest : RestStrains
        At the time of the stage.
    load_factor : Array
        Factor of each load of the scene there, shape (n_load,).
    length_of_momenta : float or None
        γ′ h [s], where p = p̄ + γ′ h × force for momenta; None if it is γ h.
    """

    length: float
    start: Configuration
    origin_position: Array
    origin_turn: Array
    origin_body_position: Array
    origin_body_rotation: Array
    origin_place: Array
    origin_rotation: Array
    origin_fluid_momentum: Array
    predicted_position: Array
    predicted_turn: Array
    predicted_body_position: Array
    predicted_body_rotation: Array
    rest: RestStrains
    load_factor: Array
    length_of_momenta: float | None = None

    @property
    def momentum_length(self) -> float:
        """γ′ h [s]."""
        return self.length_of_momenta or self.length

    @property
    def inertia_factor(self) -> float:
        """Factor of the mass in the Hessian: 1/(γ γ′ h²) [1/s²]."""
        return 1.0 / (self.length * self.momentum_length)


class Accumulators:
    """First and second derivatives to which terms add, and their energies.

    Attributes
    ----------
    energy : dict of str to float
        Of each term [J], in the order of the register.
    node, edge, pair, body : Array
        ∂/∂x of nodes [N], shape (n_node, 3); ∂/∂(e, θ) of edges and walls, shape (n_edge + n_wall, 4); ∂/∂p of paired
        edges, shape (n_pair, 3); ∂/∂(X, φ) of free bodies, shape (n_free, 6).
    carrier, contact : Array
        Of contact alone: ∂/∂x of carriers [N], shape (n_carrier, 3), of which nodes take theirs; ∂/∂(X, φ) of all
        bodies and of the world, shape (n_body + 1, 6), of which free bodies take theirs.
    matrix : NewtonMatrix
        Second derivatives.
    """

    def __init__(self, model: Model, has_node_blocks: bool):
        edges = model.edge_count + model.wall_count
        shapes = {
            "node": (model.node_count, 3),
            "edge": (edges, 4),
            "pair": (len(model.pair_top), 3),
            "body": (model.free_count, 6),
        }
        self.all_but_carriers, parts = zeros_in_one(shapes)
        self.node, self.edge, self.pair, self.body = parts
        self.carrier = np.zeros((len(model.carriers.weight), 3))
        self.energy: dict[str, float] = {}
        self.contact = np.zeros((len(model.bodies.names) + 1, 6))
        self.matrix = (NewtonMatrix if model.plane is None else PlanarMatrix)(model, has_node_blocks)

    def clear(self, with_hessian: bool) -> None:
        """Forget energies and first derivatives, those of contact apart, and second ones on request."""
        self.energy.clear()
        self.all_but_carriers.fill(0.0)
        if with_hessian:
            self.matrix.clear()

    def clear_contact(self) -> None:
        """Forget the first derivatives of contact."""
        self.carrier.fill(0.0)
        self.contact.fill(0.0)


class Term(ABC):
    """One line of the register: a summand of the potential, or several that a kernel computes together.

    Attributes
    ----------
    names : tuple of str
        Under which its energies are known.
    kind : Kind
    """

    names: tuple[str, ...] = ()
    kind = Kind.CONSERVATIVE

    def __init__(self, model: Model, out: Accumulators):
        self.model = model
        self.out = out
        self.context: StepContext | None = None

    def start_step(self, context: StepContext) -> None:
        """Freeze what a step depends on."""
        self.context = context

    def follow(self, at: Configuration) -> bool:
        """Take from the configuration that Newton moved to what is held fixed until the next move; false if nothing."""
        return False

    def slip_along(self, at: Configuration, node_step: Array, body_motion: Array) -> Array:
        """Way of every contact that slides against friction, along a step from `at`, where the last evaluation was; see
        `forces.slip`.

        Parameters
        ----------
        at : Configuration
        node_step : Array
            Displacement of nodes [m], shape (n_node, 3).
        body_motion : Array
            Displacement [m] and rotation vector [rad] of bodies and of the world, shape (n_body + 1, 6).
        """
        return np.empty((0, WAY))

    @abstractmethod
    def add(self, at: Configuration, with_hessian: bool) -> None:
        """Add the derivatives at a configuration to `out`, and write the energy [J] there under each of `names`."""

    def parts(self) -> tuple[Term, ...]:
        """Terms of one name each that have this one as their sum."""
        return (self,)
