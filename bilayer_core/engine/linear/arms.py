"""Contacts with an arm from a node, on the unknowns of that node, its neighbours and the edges between them.

By the *local* unknowns, the position x of the node and the vectors and angles (ε, θ) of the edges before and after, a
contact moves by ∂y = (1, R) with the rate R of its arm (`forces.rod_arms`). With M = ∂²C/∂y² its second derivatives are

    by (x, x)   M        by (x, e)   M R        by (e, e)   Rᵀ M R + ∂²(g·A)/∂e²

summed over all contacts at a node, and then taken once to the unknowns of a *stencil*, the positions before, at and
after the node and the two angles, by ε_b = x_i − x_b and ε_a = x_a − x_i.
"""

from __future__ import annotations

from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY


@kernel
def stencil_rows(surfaces, strands, i, rows_out):
    """Write the rows in the matrix of the unknowns of the stencil of node i, −1 where there is no edge; returns how
    many.
    """
    dimension, before, after = strands.dimension, surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    if before == after:
        before = before if strands.edge_node[before] != i else -1
        after = after if before < 0 else -1
    for m in range(dimension):
        rows_out[m] = strands.row[i - 1] + m if before >= 0 else -1
        rows_out[dimension + m] = strands.row[i] + m
        rows_out[2 * dimension + m] = strands.row[i + 1] + m if after >= 0 else -1
    if dimension < 3:
        return 3 * dimension
    rows_out[9] = strands.edge_unknown[before] if before >= 0 else -1
    rows_out[10] = strands.edge_unknown[after] if after >= 0 else -1
    return 11


@kernel
def stencil_jacobian(axes, rate, r, jacobian_out):
    """Write ∂y by the unknowns of a stencil, from the rate r, shape (3, 11)."""
    dimension = axes.shape[0]
    for c in range(3):
        for m in range(dimension):
            before = rate[r, c, 0] * axes[m, 0] + rate[r, c, 1] * axes[m, 1] + rate[r, c, 2] * axes[m, 2]
            after = rate[r, c, 4] * axes[m, 0] + rate[r, c, 5] * axes[m, 1] + rate[r, c, 6] * axes[m, 2]
            jacobian_out[c, m] = -before
            jacobian_out[c, dimension + m] = axes[m, c] + before - after
            jacobian_out[c, 2 * dimension + m] = after
        if dimension == 3:
            jacobian_out[c, 9], jacobian_out[c, 10] = rate[r, c, 3], rate[r, c, 7]


@kernel
def _add_contact(sums, r, by_node, mixed, by_edges):
    """Add the second derivatives of a contact by the local unknowns: (x, x), (x, e) and (e, e)."""
    m, rate = sums.arm_matrix, sums.arm_rate
    m00, m01, m02 = m[r, 0, 0], m[r, 0, 1], m[r, 0, 2]
    m11, m12, m22 = m[r, 1, 1], m[r, 1, 2], m[r, 2, 2]
    by_node[0, 0] += m00
    by_node[0, 1] += m01
    by_node[0, 2] += m02
    by_node[1, 1] += m11
    by_node[1, 2] += m12
    by_node[2, 2] += m22
    moved = stack_matrix(3, 8)  # M R
    for n in range(8):
        r0, r1, r2 = rate[r, 0, n], rate[r, 1, n], rate[r, 2, n]
        moved[0, n] = m00 * r0 + m01 * r1 + m02 * r2
        moved[1, n] = m01 * r0 + m11 * r1 + m12 * r2
        moved[2, n] = m02 * r0 + m12 * r1 + m22 * r2
    for c in range(3):
        for n in range(8):
            mixed[c, n] += moved[c, n]
    for k in range(8):
        r0, r1, r2 = rate[r, 0, k], rate[r, 1, k], rate[r, 2, k]
        for n in range(8):
            by_edges[k, n] += r0 * moved[0, n] + r1 * moved[1, n] + r2 * moved[2, n]
    if sums.arm_curved[r]:
        for first in (0, 4):
            for k in range(4):
                for n in range(4):
                    by_edges[first + k, first + n] += sums.arm_curvature[r, first + min(k, n), max(k, n)]


@kernel
def _add_block(band, axes, row, column, block):
    """Add a block by two positions, of which the first is earlier in the matrix or both are one."""
    if axes.shape[0] == 3:
        for m in range(3):
            for n in range(m if row == column else 0, 3):
                band[row + m, column - row + n - m] += block[m, n]
        return
    for m in range(2):
        for n in range(m if row == column else 0, 2):
            value = 0.0
            for c in range(3):
                for d in range(3):
                    value += axes[m, c] * axes[n, d] * block[c, d]
            band[row + m, column - row + n - m] += value


@kernel
def _add_angle(band, row, angle, factor, column, k):
    """Add the derivatives by a position and an angle, from a column of a block."""
    for m in range(3):
        at, to = min(row + m, angle), max(row + m, angle)
        band[at, to - at] += factor * column[m, k]


@kernel
def _add_node(band, strands, rows, by_node, mixed, by_edges):
    """Take the second derivatives by the local unknowns to those of the stencil."""
    axes, block, d = strands.axes, stack_matrix(3, 3), strands.dimension
    before, row, after = rows[0], rows[d], rows[2 * d]
    has_before, has_after = before >= 0, after >= 0
    for c in range(3):
        for e in range(3):
            of_node = by_node[c, e] if c <= e else by_node[e, c]
            block[c, e] = (
                of_node
                + (mixed[c, e] + mixed[e, c] + by_edges[c, e])
                - (mixed[c, 4 + e] + mixed[e, 4 + c] - by_edges[4 + c, 4 + e])
                - (by_edges[c, 4 + e] + by_edges[e, 4 + c])
            )
    _add_block(band, axes, row, row, block)
    if has_before:
        _add_block(band, axes, before, before, by_edges)
        for c in range(3):
            for e in range(3):
                block[c, e] = by_edges[c, 4 + e] - by_edges[c, e] - mixed[e, c]
        _add_block(band, axes, before, row, block)
    if has_after:
        for c in range(3):
            for e in range(3):
                block[c, e] = by_edges[4 + c, 4 + e]
        _add_block(band, axes, after, after, block)
        for c in range(3):
            for e in range(3):
                block[c, e] = mixed[c, 4 + e] + by_edges[c, 4 + e] - by_edges[4 + c, 4 + e]
        _add_block(band, axes, row, after, block)
    if has_before and has_after:
        for c in range(3):
            for e in range(3):
                block[c, e] = -by_edges[c, 4 + e]
        _add_block(band, axes, before, after, block)
    if d < 3:
        return
    for side in range(2):
        angle, k = rows[9 + side], 3 + 4 * side
        if angle < 0:
            continue
        for c in range(3):
            block[c, 0], block[c, 1] = by_edges[c, k], by_edges[4 + c, k]
            block[c, 2] = mixed[c, k] + by_edges[c, k] - by_edges[4 + c, k]
        _add_angle(band, row, angle, 1.0, block, 2)
        if has_before:
            _add_angle(band, before, angle, -1.0, block, 0)
        if has_after:
            _add_angle(band, after, angle, 1.0, block, 1)
        band[angle, 0] += by_edges[k, k]
    if has_before and has_after:
        band[rows[9], rows[10] - rows[9]] += by_edges[3, 7]


@piece(int, Problem)
def assemble_arms(p):
    """Add the second derivatives of contacts with an arm to the band."""
    sums, rows, r = p.sums, p.sums.stencil, 0
    by_node, mixed, by_edges = stack_matrix(3, 3), stack_matrix(3, 8), stack_matrix(8, 8)
    while r < sums.arms[0]:
        node = sums.arm_node[r]
        for c in range(3):
            for n in range(3):
                by_node[c, n] = 0.0
            for n in range(8):
                mixed[c, n] = 0.0
        for k in range(8):
            for n in range(8):
                by_edges[k, n] = 0.0
        while r < sums.arms[0] and sums.arm_node[r] == node:
            _add_contact(sums, r, by_node, mixed, by_edges)
            r += 1
        stencil_rows(p.surfaces, p.strands, node, rows)
        _add_node(p.system.band, p.strands, rows, by_node, mixed, by_edges)
    return READY
