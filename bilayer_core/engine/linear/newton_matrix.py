"""The Newton matrix: a band for rods, bordered by the unknowns of free bodies, and its factorisation.

    [ A   U ] [ δ   ]     [ g   ]
    [ Uᵀ  D ] [ δ_b ] = − [ g_b ]

A is factorised as L D Lᵀ in linear time; S = D − Uᵀ A⁻¹ U is dense and small. U and D are first restricted to the
motions that bodies are allowed. While no free body touches or holds a rod, U vanishes and is left out.
Some nodes of rods that touch have their columns in the border, too (`engine.linear.contact_columns`), and those where
closed rods close (`engine.linear.closed_rods`).

If a pivot is not positive the matrix is not convex there; what is negative in the contact of rods is left out, then
multiples of the mass matrix are added until it is, so that the step is a descent direction.
"""

from __future__ import annotations

import numpy as np

from bilayer_core.engine.linear.arms import assemble_arms
from bilayer_core.engine.linear.assembly import assemble_in_space, hold_unknowns
from bilayer_core.engine.linear.bordered_system import (
    assemble_bodies,
    count_border,
    factor_border,
    restrict_bodies,
    solve_bordered,
)
from bilayer_core.engine.linear.closed_rods import gather_joins, move_joins_to_border, scatter_joins
from bilayer_core.engine.linear.contact_columns import (
    gather_columns,
    move_to_border,
    scatter_columns,
    take_rod_contacts,
)
from bilayer_core.engine.linear.planar_assembly import assemble_in_plane, gradient_in_plane, step_in_plane
from bilayer_core.engine.linear.raised_blocks import assemble_raised
from bilayer_core.engine.linear.widths import eliminate, factorise_band, go_backward, go_forward
from bilayer_core.engine.request_modes import SLOWEST_GROWTH, WITHOUT_INERTIA
from bilayer_core.forces.rod_contact import rods_touch
from bilayer_core.jit import kernel, piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import BORDER_CAPACITY_EXCEEDED, INDEFINITE, NOT_FINITE, READY
from bilayer_core.model.records.step import Configuration, Stage

FIRST_SHIFT = 0.01  # of the inertial part, where the Hessian is indefinite
SHIFT_GROWTH = 10.0
LARGEST_SHIFT = 1e8


EXACT = np.int64(0)
"""How far contacts of rods are simplified at first. (The literal 0 has a type of its own, for which numba would compile
all that takes it once more.)"""


@piece(int, Problem, Configuration, float, int)
def assemble(p, at, factor, simplified):
    """Assemble the matrix of the last evaluation, that of `at`, with `factor` times the masses [1/s²].

    It has a band, and the border and corner of free bodies. Nodes that bodies hold are rows of the identity.
    """
    strands, band = p.strands, p.system.band
    band[:] = 0.0
    if p.space.exists:
        assemble_in_space(p, factor)
    else:
        assemble_in_plane(p, at, factor)
    if p.raised.exists:
        assemble_raised(p, at, factor)
    if p.surfaces.exists and p.sums.arms[0] > 0:
        assemble_arms(p)
    if p.rod_contact.exists:
        take_rod_contacts(p, simplified)
    if p.bordered.exists:
        p.bordered.coupled[0], p.bordered.width[0] = 0, p.bodies.freedom.shape[1]
    if p.border.exists:
        assemble_bodies(p, at)
    hold_unknowns(p.constrained.row, strands.dimension, strands.bandwidth, band)
    return READY


@piece(int, Problem, Configuration, Stage, bool)
def factorise(p, at, stage, counts):
    """Assemble and factorise the matrix of the last evaluation, that of `at`.

    What is negative in the contact of rods is left out, then multiples of the mass matrix are added, until the matrix
    is positive definite. If it `counts`, nothing of the kind is done, but the number of the matrix's negative
    eigenvalues (Sylvester's law of inertia) is left in `System.negative`: of K + C/τ + M/τ², which has as many as there
    are disturbances that grow faster than exp(t/τ). τ is the length of the stage; of one `WITHOUT_INERTIA`, C is 0 and
    1/τ the slowest growth that counts.

    Returns
    -------
    status : int
        In `Outcome`: the multiple of the masses that was added, and how far contacts of rods were simplified (see
        `engine.linear.contact_columns`).
    """
    outcome = p.outcome
    strands, band = p.strands, p.system.band
    factor = 1.0 / (stage.length * stage.momentum_length) + p.damping / stage.length
    shift, simplified = 0.0, EXACT
    at_rest = counts and stage.length >= WITHOUT_INERTIA
    if at_rest:
        factor = SLOWEST_GROWTH * SLOWEST_GROWTH
    while True:
        assemble(p, at, factor * (1.0 + shift), simplified)
        outcome.shift, outcome.simplified = shift, simplified
        of_bodies = factor if at_rest else shift * factor
        if p.border.exists:
            restrict_bodies(p, of_bodies)
        if p.joins.exists:
            move_joins_to_border(p)
        if p.contact_columns.exists and not move_to_border(p):
            return BORDER_CAPACITY_EXCEEDED
        b = p.system.half_bandwidth[0] = _half_bandwidth(p)
        negative = factorise_band(band, strands.size, b, counts)
        if counts or negative < 0:
            if p.bordered.exists and p.bordered.coupled[0] == 1:
                eliminate(band, strands.size, b, p.bordered)
            if counts:
                of_border = count_border(p) if p.bordered.exists else 0
                p.system.negative[0] = negative + of_border
                return READY if of_border >= 0 else NOT_FINITE
            if not p.bordered.exists or factor_border(p):
                p.outcome.regularised += shift > 0.0 or simplified > EXACT
                return READY
        if simplified < 2 and rods_touch(p.rod_contact):
            simplified += 1
            continue
        shift = max(FIRST_SHIFT, shift * SHIFT_GROWTH)
        if shift > LARGEST_SHIFT:
            outcome.shift = shift
            return INDEFINITE


@kernel
def _half_bandwidth(p):
    """Return the half-bandwidth of the assembled matrix: elements and nodes alone reach as far as contacts of rods
    leave them.
    """
    touching = p.rod_contact.exists and p.contact_columns.contacts > 0
    return p.strands.bandwidth if touching else p.strands.bandwidth_apart


@piece(int, Problem)
def solve(p):
    """Return minus the inverse of the factorised matrix times the present gradient, to `step` and `body_step`."""
    size, system, right, b = p.strands.size, p.system, p.system.right, p.system.half_bandwidth[0]
    if p.space.exists:
        for j in range(p.sums.gradient.shape[0]):
            right[j] = p.sums.gradient[j]
    else:
        gradient_in_plane(p)
    for j in range(size):
        right[j] = -right[j]
    for j in range(size, right.shape[0]):
        right[j] = 0.0
    gather_joins(p.joins, p.bodies.freedom, p.bordered, right)
    gather_columns(p.contact_columns, p.bordered, right)
    go_forward(system.band, size, b, right)
    if p.bordered.exists:
        solve_bordered(p)
    go_backward(system.band, size, b, right)
    scatter_joins(p.joins, p.bodies.freedom, p.bordered, right)
    scatter_columns(p.contact_columns, p.bordered, right)
    if p.space.exists:
        for j in range(system.step.shape[0]):
            system.step[j] = right[j]
    else:
        step_in_plane(p)
    return READY
