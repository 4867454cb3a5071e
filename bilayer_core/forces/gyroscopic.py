"""Gyroscopic force of edges that turn about their tangents.

An edge with the moment of inertia J about its tangent t and the spin ω has the angular momentum J ω t. While its
tangent turns at the rate ṫ, that needs the moment J ω ṫ, which the ends of the edge supply. With the edge vector e of
length l, the inertia of the edge pushes it by

    F = J ω (t × ṫ)/l = J ω (t × ė)/l²,    e × F = −J ω ṫ,    F·ė = 0:

it does no work. Without it, a free strip that spins about its axis while that turns does not keep its angular
momentum: ω is the rate of the edge's angle against a frame that parallel transport carries in time, and the potential
of `forces.inertia` knows nothing of how t turns.

Over a stage of length h, ω = (θ − θ̄)/h and ė = (e − ē)/h. F is no gradient. It is held at the configuration to which
Newton's method moved last, as −F·(e − ē), so the step ends with the force at its end. Nothing is evaluated anew for
that: where F is taken, F·(e − ē) = 0, and the gradient changes by what F does. What that leaves out of the Hessian is
antisymmetric, and small beside the inertia of nodes: ω h (w/l)²/6 of it at the width w, less where the strip resists
bending within h.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Matrix
from bilayer_core.kinematics.vector import add_row, combine, cross, dot, row, scaled
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.model import Model
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import AT_REST, Configuration, Stage

GYROSCOPIC = slot_of("gyroscopic")


@record
class Spinning:
    """Forces of edges that spin."""

    force: Matrix  # F [N], shape (n_edge, 3)


@kernel
def _lengthening(strands, at, stage, k):
    """Return by how much an edge vector differs from that at the origin of a stage [m], as a tuple."""
    i, x, origin = strands.edge_node[k], at.position, stage.origin_position
    after = combine(1.0, row(x, i + 1), -1.0, row(origin, i + 1))
    return combine(1.0, after, -1.0, combine(1.0, row(x, i), -1.0, row(origin, i)))


@kernel
def _force(strands, at, stage, k):
    """Return F of an edge [N], as a tuple."""
    if stage.still[0] == AT_REST:
        return 0.0, 0.0, 0.0
    h, length = stage.length, at.length[k]
    factor = strands.spin_inertia[k] * (at.total_angle[k] - stage.origin_angle[k]) / (h * h * length * length)
    return scaled(factor, cross(row(at.tangent, k), _lengthening(strands, at, stage, k)))


@piece(float, Spinning, Problem, Configuration, Stage, bool)
def add_gyroscopic_force(spinning, p, at, stage, with_hessian):
    """Add −F·(e − ē) of edges and its derivatives by their vectors."""
    sums, force, energy = p.sums, spinning.force, 0.0
    if not sums.selected[GYROSCOPIC]:
        return math.inf
    for k in range(force.shape[0]):
        energy -= dot(row(force, k), _lengthening(p.strands, at, stage, k))
        add_row(sums.edge, k, -1.0, row(force, k))
    sums.energy[GYROSCOPIC] = energy
    return math.inf


@piece(bool, Spinning, Problem, Configuration, Stage)
def update_gyroscopic_force(spinning, p, at, stage):
    """Take F from a configuration; energy and gradient of the last evaluation, if there, become those with F."""
    strands, sums, force = p.strands, p.sums, spinning.force
    for k in range(force.shape[0]):
        present, i = _force(strands, at, stage, k), strands.edge_node[k]
        first, second = strands.node_unknown[i], strands.node_unknown[i + 1]
        for c in range(3):
            change = present[c] - force[k, c]
            force[k, c] = present[c]
            sums.edge[k, c] -= change
            sums.gradient[first + c] += change
            sums.gradient[second + c] -= change
    _hand_on_to_bodies(p.constrained, at, sums)
    sums.energy[GYROSCOPIC] = 0.0
    return False


@kernel
def _hand_on_to_bodies(constrained, at, sums):
    """Move what was added to the gradient of held nodes, which have none, to what holds them."""
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        g = sums.gradient[a], sums.gradient[a + 1], sums.gradient[a + 2]
        moment = cross(row(at.arm, k), g)
        add_row(sums.attached, k, 1.0, g)
        for c in range(3):
            sums.gradient[a + c] = 0.0
            if f >= 0:
                sums.body[f, c] += g[c]
                sums.body[f, 3 + c] += moment[c]


def spinning_of(model: Model) -> Spinning:
    """Return the edges of a model that may spin."""
    return Spinning(force=np.zeros((model.rods.edge_count, 3)))
