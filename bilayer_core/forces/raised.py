"""Masses, loads and fluids off the curve of a laminate: at the mass centre, on the path, at mid-section.

The curve of a laminate lies on the neutral axis, where stretching and bending part. A half edge whose mass m lies z
over it carries that mass at y = x + z m1, with the node's position x and the edge's material director m1. Only edges
with something off the curve are *raised* and have this element. With the velocity ẇ of w = m1,

    ½ m |ẏ|² = ½ m |ẋ|² + m z ẋ·ẇ + ½ m z² |ẇ|²

of which nodes have the first part. With a and b, m z of the two halves of an edge, and c, the sum of their m z²,

    T = (a ẋ₀ + b ẋ₁)·ẇ + ½ c |ẇ|².

ẇ holds the turns about the tangent, too, so that the inertia J of edges is that about the mass centre (Steiner).

Over a stage w is a vector like a position: it has an origin and a velocity of its own, which advance as those of
positions do, and inertia prefers w̃ = w̄ + γh ẇ̄. With the departures d of nodes from where inertia takes them and
D = w − w̃, inertia, mass damping and gravity are

    [(a d₀ + b d₁)·D + ½ c |D|²]/(γγ′h²),   α [(a u₀ + b u₁)·U + ½ c |U|²]/(γh),   −(a + b) g·w

with motions u and U = w − w̄ from the origin. So a stage is solved for the momenta of x and of w together, the momentum
of a free strip stays what it was, and integrators keep their order: with ẇ taken from velocities of nodes and spins
instead, they would lose both. A unit vector stays one only to the order of the step. Therefore the angular momentum of
unlike layers, unlike that of alike ones, is not conserved exactly by the implicit midpoint rule.

Every force that acts off the curve adds its derivative by w, as if that were free, to the edge's *pull* g. An increment
(ε, θ) of the edge vector and of its angle moves w = m1 as in `forces.rod_arms`: with t, m2 = t × m1 and the length l

    ∂w/∂ε = −t wᵀ/l,   ∂w/∂θ = m2
    ∂²(g·w)/∂ε² = [(g·t)(w tᵀ + t wᵀ) − ½ (w g⊥ᵀ + g⊥ wᵀ)]/l²,   ∂²/∂ε∂θ = −(g·t) m2/l,   ∂²/∂θ² = −g·w

`engine.linear.raised_blocks` joins these, and second derivatives by x and w, to the unknowns.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.vector import add_row, combine, dot, row
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Raised
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

INERTIA, DAMPING, GRAVITY = map(slot_of, ("inertia", "damping", "gravity"))


@kernel
def measure_directors(raised, at, strain_out):
    """Write m1 of raised edges, each as three of the strains."""
    for r in range(raised.edge.shape[0]):
        for c in range(3):
            strain_out[raised.first + 3 * raised.slot[r] + c] = at.director1[raised.edge[r], c]


@kernel
def predict_directors(raised, origin, length, predicted_out):
    """Write where inertia takes m1 of raised edges from the origin of a stage."""
    for r in range(raised.edge.shape[0]):
        for c in range(3):
            k = raised.first + 3 * raised.slot[r] + c
            predicted_out[r, c] = origin.strain[k] + length * origin.strain_rate[k]


@kernel
def copy_directors(raised, at, out):
    """Write m1 of raised edges."""
    for r in range(raised.edge.shape[0]):
        for c in range(3):
            out[r, c] = at.director1[raised.edge[r], c]


@kernel
def director_moved(raised, at, stage, r, c):
    """Return a component of the motion of a raised edge's m1 from the origin of a stage."""
    return at.director1[raised.edge[r], c] - stage.origin_strain[raised.first + 3 * raised.slot[r] + c]


@kernel
def director_motion(raised, at, stage, r):
    """Return the motion of a raised edge's m1 from the origin of a stage, as a tuple."""
    return (
        director_moved(raised, at, stage, r, 0),
        director_moved(raised, at, stage, r, 1),
        director_moved(raised, at, stage, r, 2),
    )


@kernel
def _quadratic(raised, r, u0, u1, director):
    """Return (a u₀ + b u₁)·U + ½ c |U|² with motions u of nodes and U of m1, and its derivative by U."""
    along = combine(raised.first_moment[r, 0], u0, raised.first_moment[r, 1], u1)
    second = raised.second_moment[r]
    return dot(director, combine(1.0, along, 0.5 * second, director)), combine(1.0, along, second, director)


@kernel
def _add_quadratic(raised, r, i, factor, u0, u1, director, sums):
    """Add the derivatives of `_quadratic` times a factor, and return its value [J]."""
    a, b = factor * raised.first_moment[r, 0], factor * raised.first_moment[r, 1]
    value, slope = _quadratic(raised, r, u0, u1, director)
    add_row(sums.node, i, a, director)
    add_row(sums.node, i + 1, b, director)
    add_row(sums.pull, r, factor, slope)
    return factor * value


@kernel
def inertia_off_curve(raised, strands, at, stage):
    """Return the potential of inertia of raised masses beyond that of nodes and spins, times γγ′h² [kg m²]."""
    energy = 0.0
    for r in range(raised.edge.shape[0]):
        k = raised.edge[r]
        i, ahead = strands.edge_node[k], combine(1.0, row(at.director1, k), -1.0, row(stage.predicted_director, r))
        energy += _quadratic(raised, r, row(at.departure, i), row(at.departure, i + 1), ahead)[0]
    return energy


@kernel
def _add_inertia(raised, strands, factor, at, stage, sums):
    """Add the inertia of raised masses beyond that of nodes and spins, and return it [J]."""
    energy = 0.0
    for r in range(raised.edge.shape[0]):
        k = raised.edge[r]
        i, ahead = strands.edge_node[k], combine(1.0, row(at.director1, k), -1.0, row(stage.predicted_director, r))
        energy += _add_quadratic(raised, r, i, factor, row(at.departure, i), row(at.departure, i + 1), ahead, sums)
    return energy


@kernel
def _add_damping(raised, strands, factor, at, stage, sums):
    """Add the mass damping of raised masses beyond that of nodes and spins, and return it [J]."""
    energy, x, origin = 0.0, at.position, stage.origin_position
    for r in range(raised.edge.shape[0]):
        i, turned = strands.edge_node[raised.edge[r]], director_motion(raised, at, stage, r)
        u0 = combine(1.0, row(x, i), -1.0, row(origin, i))
        u1 = combine(1.0, row(x, i + 1), -1.0, row(origin, i + 1))
        energy += _add_quadratic(raised, r, i, factor, u0, u1, turned, sums)
    return energy


@kernel
def _add_weight(raised, gravity, at, pull_out):
    """Add −(a + b) g·w of raised masses and return it [J]."""
    energy = 0.0
    for r in range(raised.edge.shape[0]):
        moment = raised.first_moment[r, 0] + raised.first_moment[r, 1]
        weight = moment * gravity[0], moment * gravity[1], moment * gravity[2]
        add_row(pull_out, r, -1.0, weight)
        energy -= dot(weight, row(at.director1, raised.edge[r]))
    return energy


@piece(float, Raised, Problem, Configuration, Stage, bool)
def add_raised_masses(raised, p, at, stage, with_hessian):
    """Add what inertia, mass damping and gravity of raised masses have beyond those of nodes, with its gradients."""
    strands, sums, h, g = p.strands, p.sums, stage.length, p.gravity
    if sums.selected[INERTIA]:
        factor = 1.0 / (h * stage.momentum_length)
        sums.energy[INERTIA] += _add_inertia(raised, strands, factor, at, stage, sums)
    if p.damping > 0.0 and sums.selected[DAMPING]:
        energy = _add_damping(raised, strands, p.damping / h, at, stage, sums)
        sums.energy[DAMPING] += energy
        sums.lost[DAMPING] += 2.0 * energy / h
    if (g[0] != 0.0 or g[1] != 0.0 or g[2] != 0.0) and sums.selected[GRAVITY]:
        sums.energy[GRAVITY] += _add_weight(raised, g, at, sums.pull)
    return math.inf


@kernel
def kinetic_energy_off_curve(raised, strands, velocity, rate):
    """Return T of raised masses beyond that of nodes and spins [J], ẇ being among the rates of strains."""
    energy = 0.0
    for r in range(raised.edge.shape[0]):
        i, k = strands.edge_node[raised.edge[r]], raised.first + 3 * raised.slot[r]
        a, b, second = raised.first_moment[r, 0], raised.first_moment[r, 1], raised.second_moment[r]
        for c in range(3):
            energy += rate[k + c] * (a * velocity[i, c] + b * velocity[i + 1, c] + 0.5 * second * rate[k + c])
    return energy


@kernel
def pull_edges(raised, at, sums):
    """Add the pulls of raised edges to their vectors and angles."""
    for r in range(raised.edge.shape[0]):
        k, g = raised.edge[r], row(sums.pull, r)
        along = dot(g, row(at.tangent, k)) / at.length[k]
        for c in range(3):
            sums.edge[k, c] -= along * at.director1[k, c]
        sums.edge[k, 3] += dot(g, row(at.director2, k))
