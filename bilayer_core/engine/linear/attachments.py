"""Nodes and clamp edges that free bodies hold: their derivatives belong to the body.

A node attached to a body is at x = X + R r, and the fixed direction of a clamp, its *clamp edge*, turns with R. With
the chart R → exp([φ]×) R, ρ = R r and t the tangent of a clamp edge, to second order

    x → x + δX + φ×ρ + ½ φ×(φ×ρ),      clamp edge: e → t + φ×t + ½ φ×(φ×t),   θ → φ·t,

because exp([φ]×) is the parallel transport to the new tangent followed by the turn φ·t about it, up to third order. A
gradient g at ρ (or t) adds ρ×g to that of φ, and ½ (ρ gᵀ + g ρᵀ) − (ρ·g) I to the Hessian. The rows and columns of
attached nodes leave the band for the border U and the corner D of free bodies.
"""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.vector import dot, row


@kernel
def condense_gradient(constrained, strands, at, sums):
    """Move the gradient of attached nodes and clamp edges to their free bodies; attached nodes keep none."""
    gradient, of_bodies = sums.gradient, sums.body
    for k in range(constrained.unknown.shape[0]):
        a, f = constrained.unknown[k], constrained.free[k]
        g0, g1, g2 = gradient[a], gradient[a + 1], gradient[a + 2]
        r0, r1, r2 = row(at.arm, k)
        sums.attached[k, 0], sums.attached[k, 1], sums.attached[k, 2] = g0, g1, g2
        for c in range(3):
            gradient[a + c] = 0.0
            if f >= 0:
                of_bodies[f, c] += sums.attached[k, c]
        if f >= 0:
            of_bodies[f, 3] += r1 * g2 - r2 * g1
            of_bodies[f, 4] += r2 * g0 - r0 * g2
            of_bodies[f, 5] += r0 * g1 - r1 * g0
    for k in range(constrained.clamp_edge_free.shape[0]):
        f, w = constrained.clamp_edge_free[k], strands.edge_count + k
        if f >= 0:
            g0, g1, g2 = row(sums.edge, w)
            t0, t1, t2 = row(at.tangent, w)
            g3 = sums.edge[w, 3]
            of_bodies[f, 3] += t1 * g2 - t2 * g1 + g3 * t0
            of_bodies[f, 4] += t2 * g0 - t0 * g2 + g3 * t1
            of_bodies[f, 5] += t0 * g1 - t1 * g0 + g3 * t2


@kernel
def arm_jacobian(axes, arm, k, c, n):
    """Return the entry (c, n) of ∂(a_c·x)/∂(X, φ) = [a_cᵀ, (ρ × a_c)ᵀ] for the direction a_c of an unknown."""
    if n < 3:
        return axes[c, n]
    i, j = (n - 2) % 3, (n - 1) % 3
    return arm[k, i] * axes[c, j] - arm[k, j] * axes[c, i]


@kernel
def _write_jacobian(axes, arm, k, out):
    """Write ∂(a_c·x)/∂(X, φ) = [a_cᵀ, (ρ × a_c)ᵀ] for the directions a_c of a node's unknowns, shape (dimension, 6)."""
    r0, r1, r2 = row(arm, k)
    for c in range(axes.shape[0]):
        a0, a1, a2 = row(axes, c)
        out[c, 0], out[c, 1], out[c, 2] = a0, a1, a2
        out[c, 3], out[c, 4], out[c, 5] = r1 * a2 - r2 * a1, r2 * a0 - r0 * a2, r0 * a1 - r1 * a0


@kernel
def add_to_row(border, row, column, value):
    """Add to a value of U, and note its row."""
    border.border[row, column] += value
    border.noted[row] = True


@kernel
def _add_rotation(arm, gradient, k, base, corner):
    """Add ½ (ρ gᵀ + g ρᵀ) − (ρ·g) I, of row k of both, to the block of a body's rotation, which begins at `base`."""
    product = dot(row(arm, k), row(gradient, k))
    for m in range(3):
        for n in range(3):
            corner[base + m, base + n] += 0.5 * (arm[k, m] * gradient[k, n] + gradient[k, m] * arm[k, n])
        corner[base + m, base + m] -= product


@kernel
def condense_nodes(attachments, strands, at, sums, band, border):
    """Add what band and border (contact of the nodes with other bodies) hold in rows of attached nodes to U and D;
    these rows are not changed.
    """
    axes, corner = strands.axes, border.corner
    jacobian, other_jacobian = stack_matrix(3, 6), stack_matrix(3, 6)
    for k in range(attachments.unknown.shape[0]):
        f = attachments.free[k]
        if f < 0:
            continue
        _write_jacobian(axes, at.arm, k, jacobian)
        for c in range(axes.shape[0]):
            column = attachments.unknown[k] + c
            for i in range(corner.shape[0] if border.noted[column] else 0):
                value = border.border[column, i]
                if value != 0.0:
                    for n in range(6):
                        corner[6 * f + n, i] += value * jacobian[c, n]
                        corner[i, 6 * f + n] += value * jacobian[c, n]
            for i in range(max(0, column - strands.bandwidth), min(strands.size, column + strands.bandwidth + 1)):
                value = band[column, i - column] if i >= column else band[i, column - i]
                other = attachments.of_unknown[i]
                if value == 0.0:
                    continue
                if other < 0:
                    for n in range(6):
                        add_to_row(border, i, 6 * f + n, value * jacobian[c, n])
                elif attachments.free[other] >= 0:
                    _write_jacobian(axes, at.arm, other, other_jacobian)
                    first, own = 6 * attachments.free[other], i - attachments.unknown[other]
                    for m in range(6):
                        left = value * other_jacobian[own, m]
                        for n in range(6):
                            corner[first + m, 6 * f + n] += left * jacobian[c, n]
        _add_rotation(at.arm, sums.attached, k, 6 * f + 3, corner)


@kernel
def condense_clamp_edges(attachments, strands, at, sums, border):
    """Add the second derivatives of clamps' elements with respect to the rotation of free bodies to U and D."""
    jacobian, scratch = stack_matrix(4, 3), stack_matrix(3, 6)  # of a clamp edge: ∂(e, θ)/∂φ = [−[t]×; tᵀ]
    values = stack_matrix(4, 3)
    for k in range(attachments.clamp_edge_free.shape[0]):
        f, w, x = attachments.clamp_edge_free[k], strands.edge_count + k, attachments.clamp_edge_joint[k]
        if f < 0:
            continue
        base = 6 * f + 3
        _write_jacobian(strands.axes, at.tangent, w, scratch)
        for n in range(3):
            for m in range(3):
                jacobian[m, n] = scratch[m, 3 + n]
            jacobian[3, n] = at.tangent[w, n]
        for p in range(4):
            for n in range(3):
                values[p, n] = 0.0
                for q in range(4):
                    values[p, n] += sums.edge_hessian[w, min(p, q), max(p, q)] * jacobian[q, n]
        for m in range(3):
            for n in range(3):
                for p in range(4):
                    border.corner[base + m, base + n] += jacobian[p, m] * values[p, n]
        _add_rotation(at.tangent, sums.edge, w, base, border.corner)
        comes_first = strands.joint_a[x] == w
        edge = strands.joint_b[x] if comes_first else strands.joint_a[x]
        for q in range(4):
            for m in range(3):
                values[q, m] = 0.0
                for p in range(4):
                    h = sums.cross_hessian[x, p, q] if comes_first else sums.cross_hessian[x, q, p]
                    values[q, m] += jacobian[p, m] * h
        for m in range(3):
            add_to_row(border, strands.edge_unknown[edge], base + m, values[3, m])
        _add_to_edge(attachments, strands, at.arm, edge, values, base, border, scratch)


@kernel
def condense_clamp_edges_in_plane(attachments, plane, strands, at, border):
    """Do the same as `condense_clamp_edges` in a plane, where the angle of a clamp edge is that of its body about the
    normal.
    """
    normal, frame, values, scratch = plane.normal, plane.frame, stack_matrix(4, 3), stack_matrix(3, 6)
    for k in range(attachments.clamp_edge_free.shape[0]):
        f, w, x = attachments.clamp_edge_free[k], strands.edge_count + k, attachments.clamp_edge_joint[k]
        if f < 0:
            continue
        base = 6 * f + 3
        for m in range(3):
            for n in range(3):
                border.corner[base + m, base + n] += plane.polar_hessian[w, 2] * normal[m] * normal[n]
        comes_first = strands.joint_a[x] == w
        edge = strands.joint_b[x] if comes_first else strands.joint_a[x]
        by_length, by_angle = plane.cross_hessian[x, 2 if comes_first else 1], plane.cross_hessian[x, 3]
        for c in range(2):
            along = by_length * frame[edge, c] + by_angle * frame[edge, 2 + c]
            for m in range(3):
                values[c, m] = along * normal[m]
        _add_to_edge(attachments, strands, at.arm, edge, values, base, border, scratch)


@kernel
def _add_to_edge(attachments, strands, arm, edge, values, base, border, scratch):
    """Add derivatives by an edge vector (rows of `values`) and a body's rotation (columns, of D from `base` on) to the
    two nodes of the edge: to U, or to D where a free body holds the node.
    """
    for end in range(2):
        first = strands.row[strands.edge_node[edge] + end]
        sign = 1.0 if end == 1 else -1.0
        other = attachments.of_unknown[first]
        if other >= 0 and attachments.free[other] < 0:
            continue
        if other >= 0:
            _write_jacobian(strands.axes, arm, other, scratch)
        for c in range(strands.dimension):
            for m in range(3):
                value = sign * values[c, m]
                if other < 0:
                    add_to_row(border, first + c, base + m, value)
                    continue
                for n in range(6):
                    start = 6 * attachments.free[other]
                    border.corner[start + n, base + m] += value * scratch[c, n]
                    border.corner[base + m, start + n] += value * scratch[c, n]
