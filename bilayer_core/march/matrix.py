"""The Newton matrix: a band for rods, bordered by the unknowns of free bodies, and its factorisation.

    [ A   U ] [ δ   ]     [ g   ]
    [ Uᵀ  D ] [ δ_b ] = − [ g_b ]

A is factorised as L D Lᵀ in linear time; S = D − Uᵀ A⁻¹ U is dense and small. U and D are first restricted to the
motions that bodies are allowed. While no free body touches or holds a rod, U vanishes and is left out.
Some nodes of rods that touch leave the band for the border, too (`solve.rod_border`).

If a pivot is not positive the matrix is not convex there; what is negative in the contact of rods is left out, then
multiples of the mass matrix are added until it is, so that the step is a descent direction.
"""

from __future__ import annotations

import numpy as np

from ..jit import inner
from ..solve.assembly import expand_bends, expand_edges, expand_pairs, hold_unknowns
from ..solve.band import backward_band, factor_band, factor_signed, forward_band
from ..solve.planar_assembly import expand_in_plane, expand_pairs_in_plane, put_in_space, take_in_plane
from .border import (
    assemble_border,
    count_negative_of_border,
    eliminate_rods,
    factorise_border,
    solve_border,
    start_border,
    take_border,
)
from .leaving import leave, put_leaving, take_contacts_of, take_leaving
from .modes import SLOWEST_GROWTH
from .status import INDEFINITE, NO_ROOM_IN_BORDER, NOT_FINITE, READY
from .threads import rods_touch

FIRST_SHIFT = 0.01  # of the inertial part, where the Hessian is indefinite
SHIFT_GROWTH = 10.0
LARGEST_SHIFT = 1e8


@inner
def _assemble_in_space(space, bonds, strands, sums, factor, band):
    if space is None:
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


@inner
def _assemble_in_plane(plane, bonds, strands, at, sums, factor, band):
    if plane is None:
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
        sums.cross_hessian,
        sums.node_hessian,
        band,
    )
    _add_pairs_in_plane(plane, bonds, strands, sums, band)


@inner
def _add_pairs_in_plane(plane, bonds, strands, sums, band):
    if bonds is None:
        return
    expand_pairs_in_plane(
        strands.bend_count,
        bonds.top,
        bonds.bottom,
        strands.edge_node,
        strands.row,
        plane.frame,
        sums.pair_hessian,
        plane.mixed_hessian,
        sums.cross_hessian,
        band,
    )


@inner
def _add_pairs(bonds, space, strands, sums, band):
    if bonds is None:
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


@inner
def _hold(held, strands, band):
    hold_unknowns(held.row, strands.dimension, len(strands.bandwidth), band)


EXACT = np.int64(0)
"""How far contacts of rods are simplified at first. (The literal 0 has a type of its own, for which numba would compile
all that takes it once more.)"""


@inner
def assemble(p, at, factor, simplified):
    """The matrix of the last evaluation, that of `at`, with `factor` times the masses [1/s²]: the band, and the border
    and corner of free bodies. Nodes that bodies hold are rows of the identity.
    """
    strands, band = p.strands, p.system.band
    band[:] = 0.0
    _assemble_in_space(p.space, p.bonds, strands, p.sums, factor, band)
    _assemble_in_plane(p.plane, p.bonds, strands, at, p.sums, factor, band)
    take_contacts_of(p.threads, p.leaving, strands, simplified, band)
    start_border(p.wide, p.bodies)
    assemble_border(p.border, p.wide, p.grips, p.leaving, p.space, p.plane, strands, p.sums, band, at)
    _hold(p.held, strands, band)


@inner
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
        take_border(p.border, p.wide, p.bodies, p.held, strands.dimension, strands.size, of_bodies)
        if not leave(p.leaving, p.wide, strands, band):
            return NO_ROOM_IN_BORDER, shift, simplified
        if counts:
            negative = factor_signed(band, strands.size, strands.bandwidth)
        else:
            negative = 0 if factor_band(band, strands.size, strands.bandwidth) < 0 else 1
        if counts or negative == 0:
            eliminate_rods(p.wide, strands, band)
            if counts:
                of_border = count_negative_of_border(p.wide)
                p.system.negative[0] = negative + of_border
                return READY if of_border >= 0 else NOT_FINITE, shift, simplified
            if factorise_border(p.wide):
                return READY, shift, simplified
        if simplified < 2 and rods_touch(p.threads):
            simplified += 1
            continue
        shift = max(FIRST_SHIFT, shift * SHIFT_GROWTH)
        if shift > LARGEST_SHIFT:
            return INDEFINITE, shift, simplified


@inner
def solve(space, plane, wide, leaving, strands, bodies, sums, system):
    """Minus the inverse of the factorised matrix times the present gradient, to `step` and `body_step`."""
    size, right = strands.size, system.right
    _take_gradient(space, sums.gradient, right)
    _take_gradient_in_plane(plane, strands, sums.gradient, right)
    for j in range(size):
        right[j] = -right[j]
    for j in range(size, right.shape[0]):
        right[j] = 0.0
    take_leaving(leaving, wide, right)
    forward_band(system.band, size, strands.bandwidth, right)
    solve_border(wide, bodies, sums.body, size, right, system.body_step)
    backward_band(system.band, size, strands.bandwidth, right)
    put_leaving(leaving, wide, right)
    _put_step(space, right, system.step)
    _put_step_in_plane(plane, strands, right, system.step)


@inner
def _take_gradient(space, gradient, out):
    if space is None:
        return
    for j in range(gradient.shape[0]):
        out[j] = gradient[j]


@inner
def _take_gradient_in_plane(plane, strands, gradient, out):
    if plane is None:
        return
    take_in_plane(strands.axes, strands.node_unknown, strands.row, gradient, out)


@inner
def _put_step(space, right, step):
    if space is None:
        return
    for j in range(step.shape[0]):
        step[j] = right[j]


@inner
def _put_step_in_plane(plane, strands, right, step):
    if plane is None:
        return
    put_in_space(strands.axes, strands.node_unknown, strands.row, right, step)
