"""Forces and moments from outside. Those that turn take their directions from where Newton moved last."""

from __future__ import annotations

import numpy as np

from ...forces.drag import node_directions
from ...forces.load import body_moment, point_force
from ...model.layout import columns
from ...model.model import Model, PointLoads
from ..configuration import Configuration
from .term import Accumulators, Kind, StepContext, Term

Array = np.ndarray


class Loads(Term):
    """Forces of fixed direction on nodes and free bodies."""

    names = ("loads",)
    kind = Kind.EXTERNAL

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._shares = self._of(model)
        self._on_nodes = np.zeros((len(self._shares.nodes.target), 3))
        self._on_bodies = np.zeros((len(self._shares.bodies.target), 3))

    def _of(self, model: Model) -> PointLoads:
        return model.dead_loads

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self._on_nodes[:] = self._shares.nodes.scaled(context.load_factor)
        self._on_bodies[:] = self._shares.bodies.scaled(context.load_factor)

    def add(self, at: Configuration, with_hessian: bool) -> None:
        out, shares = self.out, self._shares
        energy = point_force(shares.nodes.target, self._on_nodes, at.position, out.node)
        energy += point_force(shares.bodies.target, self._on_bodies, at.body_position, out.body)
        out.energy[self.names[0]] = energy


class Followers(Loads):
    """Forces that turn with the rod or the body on which they act."""

    names = ("followers",)

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._edges = columns(model.carriers.node_edges[self._shares.nodes.target])
        self._direction = np.zeros((len(self._on_nodes), 3, 3))

    def _of(self, model: Model) -> PointLoads:
        return model.follower_loads

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self.follow(context.start)

    def follow(self, at: Configuration) -> bool:
        factor, shares = self.context.load_factor, self._shares
        node_directions(shares.nodes.target, *self._edges, at.tangent, at.director1, self._direction)
        self._on_nodes[:] = np.einsum("kac,ka->kc", self._direction, shares.nodes.scaled(factor))
        self._on_bodies[:] = _turned(at, shares.bodies.target, shares.bodies.scaled(factor))
        return True


class Moments(Term):
    """Moments on free bodies, of fixed direction or turning with the body."""

    names = ("moments",)
    kind = Kind.EXTERNAL

    def __init__(self, model: Model, out: Accumulators):
        super().__init__(model, out)
        self._dead, self._following = model.dead_loads.moments, model.follower_loads.moments
        self._body = np.concatenate([self._dead.target, self._following.target])
        self._moment = np.zeros((len(self._body), 3))

    def start_step(self, context: StepContext) -> None:
        super().start_step(context)
        self._moment[: len(self._dead.target)] = self._dead.scaled(context.load_factor)
        self.follow(context.start)

    def follow(self, at: Configuration) -> bool:
        following = self._following.scaled(self.context.load_factor)
        self._moment[len(self._dead.target) :] = _turned(at, self._following.target, following)
        return len(self._following.target) > 0

    def add(self, at: Configuration, with_hessian: bool) -> None:
        out = self.out
        out.energy["moments"] = body_moment(
            self._body,
            self._moment,
            at.body_rotation,
            self.context.predicted_body_rotation,
            out.body,
            out.matrix.body_hessian,
            with_hessian,
        )


def _turned(at: Configuration, body: Array, vector: Array) -> Array:
    """Vectors in the axes of free bodies as vectors in the world, shape (n, 3)."""
    return np.einsum("kij,kj->ki", at.body_rotation[body], vector)
