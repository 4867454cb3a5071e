"""Inertia of the fluid that a ribbon pushes aside: its added mass, once for the whole section of a rod.

The fluid's kinetic energy per length of a slender body, relative to the flow U, is

    T = ½ m₁ (u·m1)² + ½ m₂ (u·m2)² + ½ j ω²,    u = v − U,
    m₁ = ρ_f π w²/4,    m₂ = ρ_f π h²/4,    j = ρ_f π (w² − h²)²/128,

with ω the spin about the tangent, for an ellipse as wide and as thick as the section (Lamb 1932, art. 71): m₁ and, to
(h/w)², j are those of a flat plate. Motion along the tangent takes no fluid along. With q the configuration, Lagrange's
equations give the force that the fluid asks for,

    R = d/dt ∂T/∂v − ∂T/∂q = dP/dt − ∂T/∂q,    P = m₁ (u·m1) m1 + m₂ (u·m2) m2,

P being the fluid's momentum per length. The second part exists because m1 and m2 turn with the body. An increment
(ε, θ) of an edge vector of length l and of its angle moves m to m − t (m·ε)/l + θ m′ (see `forces.bend_twist`), so

    ∂T/∂ε = −[m₁ (u·m1) m1 + m₂ (u·m2) m2] (u·t)/l,    ∂T/∂θ = (m₁ − m₂) (u·m1)(u·m2).

The first acts on the two ends of an edge as a couple: a plate with normal and tangential speeds u_n and u_t feels
Munk's moment m₁ u_n u_t per length, which turns it broadside on. Along a curve it is the reactive force
(∂_t − ∂_s u_t) (m₁ u_n m1) of Lighthill (1971), without the wake that he lets leave at the tail: T depends on
differences of positions alone, so the momentum of rods and fluid together is conserved, to the tolerance of Newton's
solution in each step.

In space: T is summed over edges, half of an edge's mass at either end, T = Σ ½·½ m l̄ (u_i·m_edge)², l̄ the rest length;
the layers of a section share it in proportion to their thickness. Where the middle of the section lies z over the curve
of a laminate, u is that of x + z m1, and m1 as a vector has the momentum z P (`forces.raised`). Error: second order in
the edge length.

In time: over a stage of length h from an origin where the fluid had the momentum P̄,

    R = (P − P̄)/h′ − ∂T/∂q,    all at the end of the stage; for spins j (ω − ω̄)/h′,

h′ being the length over which momenta advance (`integrators.method`; h for most integrators).

That is the integrator's own rule, for momenta, and has its order: 1 for implicit Euler, 2 for SDIRK2 and implicit
midpoint (measured: 0.96, 1.98, 1.87; vibrations too fast for the step reduce SDIRK2's, as they do without a fluid). R
is no gradient: the part of its derivative that comes from ∂²T/∂v∂q is antisymmetric (gyroscopic). Therefore directions
and ∂T/∂q are held at a configuration z, and R is the gradient at q = z of the convex potential

    [½ Σ m (u·m_z)² − P̄·(x − x̄)/h + ½ j (ω − ω̄)²] h/h′ − (∂T/∂q)_z·q,

whose Hessian is block-diagonal. z moves along with every correction of Newton, and the step ends where nothing changes
any more. What is left out of the Hessian makes Newton linear instead of quadratic, by a factor of about
h |u_t| k m₁/(m + m₁), k the largest wavenumber that bends in h; where that is not small, Newton fails and the step is
halved.

At rest in the flow, v = 0 and dP/dt = 0, and the fluid's force is the gradient of a potential, V(q) = −T(q, v = 0).
With a = U·m1, b = U·m2, c = U·t, and ε₁, ε₂, ε_t the parts of ε along m1, m2, t, per edge (m₁, m₂ its whole masses)

    V = −½ m₁ a² − ½ m₂ b²,    ∂V/∂ε = (m₁ a m1 + m₂ b m2) c/l,    ∂V/∂θ = −(m₁ − m₂) a b,

    l² ∂²V:  ε₁ε₁  m₁ (a² − c²)    ε₂ε₂  m₂ (b² − c²)     ε₁ε₂  ½ (m₁ + m₂) a b    ε₁ε_t  −m₁ a c    ε₂ε_t  −m₂ b c
    l ∂²V:   ε₁θ   (m₁ − m₂) b c   ε₂θ   (m₁ − m₂) a c    and of θθ itself  (m₁ − m₂)(a² − b²)

(in a plane, by the angle φ of the edge: ∂V/∂φ = σ m₁ a c, ∂²V/∂φ² = m₁ (a² − c²)). Statics
(`simulation.equilibrium`) minimise V with the rest, with these exact derivatives. Of an edge that moves they are those
of −T at held velocities, with u in place of U: looks out of a plane (`simulation.plane_watch`) count modes with this
stiffness beside the inertia. −m₁ c² is Lighthill's −M U² κ: along
a straight strip the flow acts as a dead compression of M U², and a cantilever diverges at M U² = π² EI/4 L². A tail
that sheds a wake would lack the force M U (∂_t + U ∂_s) w at its end; such a strip does not diverge but flutters, at a
higher speed (Païdoussis 2014, ch. 8).
"""

from __future__ import annotations

import math

from bilayer_core.forces.raised import director_moved
from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.copying import copy
from bilayer_core.kinematics.vector import (
    add_column,
    add_row,
    add_upper_outer,
    add_upper_symmetric,
    combine,
    dot,
    row,
)
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Fluid
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import AT_REST, IN_MOTION, Configuration, Stage

ADDED_MASS = slot_of("added mass")


@piece(float, Fluid, Configuration)
def fluid_momentum(fluid, at):
    """Write P of nodes and ∂T/∂(ε, θ) of edges at the velocities and spins in `fluid` there; return T [J]."""
    mass, edge_node, flow, velocity, spin = fluid.mass, fluid.edge_node, fluid.velocity, fluid.node_velocity, fluid.spin
    length, tangent, director1, director2 = at.length, at.tangent, at.director1, at.director2
    momentum_out, shape_gradient_out = fluid.momentum, fluid.shape_gradient
    nodes, middle, rate = velocity.shape[0], fluid.middle, fluid.director_rate
    energy = 0.0
    momentum_out[:] = 0.0
    shape_gradient_out[:] = 0.0
    for k in range(mass.shape[0]):
        energy += 0.5 * mass[k, 2] * spin[k] ** 2
        r = fluid.raised[k]
        for i in range(edge_node[k], edge_node[k] + 2):
            along = through = across = 0.0
            for c in range(3):
                relative = velocity[i, c] - flow[c]
                if r >= 0:
                    relative += middle[r] * rate[r, c]
                along += relative * tangent[k, c]
                through += relative * director1[k, c]
                across += relative * director2[k, c]
            momentum1, momentum2 = 0.5 * mass[k, 0] * through, 0.5 * mass[k, 1] * across
            energy += 0.5 * (momentum1 * through + momentum2 * across)
            for c in range(3):
                momentum = momentum1 * director1[k, c] + momentum2 * director2[k, c]
                momentum_out[i, c] += momentum
                if r >= 0:
                    momentum_out[nodes + fluid.slot[r], c] += middle[r] * momentum
                shape_gradient_out[k, c] -= momentum * along / length[k]
            shape_gradient_out[k, 3] += momentum1 * across - momentum2 * through
    return energy


@kernel
def move_fluid(fluid, raised, velocity, strain_rate):
    """Write the velocities of nodes [m/s], shape (n_node, 3), and of raised directors, among the rates of strains, in
    the record of a fluid.
    """
    copy(velocity, fluid.node_velocity)
    for r in range(raised.edge.shape[0]):
        for c in range(3):
            fluid.director_rate[r, c] = strain_rate[raised.first + 3 * raised.slot[r] + c]


@kernel
def momentum_at(p, at, velocity, strain_rate, momentum_out):
    """Write P with given velocities, as for `move_fluid`, if the fluid has inertia."""
    fluid = p.fluid
    if not fluid.exists:
        return
    move_fluid(fluid, p.raised, velocity, strain_rate)
    fluid_momentum(fluid, at)
    copy(fluid.momentum, momentum_out)


@kernel
def write_inertia(fluid, node_mass, at):
    """Write m + ∂P/∂v of nodes [kg], with which nodes and the fluid about them move together."""
    inertia = fluid.inertia
    inertia[:] = 0.0
    for i in range(node_mass.shape[0]):
        for c in range(3):
            inertia[i, c, c] = node_mass[i]
    for k in range(fluid.mass.shape[0]):
        mass1, mass2 = 0.5 * fluid.mass[k, 0], 0.5 * fluid.mass[k, 1]
        for i in range(fluid.edge_node[k], fluid.edge_node[k] + 2):
            for m in range(3):
                for n in range(3):
                    inertia[i, m, n] += mass1 * at.director1[k, m] * at.director1[k, n]
                    inertia[i, m, n] += mass2 * at.director2[k, m] * at.director2[k, n]


@kernel
def _add_potential_at_rest(fluid, p, at):
    """Add V of a flow about edges at rest, and its gradient."""
    sums, flow, energy = p.sums, (fluid.velocity[0], fluid.velocity[1], fluid.velocity[2]), 0.0
    for k in range(fluid.mass.shape[0]):
        m1, m2 = fluid.mass[k, 0], fluid.mass[k, 1]
        d1, d2 = row(at.director1, k), row(at.director2, k)
        a, b, c = dot(flow, d1), dot(flow, d2), dot(flow, row(at.tangent, k))
        energy -= 0.5 * (m1 * a * a + m2 * b * b)
        add_row(sums.edge, k, c / at.length[k], combine(m1 * a, d1, m2 * b, d2))
        sums.edge[k, 3] -= (m1 - m2) * a * b
    sums.energy[ADDED_MASS] = energy


@kernel
def _add_stiffness_of_flow(fluid, p, at, moving):
    """Add −∂²T/∂q² of the halves of edges, which move relative to the flow as when the fluid was updated, times
    `moving`.
    """
    plane, velocity, hessian = p.plane, fluid.node_velocity, p.sums.edge_hessian
    for h in range(2 * fluid.mass.shape[0]):
        k = h // 2
        i, r, inverse = fluid.edge_node[k] + h % 2, fluid.raised[k], 1.0 / at.length[k]
        u = combine(moving, row(velocity, i), -1.0, (fluid.velocity[0], fluid.velocity[1], fluid.velocity[2]))
        if r >= 0:
            u = combine(1.0, u, moving * fluid.middle[r], row(fluid.director_rate, r))
        t, d1, d2 = row(at.tangent, k), row(at.director1, k), row(at.director2, k)
        a, b, c, m1, m2 = dot(u, d1), dot(u, d2), dot(u, t), 0.5 * fluid.mass[k, 0], 0.5 * fluid.mass[k, 1]
        if plane.exists:
            plane.polar_gradient[k, 1] += plane.side[k] * m1 * a * c
            plane.polar_hessian[k, 2] += m1 * (a * a - c * c)
            continue
        square = inverse * inverse
        add_upper_outer(hessian, k, m1 * (a * a - c * c) * square, d1)
        add_upper_outer(hessian, k, m2 * (b * b - c * c) * square, d2)
        add_upper_symmetric(hessian, k, 0.5 * (m1 + m2) * a * b * square, d1, d2)
        add_upper_symmetric(hessian, k, -c * square, t, combine(m1 * a, d1, m2 * b, d2))
        add_column(hessian, k, 3, (m1 - m2) * c * inverse, combine(b, d1, a, d2))
        hessian[k, 3, 3] += (m1 - m2) * (a * a - b * b)


@piece(float, Fluid, Problem, Configuration, Stage, bool)
def add_added_mass(fluid, p, at, stage, with_hessian):
    """Add the potential of the fluid's inertia and its derivatives by nodes and edges, z being where it was updated."""
    sums, h, momentum_length = p.sums, stage.length, stage.momentum_length
    if not sums.selected[ADDED_MASS]:
        return math.inf
    if with_hessian and stage.still[0] != IN_MOTION:
        _add_stiffness_of_flow(fluid, p, at, 0.0 if stage.still[0] == AT_REST else 1.0)
    if stage.still[0] == AT_REST:
        _add_potential_at_rest(fluid, p, at)
        return math.inf
    mass, edge_node, flow, shape_gradient = fluid.mass, fluid.edge_node, fluid.velocity, fluid.shape_gradient
    direction1, direction2, origin_momentum = fluid.direction1, fluid.direction2, stage.origin_fluid_momentum
    position, origin, total_angle, predicted_angle = (
        at.position,
        stage.origin_position,
        at.total_angle,
        stage.predicted_angle,
    )
    node_gradient, node_hessian = sums.node, sums.node_hessian
    edge_gradient, edge_hessian = sums.edge, sums.edge_hessian
    raised, middle, pull, nodes = p.raised, fluid.middle, sums.pull, position.shape[0]
    energy = 0.0
    for r in range(raised.edge.shape[0]):
        for c in range(3):
            force = origin_momentum[nodes + raised.slot[r], c] / momentum_length
            pull[r, c] -= force
            energy -= force * director_moved(raised, at, stage, r, c)
    for i in range(nodes):
        for c in range(3):
            force = origin_momentum[i, c] / momentum_length
            node_gradient[i, c] -= force
            energy -= force * (position[i, c] - origin[i, c])
    for k in range(mass.shape[0]):
        first, r = edge_node[k], fluid.raised[k]
        for i in range(first, first + 2):
            through = across = 0.0
            for c in range(3):
                relative = (position[i, c] - origin[i, c]) / h - flow[c]
                if r >= 0:
                    relative += middle[r] * director_moved(raised, at, stage, r, c) / h
                through += relative * direction1[k, c]
                across += relative * direction2[k, c]
            mass1, mass2 = 0.5 * mass[k, 0], 0.5 * mass[k, 1]
            energy += 0.5 * (mass1 * through**2 + mass2 * across**2) * h / momentum_length
            for m in range(3):
                momentum = mass1 * through * direction1[k, m] + mass2 * across * direction2[k, m]
                node_gradient[i, m] += momentum / momentum_length
                if r >= 0:
                    pull[r, m] += middle[r] * momentum / momentum_length
                if with_hessian:
                    for n in range(m, 3):
                        second = (
                            mass1 * direction1[k, m] * direction1[k, n] + mass2 * direction2[k, m] * direction2[k, n]
                        ) / (h * momentum_length)
                        node_hessian[i, m, n] += second
                        if r >= 0:
                            sums.raised_hessian[2 * r + i - first, m, n] += second
        for c in range(3):
            lengthening = position[first + 1, c] - origin[first + 1, c] - position[first, c] + origin[first, c]
            energy -= shape_gradient[k, c] * lengthening
            edge_gradient[k, c] -= shape_gradient[k, c]
        inertia, ahead = mass[k, 2] / (h * momentum_length), total_angle[k] - predicted_angle[k]
        energy += 0.5 * inertia * ahead**2 - shape_gradient[k, 3] * total_angle[k]
        edge_gradient[k, 3] += inertia * ahead - shape_gradient[k, 3]
        if with_hessian:
            edge_hessian[k, 3, 3] += inertia
    sums.energy[ADDED_MASS] = energy
    return math.inf


@piece(bool, Fluid, Problem, Configuration, Stage)
def update_fluid(fluid, p, at, stage):
    """Make a configuration z: take directions and ∂T/∂q from it; returns whether there is anything to take."""
    if stage.still[0] == AT_REST:
        return False
    velocity, position, origin, h = fluid.node_velocity, at.position, stage.origin_position, stage.length
    for i in range(velocity.shape[0]):
        for c in range(3):
            velocity[i, c] = (position[i, c] - origin[i, c]) / h
    for r in range(p.raised.edge.shape[0]):
        for c in range(3):
            fluid.director_rate[r, c] = director_moved(p.raised, at, stage, r, c) / h
    fluid_momentum(fluid, at)
    for k in range(fluid.direction1.shape[0]):
        for c in range(3):
            fluid.direction1[k, c], fluid.direction2[k, c] = at.director1[k, c], at.director2[k, c]
    return True
