"""Inertia, mass damping and gravity of nodes and edge angles: potentials that are at most quadratic in the unknowns.

Over a step of length h from qₙ with velocity vₙ:

    inertia (implicit Euler, paper, eq. 29)   ½ M/h² |q − q̃|²,   q̃ = qₙ + h vₙ,   v = (q − qₙ)/h
    mass damping, force −α M v               ½ α M/h |q − qₙ|²
    gravity                                  −M g·x

M is diagonal: a node carries half the mass of each of its edges, from reference lengths (growth keeps mass); the
angle of an edge carries
ρ w h (w² + h²)/12 per length. The Hessians are multiples of M and are added where the matrix is assembled.
"""

from __future__ import annotations

from ..jit import kernel


@kernel
def node_spring(mass, factor, position, reference, node_gradient_out):
    """Add ½ factor Σ m |x − x_ref|² and return it [J]; `factor` is 1/h² for inertia, α/h for damping [1/s²]."""
    energy = 0.0
    for i in range(mass.shape[0]):
        weight = factor * mass[i]
        for j in range(3):
            difference = position[i, j] - reference[i, j]
            node_gradient_out[i, j] += weight * difference
            energy += 0.5 * weight * difference * difference
    return energy


@kernel
def departure_spring(mass, factor, departure, node_gradient_out):
    """Add ½ factor Σ m |d|² and return it [J]: `node_spring` of the departures d from a reference [m].

    A departure that is a part of a step, and no difference of positions, has all its digits: inertia over a step of
    1e-8 s asks for (1e-8 s)² g ~ 1e-15 m, where the last digit of a position of 1 m stands for 1e-16 m.
    """
    energy = 0.0
    for i in range(mass.shape[0]):
        weight = factor * mass[i]
        for j in range(3):
            node_gradient_out[i, j] += weight * departure[i, j]
            energy += 0.5 * weight * departure[i, j] * departure[i, j]
    return energy


@kernel
def angle_spring(inertia, factor, angle, speed, edge_gradient_out):
    """Add ½ factor Σ J (θ − θ_ref)² for edges and return it [J].

    `angle` is the turn of each edge since the start of the step and `speed` the reference turn [rad], shape (n_edge,).
    """
    energy = 0.0
    for k in range(inertia.shape[0]):
        difference = angle[k] - speed[k]
        force = factor * inertia[k] * difference
        edge_gradient_out[k, 3] += force
        energy += 0.5 * force * difference
    return energy


@kernel
def gravity(mass, acceleration, position, node_gradient_out):
    """Add −Σ m g·x of nodes or of bodies and return it [J]; `acceleration` is g [m/s²], shape (3,)."""
    energy = 0.0
    for i in range(mass.shape[0]):
        for j in range(3):
            weight = mass[i] * acceleration[j]
            node_gradient_out[i, j] -= weight
            energy -= weight * position[i, j]
    return energy
