"""From lengths and angles of edges in a plane to unknowns: the band, with two unknowns a node.

The second derivatives of `forces.planar` become blocks of edge vectors, with S, X, W = ∂²/∂l², ∂²/∂l∂φ, ∂²/∂φ², the
axial force N and the moment T of an edge:

    ∂²/∂e²      = S t tᵀ + (X − T/l)(t mᵀ + m tᵀ) + (W + N l) m mᵀ
    ∂²/∂e_a∂e_b = S_ab t_a t_bᵀ + X_ab t_a m_bᵀ + X_ba m_a t_bᵀ + W_ab m_a m_bᵀ

and these are handed to the nodes as there. What else acts on nodes (contact, drag) has its derivatives in space, of
which the part in the plane is taken. A vector of unknowns outside the band is one in space, too: its part in the plane
is what is solved for.
"""

from __future__ import annotations

from ...jit import kernel


@kernel
def _node_block(axes, node_hessian, mass, i):
    """Block (pp, pq, qq) of a node by itself: its mass, and what acts on it in space, by an upper triangle."""
    if node_hessian.shape[0] == 0:
        return mass, 0.0, mass
    h00, h01, h02 = node_hessian[i, 0, 0], node_hessian[i, 0, 1], node_hessian[i, 0, 2]
    h11, h12, h22 = node_hessian[i, 1, 1], node_hessian[i, 1, 2], node_hessian[i, 2, 2]
    p0, p1, p2 = axes[0, 0], axes[0, 1], axes[0, 2]
    q0, q1, q2 = axes[1, 0], axes[1, 1], axes[1, 2]
    v0, v1, v2 = h00 * p0 + h01 * p1 + h02 * p2, h01 * p0 + h11 * p1 + h12 * p2, h02 * p0 + h12 * p1 + h22 * p2
    w0, w1, w2 = h00 * q0 + h01 * q1 + h02 * q2, h01 * q0 + h11 * q1 + h12 * q2, h02 * q0 + h12 * q1 + h22 * q2
    return mass + p0 * v0 + p1 * v1 + p2 * v2, q0 * v0 + q1 * v1 + q2 * v2, mass + q0 * w0 + q1 * w1 + q2 * w2


@kernel
def _put_own_block(band, d, pp, pq, qq):
    """Write a symmetric block of one node."""
    band[d, 0] = pp
    band[d, 1] = pq
    band[d + 1, 0] = qq


@kernel
def _put_block(band, row, column, pp, pq, qp, qq):
    """Write a block of two nodes, row > column: rows p, q of the first, columns p, q of the second."""
    r = row - column
    band[column, r] = pp
    band[column + 1, r - 1] = pq
    band[column, r + 1] = qp
    band[column + 1, r] = qq


@kernel
def expand_in_plane(
    axes,
    edge_node,
    joint_after,
    node_unknown,
    node_mass,
    factor,
    length,
    frame,
    polar_gradient,
    polar_hessian,
    cross_hessian,
    node_hessian,
    band_out,
):
    """Write factor × mass, blocks of single nodes if there are any, edges and bends into a band of zeros; clamps' own
    directions have no place in it.

    In one pass along each strand, so that each entry is written once: with H the block of an edge and C, of rows e_a
    and columns e_b, that of the joint at a node i between the edges a (before) and b,

        (i, i)     H_a + H_b − C − Cᵀ
        (i + 1, i) −H_b + Cᵀ + C′ᵀ       with C′ of the next joint
        (i + 2, i) −C′ᵀ

    `joint_after` is the joint between each edge and the next, −1 at the end of a strand, shape (n_edge,).
    """
    before_pp = before_pq = before_qq = 0.0  # of the edge before
    pp = pq = qp = qq = 0.0  # of the joint with it
    for k in range(edge_node.shape[0]):
        i, joint = edge_node[k], joint_after[k]
        tp, tq, mp, mq = frame[k, 0], frame[k, 1], frame[k, 2], frame[k, 3]
        s = polar_hessian[k, 0]
        x = polar_hessian[k, 1] - polar_gradient[k, 1] / length[k]
        w = polar_hessian[k, 2] + polar_gradient[k, 0] * length[k]
        edge_pp = s * tp * tp + 2.0 * x * tp * mp + w * mp * mp
        edge_pq = s * tp * tq + x * (tp * mq + mp * tq) + w * mp * mq
        edge_qq = s * tq * tq + 2.0 * x * tq * mq + w * mq * mq
        next_pp = next_pq = next_qp = next_qq = 0.0
        if joint >= 0:
            s, x_ab = cross_hessian[joint, 0], cross_hessian[joint, 1]
            x_ba, w = cross_hessian[joint, 2], cross_hessian[joint, 3]
            up, uq, vp, vq = s * tp + x_ba * mp, s * tq + x_ba * mq, x_ab * tp + w * mp, x_ab * tq + w * mq
            bp, bq, np, nq = frame[k + 1, 0], frame[k + 1, 1], frame[k + 1, 2], frame[k + 1, 3]
            next_pp, next_pq = up * bp + vp * np, up * bq + vp * nq
            next_qp, next_qq = uq * bp + vq * np, uq * bq + vq * nq
        own_pp, own_pq, own_qq = _node_block(axes, node_hessian, factor * node_mass[i], i)
        own_pp += before_pp + edge_pp - 2.0 * pp
        own_pq += before_pq + edge_pq - pq - qp
        own_qq += before_qq + edge_qq - 2.0 * qq
        d0, d1 = node_unknown[i], node_unknown[i + 1]
        _put_own_block(band_out, d0, own_pp, own_pq, own_qq)
        _put_block(
            band_out,
            d1,
            d0,
            pp + next_pp - edge_pp,
            qp + next_qp - edge_pq,
            pq + next_pq - edge_pq,
            qq + next_qq - edge_qq,
        )
        if joint >= 0:
            _put_block(band_out, node_unknown[i + 2], d0, -next_pp, -next_qp, -next_pq, -next_qq)
            before_pp, before_pq, before_qq = edge_pp, edge_pq, edge_qq
        else:
            own_pp, own_pq, own_qq = _node_block(axes, node_hessian, factor * node_mass[i + 1], i + 1)
            _put_own_block(band_out, d1, own_pp + edge_pp, own_pq + edge_pq, own_qq + edge_qq)
            before_pp = before_pq = before_qq = 0.0
        pp, pq, qp, qq = next_pp, next_pq, next_qp, next_qq


@kernel
def expand_pairs_in_plane(
    first_joint,
    pair_top,
    pair_bottom,
    edge_node,
    node_unknown,
    frame,
    pair_hessian,
    mixed_hessian,
    cross_hessian,
    band_out,
):
    """Add the blocks of bonds; the unknowns of a bond are consecutive: x_b0, x_t0 of one station and x_b1, x_t1 of the
    next (`model.layout`).
    """
    for k in range(pair_bottom.shape[0]):
        top, bottom = pair_top[k], pair_bottom[k]
        start = node_unknown[edge_node[bottom]]
        cross = cross_hessian[first_joint + k, 3]
        for m in range(2):
            for n in range(2):
                p = 0.25 * pair_hessian[k, m + n]
                t, t_ = 0.5 * mixed_hessian[k, m] * frame[top, 2 + n], 0.5 * mixed_hessian[k, n] * frame[top, 2 + m]
                b = 0.5 * mixed_hessian[k, 2 + m] * frame[bottom, 2 + n]
                b_ = 0.5 * mixed_hessian[k, 2 + n] * frame[bottom, 2 + m]
                c = cross * frame[top, 2 + m] * frame[bottom, 2 + n]  # rows e_t, columns e_b
                c_ = cross * frame[top, 2 + n] * frame[bottom, 2 + m]
                column, r = start + n, m - n
                if m >= n:
                    band_out[column, r] += p + b + b_  # b0 b0
                    band_out[column + 2, r] += p - t - t_  # t0 t0
                    band_out[column + 4, r] += p - b - b_  # b1 b1
                    band_out[column + 6, r] += p + t + t_  # t1 t1
                band_out[column, r + 2] += -p + t_ - b + c  # t0 b0
                band_out[column, r + 4] += p + b - b_  # b1 b0
                band_out[column + 2, r + 2] += -p + t + b_ - c_  # b1 t0
                band_out[column, r + 6] += -p - t_ - b - c  # t1 b0
                band_out[column + 2, r + 4] += p - t + t_  # t1 t0
                band_out[column + 4, r + 2] += -p - t_ + b + c  # t1 b1


@kernel
def take_in_plane(axes, space_unknown, plane_unknown, vector, out):
    """Write the part in the plane of a vector of the unknowns in space."""
    for i in range(space_unknown.shape[0]):
        s, d = space_unknown[i], plane_unknown[i]
        x0, x1, x2 = vector[s], vector[s + 1], vector[s + 2]
        out[d] = axes[0, 0] * x0 + axes[0, 1] * x1 + axes[0, 2] * x2
        out[d + 1] = axes[1, 0] * x0 + axes[1, 1] * x1 + axes[1, 2] * x2


@kernel
def put_in_space(axes, space_unknown, plane_unknown, vector, out):
    """Write a vector of the unknowns in the plane as one of those in space; what is no node's is left."""
    for i in range(space_unknown.shape[0]):
        s, d = space_unknown[i], plane_unknown[i]
        for c in range(3):
            out[s + c] = axes[0, c] * vector[d] + axes[1, c] * vector[d + 1]
