"""Contacts with an arm from a node, on the unknowns of that node, its neighbours and the edges between them.

By the unknowns of a *stencil*, the positions before, at and after the node and the angles of the two edges,

    ∂y = (−J_b, 1 + J_b − J_a, J_a, j_b, j_a)

with J and j the rates of the arm by the vector and the angle of the edge before and after (`forces.rod_arms`).
"""

from __future__ import annotations

from ...jit import kernel, piece
from ...jit.stack import stack_matrix
from ...model.records.problem import Problem
from ...model.records.status import READY


@kernel
def stencil_rows(surfaces, strands, i, rows_out):
    """Rows in the matrix of the unknowns of the stencil of node i, −1 where there is no edge; returns how many."""
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
    """∂y by the unknowns of a stencil, from the rate r, shape (3, 11)."""
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
def _add(band, row, column, value):
    """A[row, column] += value, where both exist."""
    if row >= 0 and column >= 0:
        band[min(row, column), abs(row - column)] += value


@kernel
def _add_curvature(axes, rows, curvature, r, first, before, after, angle, band):
    """Add ∂²(g·A) by the vector and angle of an edge, from the stencil's unknown `before` to `after`."""
    for m in range(axes.shape[0]):
        for n in range(axes.shape[0]):
            value = 0.0
            for c in range(3):
                for d in range(3):
                    value += axes[m, c] * axes[n, d] * curvature[r, first + min(c, d), max(c, d)]
            if n >= m:
                _add(band, rows[before + m], rows[before + n], value)
                _add(band, rows[after + m], rows[after + n], value)
            _add(band, rows[before + m], rows[after + n], -value)
        if axes.shape[0] == 3:
            _add(band, rows[before + m], rows[angle], -curvature[r, first + m, 3])
            _add(band, rows[after + m], rows[angle], curvature[r, first + m, 3])
    if axes.shape[0] == 3:
        _add(band, rows[angle], rows[angle], curvature[r, first + 3, 3])


@piece(int, Problem)
def assemble_arms(p):
    """Add the second derivatives of contacts with an arm to the band."""
    sums, strands, band = p.sums, p.strands, p.system.band
    axes, dimension = strands.axes, strands.dimension
    rows, jacobian = sums.stencil, stack_matrix(3, 11)
    for r in range(sums.arms[0]):
        size = stencil_rows(p.surfaces, strands, sums.arm_node[r], rows)
        stencil_jacobian(axes, sums.arm_rate, r, jacobian)
        m = sums.arm_matrix
        for k in range(size):
            if rows[k] < 0:
                continue
            j0, j1, j2 = jacobian[0, k], jacobian[1, k], jacobian[2, k]
            v0 = m[r, 0, 0] * j0 + m[r, 0, 1] * j1 + m[r, 0, 2] * j2
            v1 = m[r, 0, 1] * j0 + m[r, 1, 1] * j1 + m[r, 1, 2] * j2
            v2 = m[r, 0, 2] * j0 + m[r, 1, 2] * j1 + m[r, 2, 2] * j2
            for n in range(k + 1):
                _add(band, rows[n], rows[k], jacobian[0, n] * v0 + jacobian[1, n] * v1 + jacobian[2, n] * v2)
        if sums.arm_curved[r]:
            _add_curvature(axes, rows, sums.arm_curvature, r, 0, 0, dimension, 9, band)
            _add_curvature(axes, rows, sums.arm_curvature, r, 4, dimension, 2 * dimension, 10, band)
    return READY
