"""Nodes and directions that free bodies hold: their derivatives belong to the body.

A node attached to a body is at x = X + R r, and a clamp's fixed direction ("wall") turns with R. With the chart R →
exp([φ]×) R, ρ = R r and t the wall's tangent,
to second order

    x → x + δX + φ×ρ + ½ φ×(φ×ρ),      wall: e → t + φ×t + ½ φ×(φ×t),   θ → φ·t,

because exp([φ]×) is the parallel transport to the new tangent followed by the turn φ·t about it, up to third order. A
gradient g at ρ (or t) adds
ρ×g to that of φ, and ½ (ρ gᵀ + g ρᵀ) − (ρ·g) I to the Hessian. The rows and columns of attached nodes leave the band
for the border.
"""

from __future__ import annotations

from ...jit import kernel


@kernel
def _turning(base, arm, k, g0, g1, g2, body_hessian):
    """½ (a gᵀ + g aᵀ) − (a·g) I on a body's rotation block."""
    product = arm[k, 0] * g0 + arm[k, 1] * g1 + arm[k, 2] * g2
    for m in range(3):
        gm = g0 if m == 0 else (g1 if m == 1 else g2)
        for n in range(3):
            gn = g0 if n == 0 else (g1 if n == 1 else g2)
            body_hessian[base + 3 + m, base + 3 + n] += 0.5 * (arm[k, m] * gn + gm * arm[k, n])
        body_hessian[base + 3 + m, base + 3 + m] -= product


@kernel
def arm_jacobian(axes, arm, k, c, n):
    """Entry (c, n) of ∂(a_c·x)/∂(X, φ) = [a_cᵀ, (ρ × a_c)ᵀ] for the direction a_c of an unknown."""
    if n < 3:
        return axes[c, n]
    i, j = (n - 2) % 3, (n - 1) % 3
    return arm[k, i] * axes[c, j] - arm[k, j] * axes[c, i]


@kernel
def hand_gradient_to_bodies(
    attached_unknown,
    attached_free,
    arm,
    wall_free,
    tangent,
    edge_gradient,
    edge_count,
    gradient,
    attached_gradient_out,
    body_gradient_out,
):
    """Move the gradient of attached nodes and walls to their bodies; attached nodes keep none.

    `arm` is ρ of each attached node [m], shape (n_attached, 3); bodies are numbered among the free ones, −1 for
    prescribed bodies.
    """
    for k in range(attached_unknown.shape[0]):
        a, f = attached_unknown[k], attached_free[k]
        g0, g1, g2 = gradient[a], gradient[a + 1], gradient[a + 2]
        attached_gradient_out[k, 0], attached_gradient_out[k, 1], attached_gradient_out[k, 2] = g0, g1, g2
        for c in range(3):
            gradient[a + c] = 0.0
        if f >= 0:
            body_gradient_out[f, 0] += g0
            body_gradient_out[f, 1] += g1
            body_gradient_out[f, 2] += g2
            body_gradient_out[f, 3] += arm[k, 1] * g2 - arm[k, 2] * g1
            body_gradient_out[f, 4] += arm[k, 2] * g0 - arm[k, 0] * g2
            body_gradient_out[f, 5] += arm[k, 0] * g1 - arm[k, 1] * g0
    for k in range(wall_free.shape[0]):
        f, w = wall_free[k], edge_count + k
        if f >= 0:
            g0, g1, g2, g3 = edge_gradient[w, 0], edge_gradient[w, 1], edge_gradient[w, 2], edge_gradient[w, 3]
            body_gradient_out[f, 3] += tangent[w, 1] * g2 - tangent[w, 2] * g1 + g3 * tangent[w, 0]
            body_gradient_out[f, 4] += tangent[w, 2] * g0 - tangent[w, 0] * g2 + g3 * tangent[w, 1]
            body_gradient_out[f, 5] += tangent[w, 0] * g1 - tangent[w, 1] * g0 + g3 * tangent[w, 2]


@kernel
def hand_rows_to_bodies(axes, attached_unknown, attached_free, arm, border, body_hessian_out):
    """Add what the border holds in rows of attached nodes (their contact with other bodies) to D; the border is not
    changed.
    """
    for k in range(attached_unknown.shape[0]):
        f = attached_free[k]
        if f < 0:
            continue
        for c in range(axes.shape[0]):
            row = attached_unknown[k] + c
            for i in range(border.shape[1]):
                value = border[row, i]
                if value == 0.0:
                    continue
                for n in range(6):
                    own = value * arm_jacobian(axes, arm, k, c, n)
                    body_hessian_out[6 * f + n, i] += own
                    body_hessian_out[i, 6 * f + n] += own


@kernel
def hand_nodes_to_bodies(
    axes,
    attached_unknown,
    attached_free,
    attached_of_unknown,
    arm,
    attached_gradient,
    half_bandwidth,
    size,
    band,
    border_out,
    body_hessian_out,
):
    """Add what the band holds of attached nodes to the border U and to D; the band is not changed.

    `axes` are the directions of a node's unknowns, shape (3, 3), or (2, 3) in a plane.
    """
    for k in range(attached_unknown.shape[0]):
        a, f = attached_unknown[k], attached_free[k]
        if f < 0:
            continue
        for c in range(axes.shape[0]):
            column = a + c
            for i in range(max(0, column - half_bandwidth), min(size, column + half_bandwidth + 1)):
                value = band[column, i - column] if i >= column else band[i, column - i]
                if value == 0.0:
                    continue
                other = attached_of_unknown[i]
                if other < 0:
                    for n in range(6):
                        border_out[i, 6 * f + n] += value * arm_jacobian(axes, arm, k, c, n)
                elif attached_free[other] >= 0:
                    own, row = i - attached_unknown[other], 6 * attached_free[other]
                    for m in range(6):
                        left = value * arm_jacobian(axes, arm, other, own, m)
                        for n in range(6):
                            body_hessian_out[row + m, 6 * f + n] += left * arm_jacobian(axes, arm, k, c, n)
        _turning(
            6 * f, arm, k, attached_gradient[k, 0], attached_gradient[k, 1], attached_gradient[k, 2], body_hessian_out
        )


@kernel
def _wall_jacobian(axes, tangent, w, m, n):
    """Entry (m, n) of ∂(e, θ)/∂φ = [−[t]×; tᵀ]."""
    if m == 3:
        return tangent[w, n]
    return arm_jacobian(axes, tangent, w, m, 3 + n)


@kernel
def hand_walls_to_bodies(
    axes,
    wall_free,
    wall_joint,
    joint_a,
    joint_b,
    edge_count,
    edge_node,
    node_unknown,
    edge_unknown,
    attached_of_unknown,
    attached_unknown,
    attached_free,
    arm,
    tangent,
    edge_gradient,
    edge_hessian,
    cross_hessian,
    border_out,
    body_hessian_out,
):
    """Add the second derivatives of clamps' elements with respect to the rotation of free bodies to U and D."""
    for k in range(wall_free.shape[0]):
        f, w, x = wall_free[k], edge_count + k, wall_joint[k]
        if f < 0:
            continue
        base = 6 * f + 3
        for m in range(3):
            for n in range(3):
                total = 0.0
                for p in range(4):
                    for q in range(4):
                        h = edge_hessian[w, p, q] if p <= q else edge_hessian[w, q, p]
                        total += _wall_jacobian(axes, tangent, w, p, m) * h * _wall_jacobian(axes, tangent, w, q, n)
                body_hessian_out[base + m, base + n] += total
        _turning(6 * f, tangent, w, edge_gradient[w, 0], edge_gradient[w, 1], edge_gradient[w, 2], body_hessian_out)
        wall_first = joint_a[x] == w
        edge = joint_b[x] if wall_first else joint_a[x]
        for m in range(3):
            for q in range(4):
                total = 0.0
                for p in range(4):
                    h = cross_hessian[x, p, q] if wall_first else cross_hessian[x, q, p]
                    total += _wall_jacobian(axes, tangent, w, p, m) * h
                if q == 3:
                    border_out[edge_unknown[edge], base + m] += total
                    continue
                for end in range(2):
                    unknown = node_unknown[edge_node[edge] + end] + q
                    signed = total if end == 1 else -total
                    other = attached_of_unknown[unknown]
                    if other < 0:
                        border_out[unknown, base + m] += signed
                    elif attached_free[other] >= 0:
                        own, row = unknown - attached_unknown[other], 6 * attached_free[other]
                        for n in range(6):
                            value = signed * arm_jacobian(axes, arm, other, own, n)
                            body_hessian_out[row + n, base + m] += value
                            body_hessian_out[base + m, row + n] += value


@kernel
def hand_walls_to_bodies_in_plane(
    axes,
    normal,
    wall_free,
    wall_joint,
    joint_a,
    joint_b,
    edge_count,
    edge_node,
    node_unknown,
    attached_of_unknown,
    attached_unknown,
    attached_free,
    arm,
    frame,
    polar_hessian,
    cross_hessian,
    border_out,
    body_hessian_out,
):
    """Add the second derivatives of clamps' elements with respect to the rotation of free bodies to U and D.

    The angle of a clamp's direction is that of its body about the normal.
    """
    for k in range(wall_free.shape[0]):
        f, w, x = wall_free[k], edge_count + k, wall_joint[k]
        if f < 0:
            continue
        base = 6 * f + 3
        for m in range(3):
            for n in range(3):
                body_hessian_out[base + m, base + n] += polar_hessian[w, 2] * normal[m] * normal[n]
        wall_first = joint_a[x] == w
        edge = joint_b[x] if wall_first else joint_a[x]
        by_length, by_angle = cross_hessian[x, 2 if wall_first else 1], cross_hessian[x, 3]
        for end in range(2):
            sign = 1.0 if end == 1 else -1.0
            for c in range(2):
                unknown = node_unknown[edge_node[edge] + end] + c
                value = sign * (by_length * frame[edge, c] + by_angle * frame[edge, 2 + c])
                other = attached_of_unknown[unknown]
                if other < 0:
                    for m in range(3):
                        border_out[unknown, base + m] += value * normal[m]
                elif attached_free[other] >= 0:
                    row = 6 * attached_free[other]
                    for n in range(6):
                        held = value * arm_jacobian(axes, arm, other, unknown - attached_unknown[other], n)
                        for m in range(3):
                            body_hessian_out[row + n, base + m] += held * normal[m]
                            body_hessian_out[base + m, row + n] += held * normal[m]
