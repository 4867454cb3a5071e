"""From edge space to unknowns: gradient and band matrix.

With e = x₁ − x₀ an edge vector and p = ½ (x_t0 + x_t1) − ½ (x_b0 + x_b1) the vector between paired edges, or
x_t − x_b that of a section where a layer ends, a derivative with respect to e or p is handed to the nodes with the
factors −1, +1 and ±½ or ±1. This is the only file that joins second derivatives in space to the numbers of unknowns.
"""

from __future__ import annotations

from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import flat, stack_matrix
from bilayer_core.kinematics.vector import POSITIVE
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY


@kernel
def expand_gradient(bonds, strands, sums):
    """Write the gradient by unknowns [N, N m] from those by nodes, edges and pairs; that by nodes becomes the total."""
    edge_node, of_nodes, gradient = strands.edge_node, sums.node, sums.gradient
    for k in range(edge_node.shape[0]):
        i = edge_node[k]
        for c in range(3):
            of_nodes[i, c] -= sums.edge[k, c]
            of_nodes[i + 1, c] += sums.edge[k, c]
        gradient[strands.edge_unknown[k]] = sums.edge[k, 3]
    for k in range(bonds.joint.shape[0]):
        for c in range(3):
            half = 0.5 * sums.pair[k, c]
            of_nodes[bonds.node[k, 0], c] += half
            of_nodes[bonds.node[k, 1], c] += half
            of_nodes[bonds.node[k, 2], c] -= half
            of_nodes[bonds.node[k, 3], c] -= half
    for i in range(of_nodes.shape[0]):
        for c in range(3):
            gradient[strands.node_unknown[i] + c] = of_nodes[i, c]


@piece(int, Problem, float)
def assemble_in_space(p, factor):
    """Add second derivatives in space, and `factor` times the masses, to the band."""
    strands, sums, band = p.strands, p.sums, p.system.band
    _add_nodes(strands, sums, factor, band)
    _add_edges(strands, sums, factor, band)
    _add_bends(strands, sums.cross_hessian, band)
    if p.bonds.exists:
        _add_bonds(p.space, strands, sums, band)
        _add_ends(p.bonds, p.space, strands, sums, band)
    return READY


@kernel
def _add_nodes(strands, sums, factor, band):
    """Add factor × mass, and the blocks of single nodes (contact, drag) by their upper triangles."""
    hessian = sums.node_hessian
    for i in range(strands.row.shape[0]):
        d = strands.row[i] & POSITIVE
        for m in range(3):
            band[d + m, 0] += factor * strands.node_mass[i]
            if hessian.shape[0] > 0:
                for n in range(m, 3):
                    band[d + m, n - m] += hessian[i, m, n]


@kernel
def _place(reach, row, column):
    """Return where A[row, column] is in a flat band of half-bandwidth `reach`; A[row, column + 1] is next."""
    return (row * reach + column) & POSITIVE


@kernel
def _add_edges(strands, sums, factor, band):
    """Add the blocks of edges, by their upper triangles, and factor × moment of inertia."""
    hessian, matrix, reach = flat(sums.edge_hessian), flat(band), band.shape[1] - 1
    for k in range(strands.edge_node.shape[0]):
        i, t, h = strands.edge_node[k] & POSITIVE, strands.edge_unknown[k], 16 * k
        d0, d1 = strands.row[i], strands.row[i + 1]
        turned = _place(reach, t, d1)
        for m in range(3):
            own, other = _place(reach, d0 + m, d0), _place(reach, d1 + m, d1)
            between, by_angle = _place(reach, d0 + m, d1), _place(reach, d0 + m, t)
            for n in range(m, 3):
                matrix[own + n] += hessian[h + 4 * m + n]
                matrix[other + n] += hessian[h + 4 * m + n]
            for n in range(3):
                matrix[between + n] -= hessian[h + 4 * min(m, n) + max(m, n)]
            matrix[by_angle] -= hessian[h + 4 * m + 3]
            matrix[turned + m] += hessian[h + 4 * m + 3]
        matrix[_place(reach, t, t)] += hessian[h + 15] + factor * strands.spin_inertia[k]


@kernel
def _add_bends(strands, hessian, band):
    """Add cross blocks of bending elements, of rows (e_a, θ_a) and columns (e_b, θ_b); those of clamps have none.

    Unknowns of a strand follow each other: nodes 0 and 1 with the angles of edges a and b behind them, and node 2.
    """
    cross, matrix, reach = flat(hessian), flat(band), band.shape[1] - 1
    for k in range(strands.bend_count):
        a, b, h = strands.joint_a[k] & POSITIVE, strands.joint_b[k] & POSITIVE, 16 * k
        if a >= strands.edge_count or b >= strands.edge_count:
            continue
        i = strands.edge_node[a] & POSITIVE
        d0, d1, d2 = strands.row[i], strands.row[i + 1], strands.row[i + 2]
        ta, tb = strands.edge_unknown[a], strands.edge_unknown[b]
        turned1, turned2 = _place(reach, ta, d1), _place(reach, ta, d2)
        for m in range(3):
            first, second, third = _place(reach, d0 + m, d1), _place(reach, d0 + m, d2), _place(reach, d1 + m, d2)
            own = _place(reach, d1 + m, d1)
            for n in range(3):
                value = cross[h + 4 * m + n]
                matrix[first + n] += value
                matrix[second + n] -= value
                matrix[third + n] += value
                if n >= m:
                    matrix[own + n] -= value + cross[h + 4 * n + m]
            matrix[_place(reach, d0 + m, tb)] -= cross[h + 4 * m + 3]
            matrix[_place(reach, d1 + m, tb)] += cross[h + 4 * m + 3]
            matrix[turned1 + m] -= cross[h + 12 + m]
            matrix[turned2 + m] += cross[h + 12 + m]
        matrix[_place(reach, ta, tb)] += cross[h + 15]


@kernel
def add(band, row, column, value):
    """Add a value to A[row, column] in either triangle."""
    band[min(row, column), abs(row - column)] += value


@kernel
def _add_bonds(space, strands, sums, band):
    """Add the blocks of bonds of paired edges.

    The unknowns of a bond are consecutive: x_b0, x_t0, θ_b, θ_t of one station and x_b1, x_t1 of the next
    (`model.unknown_order`). Their local matrix is collected first, its lower triangle then added.
    """
    local, of_pairs, cross = stack_matrix(14, 14), sums.pair_hessian, sums.cross_hessian
    top, bottom = space.first_hessian, space.second_hessian
    for k in range(strands.joint_a.shape[0] - strands.bend_count):
        x = strands.bend_count + k
        for m in range(3):
            for n in range(3):
                p = 0.25 * (of_pairs[k, m, n] if m <= n else of_pairs[k, n, m])
                t, t_ = 0.5 * top[k, m, n], 0.5 * top[k, n, m]
                b, b_ = 0.5 * bottom[k, m, n], 0.5 * bottom[k, n, m]
                c, c_ = cross[x, m, n], cross[x, n, m]  # rows e_t, columns e_b
                local[m, n] = p + b + b_  # b0 b0
                local[3 + m, n] = -p + t_ - b + c  # t0 b0
                local[3 + m, 3 + n] = p - t - t_  # t0 t0
                local[8 + m, n] = p + b - b_  # b1 b0
                local[8 + m, 3 + n] = -p + t + b_ - c_  # b1 t0
                local[8 + m, 8 + n] = p - b - b_  # b1 b1
                local[11 + m, n] = -p - t_ - b - c  # t1 b0
                local[11 + m, 3 + n] = p - t + t_  # t1 t0
                local[11 + m, 8 + n] = -p - t_ + b + c  # t1 b1
                local[11 + m, 11 + n] = p + t + t_  # t1 t1
            t, b = 0.5 * top[k, m, 3], 0.5 * bottom[k, m, 3]
            et_b, t_eb = cross[x, m, 3], cross[x, 3, m]  # e_t θ_b and θ_t e_b
            local[6, m] = -b  # θ_b
            local[6, 3 + m] = b - et_b
            local[8 + m, 6] = -b
            local[11 + m, 6] = b + et_b
            local[7, m] = -t - t_eb  # θ_t
            local[7, 3 + m] = t
            local[8 + m, 7] = -t + t_eb
            local[11 + m, 7] = t
        local[6, 6] = 0.0
        local[7, 6] = cross[x, 3, 3]
        local[7, 7] = 0.0
        start = strands.row[strands.edge_node[strands.joint_b[x]]]
        for n in range(14):
            for m in range(n, 14):
                band[start + n, m - n] += local[m, n]


@kernel
def add_twice(band, row, column, value):
    """Add a value to A[row, column] and to A[column, row]."""
    band[min(row, column), abs(row - column)] += value if row != column else 2.0 * value


@kernel
def _add_ends(bonds, space, strands, sums, band):
    """Add the blocks of section vectors where a layer ends, x_t − x_b; `_add_bends` has those of two edges."""
    of_pairs = sums.pair_hessian
    for k in range(strands.joint_a.shape[0] - strands.bend_count, bonds.joint.shape[0]):
        x = bonds.joint[k]
        top, bottom = strands.row[bonds.node[k, 0]], strands.row[bonds.node[k, 2]]
        for m in range(3):
            for n in range(3):
                value = of_pairs[k, m, n] if m <= n else of_pairs[k, n, m]
                if m <= n:
                    band[top + m, n - m] += value
                    band[bottom + m, n - m] += value
                add(band, top + m, bottom + n, -value)
        _add_section_with_edge(strands, k, space.first_hessian, strands.joint_a[x], top, bottom, band)
        _add_section_with_edge(strands, k, space.second_hessian, strands.joint_b[x], top, bottom, band)


@kernel
def _add_section_with_edge(strands, k, mixed, edge, top, bottom, band):
    """Add the blocks of a section vector, by rows of its two nodes, and an edge."""
    i, turn = strands.edge_node[edge], strands.edge_unknown[edge]
    d0, d1 = strands.row[i], strands.row[i + 1]
    for m in range(3):
        for n in range(3):
            value = mixed[k, m, n]
            add_twice(band, top + m, d0 + n, -value)
            add_twice(band, top + m, d1 + n, value)
            add_twice(band, bottom + m, d0 + n, value)
            add_twice(band, bottom + m, d1 + n, -value)
        add(band, top + m, turn, mixed[k, m, 3])
        add(band, bottom + m, turn, -mixed[k, m, 3])


@kernel
def hold_unknowns(rows, dimension, half_bandwidth, band):
    """Replace the rows and columns of `dimension` unknowns from each of `rows` by those of the identity."""
    for k in range(rows.shape[0]):
        for j in range(rows[k], rows[k] + dimension):
            for r in range(1, half_bandwidth + 1):
                band[j, r] = 0.0
                if j >= r:
                    band[j - r, r] = 0.0
            band[j, 0] = 1.0
