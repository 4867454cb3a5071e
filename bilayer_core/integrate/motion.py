"""Displacements and velocities in edge space: what forces must be multiplied with to give works and powers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics.rotation import rotation_matrix, rotation_vector
from ..model.model import Model
from ..model.state import State
from ..solve.configuration import Configuration
from ..solve.terms.term import Accumulators, StepContext

Array = np.ndarray
PARTS = ("node", "edge", "pair", "body", "carrier")
MOMENT = 1e-6
"""Time over which potentials see a velocity as a displacement [s]; rounding makes 1e-10 m/s of it."""


@dataclass(frozen=True)
class Gradient:
    """First derivatives of one term, copied from `Accumulators`: shapes as there."""

    node: Array
    edge: Array
    pair: Array
    body: Array
    carrier: Array

    @classmethod
    def copy_of(cls, out: Accumulators) -> Gradient:
        """The present first derivatives."""
        return cls(*(getattr(out, part).copy() for part in PARTS))


@dataclass(frozen=True)
class Motion:
    """Displacement [m, rad] or velocity [m/s, rad/s] of everything that a term may differentiate by.

    Parts and shapes are those of `Accumulators`; `node` and the first rows of `carrier` are the same vectors, because a
    term adds to one of them.
    """

    node: Array
    edge: Array
    pair: Array
    body: Array
    carrier: Array

    def work(self, gradient: Gradient | Accumulators) -> float:
        """Work [J] of forces with the given gradient over this displacement; power [W] if it is a velocity."""
        return -sum(float(np.vdot(getattr(gradient, part), getattr(self, part))) for part in PARTS)


def compose(model: Model, carrier: Array, turn: Array, wall: Array, body: Array) -> Motion:
    """A motion from that of carriers, of edges about their tangents (n_edge,), of walls (n_wall, 4), of bodies."""
    node, i = carrier[: model.node_count], model.edge_node
    edge = np.concatenate([np.column_stack([node[i + 1] - node[i], turn]), wall])
    middle = 0.5 * (node[i] + node[i + 1])
    return Motion(node, edge, middle[model.pair_top] - middle[model.pair_bottom], body, carrier)


def displacement(model: Model, start: Configuration, end: Configuration) -> Motion:
    """From one configuration to another; turns, each by less than half a turn, are those beyond parallel transport."""
    edges = model.edge_count
    turn = _turn(start.tangent, start.director1, end.tangent, end.director1)
    wall = np.column_stack([end.tangent[edges:] - start.tangent[edges:], turn[edges:]])
    body = np.zeros((model.free_count, 6))
    body[:, :3] = end.body_position - start.body_position
    for b in range(model.free_count):
        body[b, 3:] = rotation_vector(end.body_rotation[b] @ start.body_rotation[b].T)
    return compose(model, end.carrier - start.carrier, turn[:edges], wall, body)


def velocity(model: Model, at: Configuration, state: State) -> Motion:
    """Velocities of a state whose configuration is `at`."""
    bodies, carriers = model.bodies, model.carriers
    carrier = np.zeros_like(at.carrier)
    carrier[: model.node_count] = state.velocity
    first_sphere = model.node_count + model.point_count
    arms = np.einsum("kij,kj->ki", state.body_rotation[carriers.point_body], carriers.point_position)
    carrier[model.node_count : first_sphere] = state.body_velocity[carriers.point_body]
    carrier[model.node_count : first_sphere] += np.cross(state.body_angular_velocity[carriers.point_body], arms)
    carrier[first_sphere:] = state.body_velocity[carriers.sphere_body]
    body = np.hstack([state.body_velocity[bodies.body_of_free], state.body_angular_velocity[bodies.body_of_free]])
    tangent = at.tangent[model.edge_count :]
    spin = np.where((model.wall_free >= 0)[:, None], state.body_angular_velocity[model.wall_body], 0.0)
    wall = np.column_stack([np.cross(spin, tangent), np.einsum("ki,ki->k", spin, tangent)])
    return compose(model, carrier, state.spin, wall, body)


def momentary_context(
    model: Model, at: Configuration, state: State, eigenstrain: Array, load_factor: Array
) -> StepContext:
    """A step so short that nothing changes in it but what moves: forces at a state, with its velocities.

    Inertia is at rest in it: it has nothing to ask for.
    """
    moving = velocity(model, at, state)
    rotation = np.empty_like(at.body_rotation)
    for b in range(model.free_count):
        rotation[b] = rotation_matrix(-MOMENT * moving.body[b, 3:]) @ at.body_rotation[b]
    return StepContext(
        length=MOMENT,
        start=at,
        origin_carrier=at.carrier - MOMENT * moving.carrier,
        origin_turn=at.turn - MOMENT * state.spin,
        origin_body_position=at.body_position - MOMENT * moving.body[:, :3],
        origin_body_rotation=rotation,
        origin_fluid_momentum=np.zeros((model.node_count if len(model.fluid_mass) else 0, 3)),
        predicted_position=at.position,
        predicted_turn=at.turn,
        predicted_body_position=at.body_position,
        predicted_body_rotation=at.body_rotation,
        eigenstrain=eigenstrain,
        load_factor=load_factor,
    )


def of_prescribed(model: Model, motion: Motion) -> Motion:
    """The part of a motion that prescribed bodies impose: held nodes, contact points and spheres. They do not turn."""
    free = model.bodies.free_index
    imposed = np.zeros(len(motion.carrier), dtype=bool)
    imposed[model.attached_node[model.attached_free < 0]] = True
    carrying = np.concatenate([model.carriers.point_body, model.carriers.sphere_body])
    imposed[model.node_count :] = free[carrying] < 0
    carrier = np.where(imposed[:, None], motion.carrier, 0.0)
    return compose(
        model, carrier, np.zeros(model.edge_count), np.zeros((model.wall_count, 4)), np.zeros_like(motion.body)
    )


def _turn(tangent: Array, director: Array, new_tangent: Array, new_director: Array) -> Array:
    """Angle about the new tangent from the transported director to the new one [rad], shape (n,)."""

    def dot(u: Array, v: Array) -> Array:
        return np.einsum("ki,ki->k", u, v)

    factor = dot(director, new_tangent) / (1.0 + dot(tangent, new_tangent))
    carried = director - factor[:, None] * (tangent + new_tangent)
    return np.arctan2(dot(np.cross(carried, new_director), new_tangent), dot(carried, new_director))
