"""The Newton matrix in compiled form: the band of rods with a border of free bodies, as in `solve.newton_matrix`."""

from __future__ import annotations

from ..jit import inner, part
from ..solve.assembly import expand_bends, expand_edges, expand_pairs, hold_unknowns
from ..solve.band import factor_band, solve_band, solve_columns
from ..solve.clamps import hand_nodes_to_bodies, hand_rows_to_bodies, hand_walls_to_bodies
from ..solve.dense import factor_dense, solve_dense
from ..solve.newton_matrix import FIRST_SHIFT, LARGEST_SHIFT, SHIFT_GROWTH, add_links
from ..solve.planar_assembly import expand_in_plane, expand_pairs_in_plane, put_in_space, take_in_plane
from ..solve.planar_matrix import hand_walls_to_bodies_in_plane
from .copying import copy


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
def _assemble_border(border, grips, space, plane, strands, sums, band, at):
    """U and D of free bodies: links of contact, and what they hold. Whether U is not zero is left in `coupled`."""
    if border is None:
        return
    border.coupled[0] = 0
    border.border[:] = 0.0
    copy(sums.body_hessian, border.corner)
    if sums.links[0] > 0:
        border.coupled[0] = 1
        links = sums.link_node, sums.link_body, sums.link_hessian
        add_links(strands.axes, sums.links[0], links[0], links[1], links[2], strands.row, border.border)
    _hand_to_bodies(grips, space, plane, border, strands, at, sums, band)


@inner
def _hand_to_bodies(grips, space, plane, border, strands, at, sums, band):
    if grips is None:
        return
    if grips.holding == 0:
        return
    border.coupled[0] = 1
    hand_rows_to_bodies(strands.axes, grips.unknown, grips.free, at.arm, border.border, border.corner)
    hand_nodes_to_bodies(
        strands.axes,
        grips.unknown,
        grips.free,
        grips.of_unknown,
        at.arm,
        sums.attached,
        len(strands.bandwidth),
        strands.size,
        band,
        border.border,
        border.corner,
    )
    _hand_walls(space, grips, border, strands, at, sums)
    _hand_walls_in_plane(plane, grips, border, strands, at, sums)


@inner
def _hand_walls(space, grips, border, strands, at, sums):
    if space is None:
        return
    hand_walls_to_bodies(
        strands.axes,
        grips.wall_free,
        grips.wall_joint,
        strands.joint_a,
        strands.joint_b,
        strands.edge_count,
        strands.edge_node,
        strands.row,
        strands.edge_unknown,
        grips.of_unknown,
        grips.unknown,
        grips.free,
        at.arm,
        at.tangent,
        sums.edge,
        sums.edge_hessian,
        sums.cross_hessian,
        border.border,
        border.corner,
    )


@inner
def _hand_walls_in_plane(plane, grips, border, strands, at, sums):
    if plane is None:
        return
    hand_walls_to_bodies_in_plane(
        strands.axes,
        plane.normal,
        grips.wall_free,
        grips.wall_joint,
        strands.joint_a,
        strands.joint_b,
        strands.edge_count,
        strands.edge_node,
        strands.row,
        grips.of_unknown,
        grips.unknown,
        grips.free,
        at.arm,
        plane.frame,
        plane.polar_hessian,
        sums.cross_hessian,
        border.border,
        border.corner,
    )


@inner
def _hold(held, strands, band):
    hold_unknowns(held.row, strands.dimension, len(strands.bandwidth), band)


@inner
def _clear_held_rows(held, dimension, border):
    for k in range(held.row.shape[0]):
        for row in range(held.row[k], held.row[k] + dimension):
            for i in range(border.shape[1]):
                border[row, i] = 0.0


@inner
def _take_border(border, bodies, held, dimension, size, shift):
    """D and U restricted to what bodies may do, shifted by multiples of their masses."""
    if border is None:
        return
    freedom, n, m = bodies.freedom, bodies.freedom.shape[1], bodies.freedom.shape[0]
    schur, corner, rows, wide = border.schur, border.corner, border.border, border.wide
    for a in range(n):
        for b in range(n):
            total = 0.0
            for i in range(m):
                if freedom[i, a] == 0.0:
                    continue
                total += shift * bodies.inertia[i] * freedom[i, a] * freedom[i, b]
                for j in range(m):
                    total += freedom[i, a] * corner[i, j] * freedom[j, b]
            schur[a, b] = total
    if border.coupled[0] == 0:
        return
    _clear_held_rows(held, dimension, rows)
    for row in range(size):
        for a in range(n):
            wide[row, a] = 0.0
        for i in range(m):
            value = rows[row, i]
            if value != 0.0:
                for a in range(n):
                    wide[row, a] += value * freedom[i, a]


@inner
def _factorise_border(border, strands, band):
    """S = D − Uᵀ A⁻¹ U, factorised; false if it is not positive definite."""
    if border is None:
        return True
    schur, wide, solution = border.schur, border.wide, border.wide_solution
    if border.coupled[0] == 1:
        copy(wide, solution)
        solve_columns(band, strands.size, strands.bandwidth, solution)
        for row in range(strands.size):
            for a in range(schur.shape[0]):
                value = wide[row, a]
                if value != 0.0:
                    for b in range(schur.shape[0]):
                        schur[a, b] -= value * solution[row, b]
    return factor_dense(schur)


@part
def factorise(p, at, stage):
    """Assemble and factorise the matrix of the last evaluation, that of `at`; false if nothing makes it positive
    definite.
    """
    strands, band = p.strands, p.system.band
    factor = 1.0 / (stage.lengths[0] * stage.lengths[1]) + p.damping / stage.lengths[0]
    shift = 0.0
    while True:
        band[:] = 0.0
        _assemble_in_space(p.space, p.bonds, strands, p.sums, factor * (1.0 + shift), band)
        _assemble_in_plane(p.plane, p.bonds, strands, at, p.sums, factor * (1.0 + shift), band)
        _assemble_border(p.border, p.grips, p.space, p.plane, strands, p.sums, band, at)
        _hold(p.held, strands, band)
        _take_border(p.border, p.bodies, p.held, strands.dimension, strands.size, shift * factor)
        if factor_band(band, strands.size, strands.bandwidth) < 0 and _factorise_border(p.border, strands, band):
            return True
        shift = max(FIRST_SHIFT, shift * SHIFT_GROWTH)
        if shift > LARGEST_SHIFT:
            return False


@inner
def solve(space, plane, border, strands, bodies, sums, system):
    """Minus the inverse of the factorised matrix times the present gradient, to `step` and `body_step`."""
    size, right = strands.size, system.right
    _take_gradient(space, sums.gradient, right)
    _take_gradient_in_plane(plane, strands, sums.gradient, right)
    for j in range(size):
        right[j] = -right[j]
    for j in range(size, right.shape[0]):
        right[j] = 0.0
    solve_band(system.band, size, strands.bandwidth, right)
    _solve_border(border, bodies, sums.body, size, right, system.body_step)
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


@inner
def _solve_border(border, bodies, body_gradient, size, right, body_step):
    """The step of free bodies, and what it changes in that of rods."""
    if border is None:
        return
    freedom, load, wide, solution = bodies.freedom, border.load, border.wide, border.wide_solution
    n, free = load.shape[0], body_step.shape[0]
    for a in range(n):
        load[a] = 0.0
        for f in range(free):
            for c in range(6):
                load[a] -= freedom[6 * f + c, a] * body_gradient[f, c]
    if border.coupled[0] == 1:
        for j in range(size):
            for a in range(n):
                load[a] -= wide[j, a] * right[j]
    solve_dense(border.schur, load)
    if border.coupled[0] == 1:
        for j in range(size):
            for a in range(n):
                right[j] -= solution[j, a] * load[a]
    for f in range(free):
        for c in range(6):
            body_step[f, c] = 0.0
            for a in range(n):
                body_step[f, c] += freedom[6 * f + c, a] * load[a]
