"""From edge space to unknowns: gradient and band matrix.

With e = x₁ − x₀ an edge vector and p = ½ (x_t0 + x_t1) − ½ (x_b0 + x_b1) the vector between paired edges, a
derivative with respect to e
or p is handed to the nodes with the factors −1, +1 and ±½. This is the only file that joins second derivatives to the
numbers of unknowns.
"""

from __future__ import annotations

from ...jit import kernel
from ...jit.stack import stack_matrix


@kernel
def expand_gradient(
    edge_node,
    node_unknown,
    edge_unknown,
    pair_top,
    pair_bottom,
    edge_gradient,
    pair_gradient,
    node_gradient,
    gradient_out,
):
    """Gradient with respect to the unknowns [N, N m] from nodes, edges and pairs; written, shape (size,)."""
    for k in range(edge_node.shape[0]):
        i = edge_node[k]
        for c in range(3):
            node_gradient[i, c] -= edge_gradient[k, c]
            node_gradient[i + 1, c] += edge_gradient[k, c]
        gradient_out[edge_unknown[k]] = edge_gradient[k, 3]
    for k in range(pair_top.shape[0]):
        i, j = edge_node[pair_top[k]], edge_node[pair_bottom[k]]
        for c in range(3):
            half = 0.5 * pair_gradient[k, c]
            node_gradient[i, c] += half
            node_gradient[i + 1, c] += half
            node_gradient[j, c] -= half
            node_gradient[j + 1, c] -= half
    for i in range(node_unknown.shape[0]):
        for c in range(3):
            gradient_out[node_unknown[i] + c] = node_gradient[i, c]


@kernel
def _add(band, row, column, value):
    """A[row, column] += value in either triangle."""
    if row >= column:
        band[column, row - column] += value
    else:
        band[row, column - row] += value


@kernel
def _add_transposed_block(band, row, column, s, block, k):
    """A[row:row+3, column:column+3] += s block[k, :3, :3]ᵀ, for row > column."""
    for n in range(3):
        for m in range(3):
            band[column + n, row + m - column - n] += s * block[k, n, m]


@kernel
def _add_own_block(band, start, s, block, k):
    """A[start:start+3, start:start+3] += s (upper triangle of block[k])."""
    for m in range(3):
        for n in range(m, 3):
            band[start + m, n - m] += s * block[k, m, n]


@kernel
def _add_symmetrised_block(band, start, s, block, k):
    """A[start:start+3, start:start+3] += s (block + blockᵀ)."""
    for m in range(3):
        for n in range(m, 3):
            band[start + m, n - m] += s * (block[k, m, n] + block[k, n, m])


@kernel
def expand_edges(
    edge_node,
    node_unknown,
    edge_unknown,
    node_mass,
    spin_inertia,
    factor,
    edge_hessian,
    node_hessian,
    with_node_blocks,
    band_out,
):
    """Add edge blocks, factor × mass, and blocks of single nodes (contact, drag) to the band."""
    for i in range(node_unknown.shape[0]):
        d = node_unknown[i]
        for c in range(3):
            band_out[d + c, 0] += factor * node_mass[i]
        if with_node_blocks:
            _add_own_block(band_out, d, 1.0, node_hessian, i)
    for k in range(edge_node.shape[0]):
        d0, d1, t = node_unknown[edge_node[k]], node_unknown[edge_node[k] + 1], edge_unknown[k]
        _add_own_block(band_out, d0, 1.0, edge_hessian, k)
        _add_own_block(band_out, d1, 1.0, edge_hessian, k)
        for m in range(3):
            for n in range(3):
                upper = edge_hessian[k, m, n] if m <= n else edge_hessian[k, n, m]
                band_out[d0 + n, d1 + m - d0 - n] -= upper
            band_out[d0 + m, t - d0 - m] -= edge_hessian[k, m, 3]
            band_out[t, d1 + m - t] += edge_hessian[k, m, 3]
        band_out[t, 0] += edge_hessian[k, 3, 3] + factor * spin_inertia[k]


@kernel
def expand_bends(
    bend_count, edge_count, joint_a, joint_b, edge_node, node_unknown, edge_unknown, cross_hessian, band_out
):
    """Add the cross blocks of bending elements to the band; those of clamps have none."""
    for k in range(bend_count):
        a, b = joint_a[k], joint_b[k]
        if a >= edge_count or b >= edge_count:
            continue
        i = edge_node[a]
        d0, d1, d2 = node_unknown[i], node_unknown[i + 1], node_unknown[i + 2]
        ta, tb = edge_unknown[a], edge_unknown[b]
        _add_transposed_block(band_out, d1, d0, 1.0, cross_hessian, k)
        _add_transposed_block(band_out, d2, d0, -1.0, cross_hessian, k)
        _add_symmetrised_block(band_out, d1, -1.0, cross_hessian, k)
        _add_transposed_block(band_out, d2, d1, 1.0, cross_hessian, k)
        for m in range(3):
            _add(band_out, tb, d0 + m, -cross_hessian[k, m, 3])
            _add(band_out, tb, d1 + m, cross_hessian[k, m, 3])
            _add(band_out, ta, d1 + m, -cross_hessian[k, 3, m])
            _add(band_out, ta, d2 + m, cross_hessian[k, 3, m])
        _add(band_out, tb, ta, cross_hessian[k, 3, 3])


@kernel
def expand_pairs(
    first_joint,
    pair_bottom,
    edge_node,
    node_unknown,
    pair_hessian,
    top_hessian,
    bottom_hessian,
    cross_hessian,
    band_out,
):
    """Add the blocks of bonds to the band.

    The unknowns of a bond are consecutive: x_b0, x_t0, θ_b, θ_t of one station and x_b1, x_t1 of the next
    (`model.layout`).
    Their local matrix is collected first, its lower triangle then added.
    """
    local = stack_matrix(14, 14)
    for k in range(pair_bottom.shape[0]):
        x = first_joint + k
        for m in range(3):
            for n in range(3):
                p = 0.25 * (pair_hessian[k, m, n] if m <= n else pair_hessian[k, n, m])
                t, t_ = 0.5 * top_hessian[k, m, n], 0.5 * top_hessian[k, n, m]
                b, b_ = 0.5 * bottom_hessian[k, m, n], 0.5 * bottom_hessian[k, n, m]
                c, c_ = cross_hessian[x, m, n], cross_hessian[x, n, m]  # rows e_t, columns e_b
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
            t, b = 0.5 * top_hessian[k, m, 3], 0.5 * bottom_hessian[k, m, 3]
            et_b, t_eb = cross_hessian[x, m, 3], cross_hessian[x, 3, m]  # e_t θ_b and θ_t e_b
            local[6, m] = -b  # θ_b
            local[6, 3 + m] = b - et_b
            local[8 + m, 6] = -b
            local[11 + m, 6] = b + et_b
            local[7, m] = -t - t_eb  # θ_t
            local[7, 3 + m] = t
            local[8 + m, 7] = -t + t_eb
            local[11 + m, 7] = t
        local[6, 6] = 0.0
        local[7, 6] = cross_hessian[x, 3, 3]
        local[7, 7] = 0.0
        start = node_unknown[edge_node[pair_bottom[k]]]
        for n in range(14):
            for m in range(n, 14):
                band_out[start + n, m - n] += local[m, n]


@kernel
def hold_unknowns(held, dimension, half_bandwidth, band_out):
    """Replace the rows and columns of `dimension` unknowns from each of `held` by those of the identity."""
    for k in range(held.shape[0]):
        for j in range(held[k], held[k] + dimension):
            for r in range(1, half_bandwidth + 1):
                band_out[j, r] = 0.0
                if j >= r:
                    band_out[j - r, r] = 0.0
            band_out[j, 0] = 1.0
