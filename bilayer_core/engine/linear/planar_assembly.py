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

from bilayer_core.engine.linear.assembly import add, add_twice
from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.vector import POSITIVE, dot, row
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration


@piece(int, Problem, Configuration, float)
def assemble_in_plane(p, at, factor):
    """Write second derivatives in a plane, and `factor` times the masses, into a band of zeros."""
    _put_edges(p.plane, p.strands, at.length, p.sums.node_hessian, factor, p.system.band)
    if p.bonds.exists:
        _add_bonds(p.plane, p.strands, p.system.band)
        _add_ends(p.plane, p.bonds, p.strands, p.system.band)
    return READY


@kernel
def _node_block(axes, node_hessian, mass, i):
    """Return the block (pp, pq, qq) of one node: its mass and what acts on it in space, by an upper triangle."""
    if node_hessian.shape[0] == 0:
        return mass, 0.0, mass
    p, q = row(axes, 0), row(axes, 1)
    h0 = node_hessian[i, 0, 0], node_hessian[i, 0, 1], node_hessian[i, 0, 2]
    h1 = h0[1], node_hessian[i, 1, 1], node_hessian[i, 1, 2]
    h2 = h0[2], h1[2], node_hessian[i, 2, 2]
    v, w = (dot(h0, p), dot(h1, p), dot(h2, p)), (dot(h0, q), dot(h1, q), dot(h2, q))
    return mass + dot(p, v), dot(q, v), mass + dot(q, w)


@kernel
def _put_own_block(band, d, pp, pq, qq):
    """Write a symmetric block of one node."""
    band[d, 0] = pp
    band[d, 1] = pq
    band[d + 1, 0] = qq


@kernel
def _put_block(band, row, column, pp, pq, qp, qq):
    """Write a block of two nodes, row > column: rows p, q of the first, columns p, q of the second."""
    r = (row - column) & POSITIVE
    band[column, r] = pp
    band[column + 1, r - 1] = pq
    band[column, r + 1] = qp
    band[column + 1, r] = qq


@kernel
def _put_edges(plane, strands, length, node_hessian, factor, band):
    """Write factor × mass, blocks of single nodes if there are any, edges and bends into a band of zeros; clamps' own
    directions have no place in it.

    In one pass along each strand, so that each entry is written once: with H the block of an edge and C, of rows e_a
    and columns e_b, that of the joint at a node i between the edges a (before) and b,

        (i, i)     H_a + H_b − C − Cᵀ
        (i + 1, i) −H_b + Cᵀ + C′ᵀ       with C′ of the next joint
        (i + 2, i) −C′ᵀ
    """
    axes, frame, unknown, mass = strands.axes, plane.frame, strands.row, strands.node_mass
    polar_gradient, polar_hessian, cross_hessian = plane.polar_gradient, plane.polar_hessian, plane.cross_hessian
    before_pp = before_pq = before_qq = 0.0  # of the edge before
    pp = pq = qp = qq = 0.0  # of the joint with it
    for k in range(strands.edge_node.shape[0]):
        i, joint = strands.edge_node[k] & POSITIVE, plane.joint_after[k]
        tp, tq, mp, mq = frame[k, 0], frame[k, 1], frame[k, 2], frame[k, 3]
        s = polar_hessian[k, 0]
        x = polar_hessian[k, 1] - polar_gradient[k, 1] / length[k]
        w = polar_hessian[k, 2] + polar_gradient[k, 0] * length[k]
        edge_pp = s * tp * tp + 2.0 * x * tp * mp + w * mp * mp
        edge_pq = s * tp * tq + x * (tp * mq + mp * tq) + w * mp * mq
        edge_qq = s * tq * tq + 2.0 * x * tq * mq + w * mq * mq
        next_pp = next_pq = next_qp = next_qq = 0.0
        if joint >= 0:
            joint &= POSITIVE
            s, x_ab = cross_hessian[joint, 0], cross_hessian[joint, 1]
            x_ba, w = cross_hessian[joint, 2], cross_hessian[joint, 3]
            up, uq, vp, vq = s * tp + x_ba * mp, s * tq + x_ba * mq, x_ab * tp + w * mp, x_ab * tq + w * mq
            bp, bq, np, nq = frame[k + 1, 0], frame[k + 1, 1], frame[k + 1, 2], frame[k + 1, 3]
            next_pp, next_pq = up * bp + vp * np, up * bq + vp * nq
            next_qp, next_qq = uq * bp + vq * np, uq * bq + vq * nq
        own_pp, own_pq, own_qq = _node_block(axes, node_hessian, factor * mass[i], i)
        own_pp += before_pp + edge_pp - 2.0 * pp
        own_pq += before_pq + edge_pq - pq - qp
        own_qq += before_qq + edge_qq - 2.0 * qq
        d0, d1 = unknown[i] & POSITIVE, unknown[i + 1] & POSITIVE
        _put_own_block(band, d0, own_pp, own_pq, own_qq)
        _put_block(
            band,
            d1,
            d0,
            pp + next_pp - edge_pp,
            qp + next_qp - edge_pq,
            pq + next_pq - edge_pq,
            qq + next_qq - edge_qq,
        )
        if joint >= 0:
            _put_block(band, unknown[i + 2], d0, -next_pp, -next_qp, -next_pq, -next_qq)
            before_pp, before_pq, before_qq = edge_pp, edge_pq, edge_qq
        else:
            own_pp, own_pq, own_qq = _node_block(axes, node_hessian, factor * mass[i + 1], i + 1)
            _put_own_block(band, d1, own_pp + edge_pp, own_pq + edge_pq, own_qq + edge_qq)
            before_pp = before_pq = before_qq = 0.0
        pp, pq, qp, qq = next_pp, next_pq, next_qp, next_qq


@kernel
def _add_bonds(plane, strands, band):
    """Add the blocks of paired edges; their unknowns are consecutive: x_b0, x_t0 of one station and x_b1, x_t1 of the
    next (`model.unknown_order`).
    """
    frame, pair_hessian, mixed_hessian = plane.frame, plane.pair_hessian, plane.mixed_hessian
    for k in range(strands.joint_a.shape[0] - strands.bend_count):
        x = strands.bend_count + k
        top, bottom = strands.joint_a[x], strands.joint_b[x]
        start = strands.row[strands.edge_node[bottom]]
        cross = plane.cross_hessian[x, 3]
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
                    band[column, r] += p + b + b_  # b0 b0
                    band[column + 2, r] += p - t - t_  # t0 t0
                    band[column + 4, r] += p - b - b_  # b1 b1
                    band[column + 6, r] += p + t + t_  # t1 t1
                band[column, r + 2] += -p + t_ - b + c  # t0 b0
                band[column, r + 4] += p + b - b_  # b1 b0
                band[column + 2, r + 2] += -p + t + b_ - c_  # b1 t0
                band[column, r + 6] += -p - t_ - b - c  # t1 b0
                band[column + 2, r + 4] += p - t + t_  # t1 t0
                band[column + 4, r + 2] += -p - t_ + b + c  # t1 b1


@kernel
def _add_ends(plane, bonds, strands, band):
    """Add the blocks of section vectors where a layer ends, x_t − x_b; those of two edges are in `_put_edges`."""
    frame, pair_hessian, mixed_hessian = plane.frame, plane.pair_hessian, plane.mixed_hessian
    for k in range(strands.joint_a.shape[0] - strands.bend_count, bonds.joint.shape[0]):
        x = bonds.joint[k]
        top, bottom = strands.row[bonds.node[k, 0]], strands.row[bonds.node[k, 2]]
        for m in range(2):
            for n in range(2):
                value = pair_hessian[k, m + n]
                if m <= n:
                    band[top + m, n - m] += value
                    band[bottom + m, n - m] += value
                add(band, top + m, bottom + n, -value)
        for side in range(2):
            edge = strands.joint_a[x] if side == 0 else strands.joint_b[x]
            d0, d1 = strands.row[strands.edge_node[edge]], strands.row[strands.edge_node[edge] + 1]
            for m in range(2):
                for n in range(2):
                    value = mixed_hessian[k, 2 * side + m] * frame[edge, 2 + n]
                    add_twice(band, top + m, d0 + n, -value)
                    add_twice(band, top + m, d1 + n, value)
                    add_twice(band, bottom + m, d0 + n, value)
                    add_twice(band, bottom + m, d1 + n, -value)


@piece(int, Problem)
def gradient_in_plane(p):
    """Write the gradient along the plane's axes to the right-hand side."""
    strands = p.strands
    axes, vector, out = strands.axes, p.sums.gradient, p.system.right
    for i in range(strands.row.shape[0]):
        s, d = strands.node_unknown[i], strands.row[i]
        along = vector[s], vector[s + 1], vector[s + 2]
        out[d], out[d + 1] = dot(row(axes, 0), along), dot(row(axes, 1), along)
    return READY


@piece(int, Problem)
def step_in_plane(p):
    """Write the step along the plane's axes as one in space; what is no node's is left."""
    strands = p.strands
    axes, vector, out = strands.axes, p.system.right, p.system.step
    for i in range(strands.row.shape[0]):
        s, d = strands.node_unknown[i], strands.row[i]
        for c in range(3):
            out[s + c] = axes[0, c] * vector[d] + axes[1, c] * vector[d + 1]
    return READY
