"""The Newton matrix: a band for rods, bordered by the unknowns of free bodies, and its factorisation.

    [ A   U ] [ δ   ]     [ g   ]
    [ Uᵀ  D ] [ δ_b ] = − [ g_b ]

A is factorised as L D Lᵀ in linear time; S = D − Uᵀ A⁻¹ U is dense and small. U and D are first restricted to the
motions that bodies are allowed. While no free body touches or holds a rod, U vanishes and is left out.
Some nodes of rods that touch have their columns in the border, too (`engine.linear.contact_columns`).

If a pivot is not positive the matrix is not convex there; what is negative in the contact of rods is left out, then
multiples of the mass matrix are added until it is, so that the step is a descent direction.
"""

from __future__ import annotations

import numpy as np
from numba import types

from ...forces.rod_contact import rods_touch
from ...jit import call, caller, kernel, piece
from ...jit.record import Matrix, Vector
from ...model.records.problem import BorderedSystem, Problem
from ...model.records.status import INDEFINITE, NO_ROOM_IN_BORDER, NOT_FINITE, READY
from ...model.records.step import Place
from ..modes import SLOWEST_GROWTH
from .assembly import expand_bends, expand_edges, expand_pairs, hold_unknowns
from .bordered_system import (
    count_negative_of_border,
    start_border,
)
from .contact_columns import gather_columns, scatter_columns
from .planar_assembly import expand_in_plane, expand_pairs_in_plane, put_in_space, take_in_plane

FIRST_SHIFT = 0.01  # of the inertial part, where the Hessian is indefinite
SHIFT_GROWTH = 10.0
LARGEST_SHIFT = 1e8


@kernel
def _assemble_in_space(space, bonds, strands, sums, factor, band):
    if not space.exists:
        return
    expand_edges(
        strands.edge_node,
        strands.row,
        strands.edge_unknown,
        strands.node_mass,
        strands.spin_inertia,
        factor,
        sums.edge_hessian,
        sums.node_hessian,
        sums.node_hessian.shape[0] > 0,
        band,
    )
    expand_bends(
        strands.bend_count,
        strands.edge_count,
        strands.joint_a,
        strands.joint_b,
        strands.edge_node,
        strands.row,
        strands.edge_unknown,
        sums.cross_hessian,
        band,
    )
    _add_pairs(bonds, space, strands, sums, band)


@kernel
def _assemble_in_plane(plane, bonds, strands, at, sums, factor, band):
    if not plane.exists:
        return
    expand_in_plane(
        strands.axes,
        strands.edge_node,
        plane.joint_after,
        strands.row,
        strands.node_mass,
        factor,
        at.length,
        plane.frame,
        plane.polar_gradient,
        plane.polar_hessian,
        plane.cross_hessian,
        sums.node_hessian,
        band,
    )
    _add_pairs_in_plane(plane, bonds, strands, sums, band)


@kernel
def _add_pairs_in_plane(plane, bonds, strands, sums, band):
    if not bonds.exists:
        return
    expand_pairs_in_plane(
        strands.bend_count,
        bonds.top,
        bonds.bottom,
        strands.edge_node,
        strands.row,
        plane.frame,
        plane.pair_hessian,
        plane.mixed_hessian,
        plane.cross_hessian,
        band,
    )


@kernel
def _add_pairs(bonds, space, strands, sums, band):
    if not bonds.exists:
        return
    expand_pairs(
        strands.bend_count,
        bonds.bottom,
        strands.edge_node,
        strands.row,
        sums.pair_hessian,
        space.top_hessian,
        space.bottom_hessian,
        sums.cross_hessian,
        band,
    )


@kernel
def _hold(held, strands, band):
    hold_unknowns(held.row, strands.dimension, strands.bandwidth, band)


call_factor = caller("factor_band", lambda _: types.int64(Matrix, types.int64))
call_solve = caller("forward_band", lambda _: types.int64(Matrix, types.int64, Vector))
call_eliminate = caller("eliminate_band", lambda _: types.int64(Matrix, types.int64, BorderedSystem.numba_type()))
"""What depends on the half-bandwidth; see `engine.linear.band`."""
EXACT = np.int64(0)
"""How far contacts of rods are simplified at first. (The literal 0 has a type of its own, for which numba would compile
all that takes it once more.)"""


@kernel
def assemble(p, at, factor, simplified):
    """The matrix of the last evaluation, that of `at`, with `factor` times the masses [1/s²]: the band, and the border
    and corner of free bodies. Nodes that bodies hold are rows of the identity.
    """
    strands, band = p.strands, p.system.band
    band[:] = 0.0
    if p.space.exists:
        call(p.calls.assemble_in_space, (p, factor))
    else:
        call(p.calls.assemble_in_plane, (p, at, factor))
    if p.rod_contact.exists:
        call(p.calls.take_rod_contacts, (p, simplified))
    start_border(p.bordered, p.bodies)
    if p.border.exists:
        call(p.calls.assemble_bodies, (p, at))
    _hold(p.constrained, strands, band)


@kernel
def factorise(p, at, stage, counts):
    """Assemble and factorise the matrix of the last evaluation, that of `at`.

    What is negative in the contact of rods is left out, then multiples of the mass matrix are added, until the matrix
    is positive definite. If it `counts`, nothing of the kind is done, but the number of the matrix's negative
    eigenvalues (Sylvester's law of inertia) is left in `System.negative`: of second derivatives in a step so long that
    inertia does not count, with masses over the square of the slowest growth time.

    Returns
    -------
    status : int
    shift : float
        Multiple of the inertial part that was added.
    simplified : int
        How far contacts of rods were simplified; see `take_contacts`.
    """
    strands, band = p.strands, p.system.band
    factor = 1.0 / (stage.lengths[0] * stage.lengths[1]) + p.damping / stage.lengths[0]
    shift, simplified = 0.0, EXACT
    if counts:
        factor = SLOWEST_GROWTH * SLOWEST_GROWTH
    while True:
        assemble(p, at, factor * (1.0 + shift), simplified)
        of_bodies = factor if counts else shift * factor
        if p.border.exists:
            call(p.calls.restrict_bodies, (p, of_bodies))
        if p.contact_columns.exists and not call(p.calls.move_to_border, (p,)):
            return NO_ROOM_IN_BORDER, shift, simplified
        if counts:
            negative = call_factor(p.calls.count_band, (band, strands.size))
        else:
            negative = 0 if call_factor(p.calls.factor_band, (band, strands.size)) < 0 else 1
        if counts or negative == 0:
            if p.bordered.exists and p.bordered.coupled[0] == 1:
                call_eliminate(p.calls.eliminate_band, (band, strands.size, p.bordered))
            if counts:
                of_border = count_negative_of_border(p.bordered)
                p.system.negative[0] = negative + of_border
                return READY if of_border >= 0 else NOT_FINITE, shift, simplified
            if not p.bordered.exists or call(p.calls.factor_border, (p,)):
                return READY, shift, simplified
        if simplified < 2 and rods_touch(p.rod_contact):
            simplified += 1
            continue
        shift = max(FIRST_SHIFT, shift * SHIFT_GROWTH)
        if shift > LARGEST_SHIFT:
            return INDEFINITE, shift, simplified


@kernel
def solve(p):
    """Minus the inverse of the factorised matrix times the present gradient, to `step` and `body_step`."""
    size, system, right = p.strands.size, p.system, p.system.right
    if p.space.exists:
        for j in range(p.sums.gradient.shape[0]):
            right[j] = p.sums.gradient[j]
    else:
        call(p.calls.gradient_in_plane, (p,))
    for j in range(size):
        right[j] = -right[j]
    for j in range(size, right.shape[0]):
        right[j] = 0.0
    gather_columns(p.contact_columns, p.bordered, right)
    call_solve(p.calls.forward_band, (system.band, size, right))
    if p.bordered.exists:
        call(p.calls.solve_bordered, (p,))
    call_solve(p.calls.backward_band, (system.band, size, right))
    scatter_columns(p.contact_columns, p.bordered, right)
    if p.space.exists:
        for j in range(system.step.shape[0]):
            system.step[j] = right[j]
    else:
        call(p.calls.step_in_plane, (p,))


@piece(int, Problem, float)
def assemble_in_space(p, factor):
    """Second derivatives in space, with `factor` times the masses, to the band."""
    _assemble_in_space(p.space, p.bonds, p.strands, p.sums, factor, p.system.band)
    return READY


@piece(int, Problem, Place, float)
def assemble_in_plane(p, at, factor):
    """Second derivatives in a plane, with `factor` times the masses, to the band."""
    _assemble_in_plane(p.plane, p.bonds, p.strands, at, p.sums, factor, p.system.band)
    return READY


@piece(int, Problem)
def gradient_in_plane(p):
    """The gradient along the plane's axes, to the right-hand side."""
    take_in_plane(p.strands.axes, p.strands.node_unknown, p.strands.row, p.sums.gradient, p.system.right)
    return READY


@piece(int, Problem)
def step_in_plane(p):
    """The step along the plane's axes as one in space."""
    put_in_space(p.strands.axes, p.strands.node_unknown, p.strands.row, p.system.right, p.system.step)
    return READY
