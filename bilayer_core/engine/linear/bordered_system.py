"""The border of the Newton matrix: free bodies, and columns of contacts of rods."""

from __future__ import annotations

from bilayer_core.engine.linear.arms import stencil_jacobian, stencil_rows
from bilayer_core.engine.linear.attachments import (
    add_to_row,
    condense_clamp_edges,
    condense_clamp_edges_in_plane,
    condense_nodes,
)
from bilayer_core.engine.linear.border import column_times, subtract_column
from bilayer_core.engine.linear.contact_columns import condense_contacts_to_bodies
from bilayer_core.engine.linear.dense import count_negative_dense, factor_dense, solve_dense
from bilayer_core.engine.linear.new_columns import add_to_column, clear_column
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.copying import copy
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration


@piece(int, Problem, Configuration)
def assemble_bodies(p, at):
    """Assemble U and D of free bodies: links of contact, and what they hold. Whether U is not zero is left in
    `coupled`.
    """
    border, coupled, attachments, strands, sums = p.border, p.bordered.coupled, p.attachments, p.strands, p.sums
    for row in range(border.noted.shape[0]):
        if border.noted[row]:
            border.border[row] = 0.0
            border.noted[row] = False
    copy(sums.body_hessian, border.corner)
    if sums.links[0] > 0:
        coupled[0] = 1
        _add_links(p.surfaces, strands, sums, border)
    if attachments.holding > 0:
        coupled[0] = 1
        condense_contacts_to_bodies(p.contact_columns, attachments, strands, at, border)
        condense_nodes(attachments, strands, at, sums, p.system.band, border)
        if p.space.exists:
            condense_clamp_edges(attachments, strands, at, sums, border)
        else:
            condense_clamp_edges_in_plane(attachments, p.plane, strands, at, border)
    return READY


@kernel
def _add_links(surfaces, strands, sums, border):
    """Add the blocks between nodes, whose unknowns are along `axes`, and free bodies to the border."""
    axes, rows, jacobian = strands.axes, sums.stencil, stack_matrix(3, 11)
    for k in range(sums.links[0]):
        row, column, r = strands.row[sums.link_node[k]], 6 * sums.link_body[k], sums.link_arm[k]
        if r >= 0:
            size = stencil_rows(surfaces, strands, sums.link_node[k], rows)
            stencil_jacobian(axes, sums.arm_rate, r, jacobian)
        else:
            size = axes.shape[0]
            for m in range(size):
                rows[m] = row + m
                for c in range(3):
                    jacobian[c, m] = axes[m, c]
        for m in range(size):
            for c in range(3):
                if rows[m] >= 0 and jacobian[c, m] != 0.0:
                    for n in range(6):
                        add_to_row(border, rows[m], column + n, jacobian[c, m] * sums.link_hessian[k, c, n])


@kernel
def _any(values):
    """Return whether any of the values is not zero."""
    total = 0.0
    for i in range(values.shape[0]):
        total += abs(values[i])
    return total != 0.0


@piece(int, Problem, float)
def restrict_bodies(p, shift):
    """Return D and U restricted to what bodies may do, shifted by multiples of their masses."""
    freedom, inertia, constrained, dimension = p.bodies.freedom, p.bodies.inertia, p.constrained, p.strands.dimension
    schur, corner, rows = p.bordered.schur, p.border.corner, p.border.border
    (m, n), firsts, alone = freedom.shape, p.bodies.freedom_first, p.bodies.freedom_alone
    for a in range(n):
        for b in range(n):
            schur[a, b] = 0.0
        for i in range(firsts[a], firsts[a] + 6):
            if freedom[i, a] != 0.0:
                for b in range(n):
                    total = shift * inertia[i] * freedom[i, b]
                    if alone[b] >= 0:
                        schur[a, b] += freedom[i, a] * (total + corner[i, alone[b]])
                        continue
                    for j in range(firsts[b], firsts[b] + 6):
                        total += corner[i, j] * freedom[j, b]
                    schur[a, b] += freedom[i, a] * total
    if p.bordered.coupled[0] == 0:
        return READY
    for k in range(constrained.row.shape[0]):
        for row in range(constrained.row[k], constrained.row[k] + dimension):
            for i in range(m):
                rows[row, i] = 0.0
    for a in range(n):
        clear_column(p.bordered, a)
    for row in range(p.strands.size):
        if not (p.border.noted[row] and _any(rows[row])):  # most have none
            continue
        for a in range(n):
            value = rows[row, alone[a]] if alone[a] >= 0 else 0.0
            for i in range(firsts[a], firsts[a] + 6 if alone[a] < 0 else firsts[a]):
                value += freedom[i, a] * rows[row, i]
            if value != 0.0:
                add_to_column(p.bordered, a, row, value)
    return READY


@piece(bool, Problem)
def factor_border(p):
    """Factorise S in place; false if it is not positive definite."""
    return factor_dense(p.bordered.schur, p.bordered.width[0], p.bordered.begins)


@piece(int, Problem)
def count_border(p):
    """Return the number of negative eigenvalues of S, −1 if it is not finite; overwrite S."""
    return count_negative_dense(p.bordered.schur, p.bordered.width[0])


@piece(int, Problem)
def solve_bordered(p):
    """Compute the step of free bodies and of nodes with contact columns.

    Subtract its effect on all other unknowns from `System.right`, which holds L⁻¹ times the right-hand side of these.

    On entry, `BorderedSystem.load` holds the right-hand side of nodes with contact columns.
    """
    bordered, freedom, size = p.bordered, p.bodies.freedom, p.strands.size
    right, body_step = p.system.right, p.system.body_step
    load, columns, scaled = bordered.load, bordered.border, bordered.scaled
    firsts, width, gradient = p.bodies.freedom_first, bordered.width[0], p.sums.body
    for a in range(firsts.shape[0]):
        load[a] = 0.0
        for c in range(6):
            load[a] -= freedom[firsts[a] + c, a] * gradient[firsts[a] // 6, c]
    if bordered.coupled[0] == 1:
        for a in range(width):
            load[a] -= column_times(scaled, bordered.filled, a, size, right)
    solve_dense(bordered.schur, width, bordered.begins, load)
    if bordered.coupled[0] == 1:
        for a in range(width):
            subtract_column(columns, bordered.filled, a, size, load[a], right)
    body_step[:] = 0.0
    for a in range(firsts.shape[0]):
        for c in range(6):
            body_step[firsts[a] // 6, c] += freedom[firsts[a] + c, a] * load[a]
    return READY
