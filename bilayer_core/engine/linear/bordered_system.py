"""The border of the Newton matrix: free bodies, and columns of contacts of rods."""

from __future__ import annotations

from bilayer_core.engine.linear.arms import stencil_jacobian, stencil_rows
from bilayer_core.engine.linear.attachments import condense_clamp_edges, condense_clamp_edges_in_plane, condense_nodes
from bilayer_core.engine.linear.contact_columns import condense_contacts_to_bodies
from bilayer_core.engine.linear.dense import count_negative_dense, factor_dense, solve_dense
from bilayer_core.engine.linear.wide_border import column_times, is_wide, subtract_column
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
    border.border[:] = 0.0
    copy(sums.body_hessian, border.corner)
    if sums.links[0] > 0:
        coupled[0] = 1
        _add_links(p.surfaces, strands, sums, border.border)
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
                        border[rows[m], column + n] += jacobian[c, m] * sums.link_hessian[k, c, n]


@piece(int, Problem, float)
def restrict_bodies(p, shift):
    """Return D and U restricted to what bodies may do, shifted by multiples of their masses."""
    freedom, inertia, constrained, dimension = p.bodies.freedom, p.bodies.inertia, p.constrained, p.strands.dimension
    schur, corner, rows, columns = p.bordered.schur, p.border.corner, p.border.border, p.bordered.border
    m, n = freedom.shape
    for a in range(n):
        first = p.bodies.freedom_first[a]
        for b in range(n):
            other, total = p.bodies.freedom_first[b], 0.0
            for i in range(first, first + 6):
                if freedom[i, a] == 0.0:
                    continue
                total += shift * inertia[i] * freedom[i, a] * freedom[i, b]
                for j in range(other, other + 6):
                    total += freedom[i, a] * corner[i, j] * freedom[j, b]
            schur[a, b] = total
    if p.bordered.coupled[0] == 0:
        return READY
    for k in range(constrained.row.shape[0]):
        for row in range(constrained.row[k], constrained.row[k] + dimension):
            for i in range(m):
                rows[row, i] = 0.0
    for a in range(n):
        for row in range(columns.shape[1]):
            columns[a, row] = 0.0
    for row in range(p.strands.size):  # in few of which a body has values that are not zero
        before, present = -1, 0.0
        for a in range(n):
            first = p.bodies.freedom_first[a]
            if first != before:
                before, present = first, 0.0
                for i in range(first, first + 6):
                    present += abs(rows[row, i])
            if present != 0.0:
                for i in range(first, first + 6):
                    columns[a, row] += freedom[i, a] * rows[row, i]
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
    n, width, free = freedom.shape[1], bordered.width[0], body_step.shape[0]
    for a in range(n):
        load[a] = 0.0
        for f in range(free):
            for c in range(6):
                load[a] -= freedom[6 * f + c, a] * p.sums.body[f, c]
    wide = is_wide(width, size)
    if bordered.coupled[0] == 1:
        for a in range(width):
            if wide:
                load[a] -= column_times(scaled, bordered.filled, a, size, right)
                continue
            total = 0.0
            for j in range(size):
                total += scaled[a, j] * right[j]
            load[a] -= total
    solve_dense(bordered.schur, width, bordered.begins, load)
    if bordered.coupled[0] == 1:
        for a in range(width):
            part = load[a]
            if wide:
                subtract_column(columns, bordered.filled, a, size, part, right)
                continue
            for j in range(size):
                right[j] -= columns[a, j] * part
    for f in range(free):
        for c in range(6):
            body_step[f, c] = 0.0
            for a in range(n):
                body_step[f, c] += freedom[6 * f + c, a] * load[a]
    return READY
