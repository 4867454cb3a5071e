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
from bilayer_core.jit.called import flat, stack_vector
from bilayer_core.kinematics.vector import POSITIVE
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import TOGETHER, Raised
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

INERTIA, DAMPING, GRAVITY = map(slot_of, ("inertia", "damping", "gravity"))
OF_EDGES, OF_NODES = 3 * TOGETHER, 3 * TOGETHER + 3
"""Components of the edges of a block at most, and of their nodes."""


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
def _quadratic(raised, r, count, u, turned, slope_out):
    """Return Σ (a u₀ + b u₁)·U + ½ c |U|² of a block with motions u of nodes and U of m1, and write its derivatives by
    U; all by components.
    """
    a, b, c = flat(raised.by_component[0]), flat(raised.by_component[1]), flat(raised.by_component[2])
    a, b, c, value = a[3 * r : 3 * (r + count)], b[3 * r : 3 * (r + count)], c[3 * r : 3 * (r + count)], 0.0
    for n in range(3 * count):
        along = a[n] * u[n] + b[n] * u[n + 3]
        slope_out[n] = along + c[n] * turned[n]
        value += (along + slope_out[n]) * turned[n]
    return 0.5 * value


@kernel
def _add_quadratic(raised, r, i, count, factor, u, turned, sums):
    """Add the derivatives of `_quadratic` times a factor, and return its value [J]."""
    slope = stack_vector(OF_EDGES)
    value = _quadratic(raised, r, count, u, turned, slope)
    pull = flat(sums.pull[r : r + count])
    for n in range(3 * count):
        pull[n] += factor * slope[n]
    for half in range(2):
        moment, gradient = flat(raised.by_component[half]), flat(sums.node[i + half : i + half + count])
        moment = moment[3 * r : 3 * (r + count)]
        for n in range(3 * count):
            gradient[n] += factor * moment[n] * turned[n]
    return factor * value


@kernel
def _of_block(raised, b):
    """Return the first of a block of raised edges, its edge and node, and how many edges there are."""
    block = raised.block
    return block[b, 0] & POSITIVE, block[b, 1] & POSITIVE, block[b, 2] & POSITIVE, block[b, 4] & POSITIVE


@kernel
def _directors_ahead(at, stage, r, k, count, out):
    """Write D of a block."""
    now, predicted = flat(at.director1[k : k + count]), flat(stage.predicted_director[r : r + count])
    for n in range(3 * count):
        out[n] = now[n] - predicted[n]


@kernel
def inertia_off_curve(raised, at, stage):
    """Return the potential of inertia of raised masses beyond that of nodes and spins, times γγ′h² [kg m²]."""
    energy, ahead, slope = 0.0, stack_vector(OF_EDGES), stack_vector(OF_EDGES)
    for b in range(raised.block.shape[0]):
        r, k, i, count = _of_block(raised, b)
        _directors_ahead(at, stage, r, k, count, ahead)
        energy += _quadratic(raised, r, count, flat(at.departure[i : i + count + 1]), ahead, slope)
    return energy


@kernel
def _add_inertia(raised, factor, at, stage, sums):
    """Add the inertia of raised masses beyond that of nodes and spins, and return it [J]."""
    energy, ahead = 0.0, stack_vector(OF_EDGES)
    for b in range(raised.block.shape[0]):
        r, k, i, count = _of_block(raised, b)
        _directors_ahead(at, stage, r, k, count, ahead)
        energy += _add_quadratic(raised, r, i, count, factor, flat(at.departure[i : i + count + 1]), ahead, sums)
    return energy


@kernel
def _add_damping(raised, factor, at, stage, sums):
    """Add the mass damping of raised masses beyond that of nodes and spins, and return it [J]."""
    energy, moved, turned = 0.0, stack_vector(OF_NODES), stack_vector(OF_EDGES)
    for b in range(raised.block.shape[0]):
        r, k, i, count = _of_block(raised, b)
        x, origin = flat(at.position[i : i + count + 1]), flat(stage.origin_position[i : i + count + 1])
        for n in range(3 * count + 3):
            moved[n] = x[n] - origin[n]
        now, first = flat(at.director1[k : k + count]), raised.first + 3 * raised.block[b, 3]
        before = stage.origin_strain[first : first + 3 * count]
        for n in range(3 * count):
            turned[n] = now[n] - before[n]
        energy += _add_quadratic(raised, r, i, count, factor, moved, turned, sums)
    return energy


@kernel
def _add_weight(raised, gravity, at, pull_out):
    """Add −(a + b) g·w of raised masses and return it [J]."""
    energy, g0, g1, g2 = 0.0, gravity[0], gravity[1], gravity[2]
    for b in range(raised.block.shape[0]):
        r, k, _, count = _of_block(raised, b)
        moment, m1, pull = (
            raised.first_moment[r : r + count],
            flat(at.director1[k : k + count]),
            flat(pull_out[r : r + count]),
        )
        for n in range(count):
            m = moment[n, 0] + moment[n, 1]
            energy -= m * (g0 * m1[3 * n] + g1 * m1[3 * n + 1] + g2 * m1[3 * n + 2])
            pull[3 * n] -= m * g0
            pull[3 * n + 1] -= m * g1
            pull[3 * n + 2] -= m * g2
    return energy


@piece(float, Raised, Problem, Configuration, Stage, bool)
def add_raised_masses(raised, p, at, stage, with_hessian):
    """Add what inertia, mass damping and gravity of raised masses have beyond those of nodes, with its gradients."""
    sums, h, g = p.sums, stage.length, p.gravity
    if sums.selected[INERTIA]:
        factor = 1.0 / (h * stage.momentum_length)
        sums.energy[INERTIA] += _add_inertia(raised, factor, at, stage, sums)
    if p.damping > 0.0 and sums.selected[DAMPING]:
        energy = _add_damping(raised, p.damping / h, at, stage, sums)
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
    for b in range(raised.block.shape[0]):
        r, k, _, count = _of_block(raised, b)
        g, t, length = flat(sums.pull[r : r + count]), flat(at.tangent[k : k + count]), at.length[k : k + count]
        m1, m2 = flat(at.director1[k : k + count]), flat(at.director2[k : k + count])
        edge = flat(sums.edge[k : k + count])
        for n in range(count):
            g0, g1, g2 = g[3 * n], g[3 * n + 1], g[3 * n + 2]
            along = (g0 * t[3 * n] + g1 * t[3 * n + 1] + g2 * t[3 * n + 2]) / length[n]
            edge[4 * n] -= along * m1[3 * n]
            edge[4 * n + 1] -= along * m1[3 * n + 1]
            edge[4 * n + 2] -= along * m1[3 * n + 2]
            edge[4 * n + 3] += g0 * m2[3 * n] + g1 * m2[3 * n + 1] + g2 * m2[3 * n + 2]
