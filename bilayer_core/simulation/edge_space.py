"""Displacements and velocities in edge space: what forces must be multiplied with to give works and powers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bilayer_core.kinematics.rotation import rotation_vector
from bilayer_core.model.model import Model
from bilayer_core.model.records.problem import Sums
from bilayer_core.model.records.step import Configuration
from bilayer_core.model.state import State

Array = np.ndarray
PARTS = ("node", "edge", "pair", "body", "contact")


@dataclass(frozen=True)
class EdgeVector:
    """Displacement [m, rad] or velocity [m/s, rad/s] of everything that a force may differentiate by, or its first
    derivatives by all that: shapes as in `model.records.problem.Sums`.
    """

    node: Array
    edge: Array
    pair: Array
    body: Array
    contact: Array

    def work(self, gradient: EdgeVector) -> float:
        """Return the work [J] of forces with a gradient over this displacement; power [W] if it is a velocity."""
        return -sum(float(np.vdot(getattr(gradient, part), getattr(self, part))) for part in PARTS)


def gradient_of(first: Sums, model: Model) -> EdgeVector:
    """Return a copy of the present first derivatives, with zeros in rows of `contact` of free bodies: theirs are in
    `body`.
    """
    found = EdgeVector(*(getattr(first, part).copy() for part in PARTS))
    found.contact[model.free_bodies.body_of_free] = 0.0
    return found


def compose(model: Model, node: Array, turn: Array, clamp_edge: Array, contact: Array) -> EdgeVector:
    """Return a motion from that of nodes, of edges about their tangents (n_edge,), of clamp edges (·, 4), of bodies."""
    i = model.rods.edge_node
    edge = np.concatenate([np.column_stack([node[i + 1] - node[i], turn]), clamp_edge])
    top0, top1, bottom0, bottom1 = (node[of_pairs] for of_pairs in model.bonds.node.reshape(-1, 4).T)
    body = contact[model.free_bodies.body_of_free]
    return EdgeVector(node, edge, 0.5 * (top0 + top1 - bottom0 - bottom1), body, contact)


def displacement(model: Model, start: Configuration, end: Configuration) -> EdgeVector:
    """Return the motion from one configuration to another; turns, each by less than half a turn, are those beyond
    parallel transport.
    """
    edges = model.rods.edge_count
    turn = turn_between(start.tangent, start.director1, end.tangent, end.director1)
    clamp_edge = np.column_stack([end.tangent[edges:] - start.tangent[edges:], turn[edges:]])
    contact = np.hstack([end.pose_position - start.pose_position, np.zeros_like(end.pose_position)])
    for b in range(len(model.bodies.names)):
        contact[b, 3:] = rotation_vector(end.rotation[b] @ start.rotation[b].T)
    return compose(model, end.position - start.position, turn[:edges], clamp_edge, contact)


def velocity(model: Model, at: Configuration, state: State) -> EdgeVector:
    """Return the velocities of a state whose configuration is `at`."""
    world = np.zeros((1, 6))
    contact = np.concatenate([np.hstack([state.body_velocity, state.body_angular_velocity]), world])
    tangent = at.tangent[model.rods.edge_count :]
    spin = contact[model.constrained.clamp_edge_body, 3:]
    clamp_edge = np.column_stack([np.cross(spin, tangent), np.einsum("ki,ki->k", spin, tangent)])
    return compose(model, state.velocity, state.spin, clamp_edge, contact)


def of_prescribed(model: Model, motion: EdgeVector) -> EdgeVector:
    """Return the part of a motion that prescribed bodies impose on held nodes, clamps' directions, points, surfaces."""
    prescribed = model.free_bodies.free_index < 0
    held = np.zeros(model.node_count, dtype=bool)
    held[model.constrained.node] = model.constrained.free < 0
    clamp_edges = motion.edge[model.rods.edge_count :]
    return compose(
        model,
        np.where(held[:, None], motion.node, 0.0),
        np.zeros(model.rods.edge_count),
        np.where(prescribed[model.constrained.clamp_edge_body, None], clamp_edges, 0.0),
        np.where(prescribed[:, None], motion.contact, 0.0),
    )


def turn_between(tangent: Array, director: Array, new_tangent: Array, new_director: Array) -> Array:
    """Return the angle about the new tangent from the transported director to the new one [rad], shape (n,)."""

    def dot(u: Array, v: Array) -> Array:
        return np.einsum("ki,ki->k", u, v)

    factor = dot(director, new_tangent) / (1.0 + dot(tangent, new_tangent))
    carried = director - factor[:, None] * (tangent + new_tangent)
    return np.arctan2(dot(np.cross(carried, new_director), new_tangent), dot(carried, new_director))
