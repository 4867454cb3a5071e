"""The border of the Newton matrix: free bodies, and columns of contacts of rods."""

from __future__ import annotations

from ...jit import kernel, piece
from ...kinematics.copying import copy
from ...model.records.problem import Problem
from ...model.records.status import READY
from ...model.records.step import Place
from .attachments import (
    hand_nodes_to_bodies,
    hand_rows_to_bodies,
    hand_walls_to_bodies,
    hand_walls_to_bodies_in_plane,
)
from .contact_columns import hand_contacts_to_bodies
from .dense import count_negative_dense, factor_dense, solve_dense


@kernel
def add_links(axes, links, link_node, link_body, link_hessian, node_unknown, border_out):
    """Add the blocks between nodes, whose unknowns are along `axes`, and free bodies to the border."""
    for k in range(links):
        row, column = node_unknown[link_node[k]], 6 * link_body[k]
        for m in range(axes.shape[0]):
            for c in range(3):
                along = axes[m, c]
                if along != 0.0:
                    for n in range(6):
                        border_out[row + m, column + n] += along * link_hessian[k, c, n]


@kernel
def assemble_border(border, wide, grips, columns, space, plane, strands, sums, band, at):
    """U and D of free bodies: links of contact, and what they hold. Whether U is not zero is left in `coupled`."""
    if not border.exists:
        return
    border.border[:] = 0.0
    copy(sums.body_hessian, border.corner)
    if sums.links[0] > 0:
        wide.coupled[0] = 1
        links = sums.link_node, sums.link_body, sums.link_hessian
        add_links(strands.axes, sums.links[0], links[0], links[1], links[2], strands.row, border.border)
    _hand_to_bodies(wide, grips, columns, space, plane, border, strands, at, sums, band)


@kernel
def _hand_to_bodies(wide, grips, columns, space, plane, border, strands, at, sums, band):
    if not grips.exists:
        return
    if grips.holding == 0:
        return
    wide.coupled[0] = 1
    hand_contacts_to_bodies(columns, grips, strands, at, border)
    hand_rows_to_bodies(strands.axes, grips.unknown, grips.free, at.arm, border.border, border.corner)
    hand_nodes_to_bodies(
        strands.axes,
        grips.unknown,
        grips.free,
        grips.of_unknown,
        at.arm,
        sums.attached,
        strands.bandwidth,
        strands.size,
        band,
        border.border,
        border.corner,
    )
    _hand_walls(space, grips, border, strands, at, sums)
    _hand_walls_in_plane(plane, grips, border, strands, at, sums)


@kernel
def _hand_walls(space, grips, border, strands, at, sums):
    if not space.exists:
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


@kernel
def _hand_walls_in_plane(plane, grips, border, strands, at, sums):
    if not plane.exists:
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
        plane.cross_hessian,
        border.border,
        border.corner,
    )


@kernel
def _clear_held_rows(held, dimension, border):
    for k in range(held.row.shape[0]):
        for row in range(held.row[k], held.row[k] + dimension):
            for i in range(border.shape[1]):
                border[row, i] = 0.0


@kernel
def start_border(wide, bodies):
    """Forget what the last matrix had in the border."""
    if not wide.exists:
        return
    wide.coupled[0], wide.width[0] = 0, bodies.freedom.shape[1]


@kernel
def take_border(border, wide, bodies, held, dimension, size, shift):
    """D and U restricted to what bodies may do, shifted by multiples of their masses."""
    if not border.exists:
        return
    freedom, n, m = bodies.freedom, bodies.freedom.shape[1], bodies.freedom.shape[0]
    schur, corner, rows, columns = wide.schur, border.corner, border.border, wide.border
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
    if wide.coupled[0] == 0:
        return
    _clear_held_rows(held, dimension, rows)
    for a in range(n):
        for row in range(columns.shape[1]):
            columns[a, row] = 0.0
        for i in range(m):
            part = freedom[i, a]
            if part != 0.0:
                for row in range(size):
                    columns[a, row] += part * rows[row, i]


@kernel
def factorise_border(wide):
    """Factorise S in place; false if it is not positive definite."""
    if not wide.exists:
        return True
    return factor_dense(wide.schur, wide.width[0])


@kernel
def count_negative_of_border(wide):
    """Number of negative eigenvalues of S, −1 if it is not finite; S is overwritten."""
    if not wide.exists:
        return 0
    return count_negative_dense(wide.schur, wide.width[0])


@kernel
def solve_border(wide, bodies, body_gradient, size, right, body_step):
    """The step of free bodies and of nodes with contact columns; what it changes is taken off `right`, L⁻¹ times that
    of all others.

    In `BorderedSystem.load` is what is wanted of nodes with contact columns.
    """
    if not wide.exists:
        return
    freedom, load, columns, scaled = bodies.freedom, wide.load, wide.border, wide.scaled
    n, width, free = freedom.shape[1], wide.width[0], body_step.shape[0]
    for a in range(n):
        load[a] = 0.0
        for f in range(free):
            for c in range(6):
                load[a] -= freedom[6 * f + c, a] * body_gradient[f, c]
    if wide.coupled[0] == 1:
        for a in range(width):
            total = 0.0
            for j in range(size):
                total += scaled[a, j] * right[j]
            load[a] -= total
    solve_dense(wide.schur, width, load)
    if wide.coupled[0] == 1:
        for a in range(width):
            part = load[a]
            for j in range(size):
                right[j] -= columns[a, j] * part
    for f in range(free):
        for c in range(6):
            body_step[f, c] = 0.0
            for a in range(n):
                body_step[f, c] += freedom[6 * f + c, a] * load[a]


@piece(int, Problem, Place)
def assemble_bodies(p, at):
    """`assemble_border`"""
    contact, band = p.contact_columns, p.system.band
    assemble_border(p.border, p.bordered, p.attachments, contact, p.space, p.plane, p.strands, p.sums, band, at)
    return READY


@piece(int, Problem, float)
def restrict_bodies(p, shift):
    """`take_border`"""
    take_border(p.border, p.bordered, p.bodies, p.constrained, p.strands.dimension, p.strands.size, shift)
    return READY


@piece(bool, Problem)
def factor_border(p):
    """`factorise_border`"""
    return factorise_border(p.bordered)


@piece(int, Problem)
def solve_bordered(p):
    """`solve_border`"""
    solve_border(p.bordered, p.bodies, p.sums.body, p.strands.size, p.system.right, p.system.body_step)
    return READY
