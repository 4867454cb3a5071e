"""Matrices by motions of all nodes, turns of edges and motions of free bodies: a band, and entries beside it."""

from __future__ import annotations

from bilayer_core.jit import kernel, record
from bilayer_core.jit.record import Indices, Matrix, Vector


@record
class LackingMatrix:
    """A matrix as a sum: entries at the same place add up."""

    band: Matrix  # A[i, i + j − reach] at [i, j], shape (n_unknown, 2 reach + 1)
    count: Indices  # of entries beside it, beyond those for which there is room, shape (1,)
    row: Indices
    column: Indices
    value: Vector


@kernel
def clear(matrix):
    """Make a matrix zero."""
    matrix.band[:] = 0.0
    matrix.count[0] = 0


@kernel
def add_entry(matrix, row, column, value):
    """Add a value to A[row, column]."""
    size, width = matrix.band.shape
    place = column - row + width // 2
    if row < size and column < size and 0 <= place < width:
        matrix.band[row, place] += value
    elif value != 0.0:
        k = matrix.count[0]
        if k < matrix.row.shape[0]:
            matrix.row[k], matrix.column[k], matrix.value[k] = row, column, value
        matrix.count[0] = k + 1


@kernel
def unknown_of_edge(strands, e, k):
    """Return one of the seven unknowns of an edge: of its two nodes, and its turn."""
    if k == 6:
        return strands.edge_unknown[e]
    return strands.node_unknown[strands.edge_node[e] + k // 3] + k % 3


@kernel
def multiply(matrix, of, back, out):
    """Add A times a vector, `back` Aᵀ, to another one."""
    size, width = matrix.band.shape
    reach = width // 2
    for i in range(size):
        first, last = max(reach - i, 0), min(width, size - i + reach)
        if back:
            for j in range(first, last):
                out[i + j - reach] += matrix.band[i, j] * of[i]
        else:
            total = 0.0
            for j in range(first, last):
                total += matrix.band[i, j] * of[i + j - reach]
            out[i] += total
    for k in range(matrix.count[0]):
        row, column = matrix.row[k], matrix.column[k]
        if back:
            out[column] += matrix.value[k] * of[row]
        else:
            out[row] += matrix.value[k] * of[column]
