"""Derivatives of a contact, handed to the node or body on one side and to the body on the other.

A contact is a function of the motion of a carrier relative to a point of the surface's body. With g and the symmetric M
its first and second derivatives with respect to that motion, a and ρ the arms from the bodies' positions, and
J = (1, −[a]×, −1, [ρ]×) the motion's derivative with respect to (x or X_A, φ_A, X_B, φ_B),

    gradient (g, a × g, −g, −ρ × g),   Hessian Jᵀ M J + T_A ± T_B (+ cross terms),   T = ½ (a gᵀ + g aᵀ) − (a·g) 1

(arms turn to second order, as in `engine.linear.attachments`). Where the normal turns with the surface (barrier) T_B
counts + and the cross terms are −[g]×, −[a]× [g]× and [g]× with φ_B;
where it is frozen (friction) T_B counts − and there are none.
Blocks between a node and a free body ("links") are listed: the node, the body, and ∂²/∂x ∂(X, φ).
"""

from __future__ import annotations

from ..jit import kernel
from ..jit.stack import stack_matrix


@kernel
def add_force(contact_out, body, sign, arm, g):
    """Add ± (g, arm × g) to the gradient of a body's (X, φ)."""
    contact_out[body, 0] += sign * g[0]
    contact_out[body, 1] += sign * g[1]
    contact_out[body, 2] += sign * g[2]
    contact_out[body, 3] += sign * (arm[1] * g[2] - arm[2] * g[1])
    contact_out[body, 4] += sign * (arm[2] * g[0] - arm[0] * g[2])
    contact_out[body, 5] += sign * (arm[0] * g[1] - arm[1] * g[0])


@kernel
def _skew(a, out):
    """out = [a]×, shape (3, 3)."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -a[2], a[1], -a[0]
    out[1, 0], out[2, 0], out[2, 1] = a[2], -a[1], a[0]


@kernel
def _local_hessian(m, g, arm, lever, turning, local):
    """The Hessian with respect to (x or X_A, φ_A, X_B, φ_B), shape (12, 12)."""
    jacobian = stack_matrix(3, 12)
    crossed_arm, crossed_lever, crossed = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    _skew(arm, crossed_arm)
    _skew(lever, crossed_lever)
    for c in range(3):
        for p in range(3):
            jacobian[c, p], jacobian[c, 3 + p] = 0.0, -crossed_arm[c, p]
            jacobian[c, 6 + p], jacobian[c, 9 + p] = 0.0, crossed_lever[c, p]
        jacobian[c, c], jacobian[c, 6 + c] = 1.0, -1.0
    for p in range(12):
        v0 = m[0, 0] * jacobian[0, p] + m[0, 1] * jacobian[1, p] + m[0, 2] * jacobian[2, p]
        v1 = m[0, 1] * jacobian[0, p] + m[1, 1] * jacobian[1, p] + m[1, 2] * jacobian[2, p]
        v2 = m[0, 2] * jacobian[0, p] + m[1, 2] * jacobian[1, p] + m[2, 2] * jacobian[2, p]
        for q in range(12):
            local[q, p] = jacobian[0, q] * v0 + jacobian[1, q] * v1 + jacobian[2, q] * v2
    of_arm, of_lever = 0.0, 0.0
    for p in range(3):
        of_arm += arm[p] * g[p]
        of_lever += lever[p] * g[p]
    for p in range(3):
        for q in range(3):
            local[3 + p, 3 + q] += 0.5 * (arm[p] * g[q] + g[p] * arm[q])
            local[9 + p, 9 + q] += 0.5 * turning * (lever[p] * g[q] + g[p] * lever[q])
        local[3 + p, 3 + p] -= of_arm
        local[9 + p, 9 + p] -= turning * of_lever
    if turning > 0.0:
        _skew(g, crossed)
        for p in range(3):
            for q in range(3):
                local[p, 9 + q] -= crossed[p, q]
                local[9 + p, q] += crossed[p, q]
                local[6 + p, 9 + q] += crossed[p, q]
                local[9 + p, 6 + q] -= crossed[p, q]
                # −[a]× [g]× = (a·g) 1 − g aᵀ
                value = (of_arm if p == q else 0.0) - g[p] * arm[q]
                local[3 + p, 9 + q] += value
                local[9 + q, 3 + p] += value


@kernel
def add_coupled(
    m,
    g,
    arm,
    lever,
    turning,
    i,
    a,
    b,
    free_index,
    node_hessian_out,
    body_hessian_out,
    links,
    link_node_out,
    link_body_out,
    link_hessian_out,
):
    """Add the second derivative of one contact; return the number of links listed so far.

    Parameters
    ----------
    m : Array
        M, by its upper triangle [N/m], shape (3, 3).
    g : Array
        First derivative [N], shape (3,).
    arm, lever : Array
        a and ρ [m]; a counts only where the carrier is on a free body.
    turning : float
        1 if g turns with the surface's body, −1 if it is frozen.
    i, a, b : int
        The carrier; the body that carries it, −1 if it is a node with unknowns of its own; the surface's body.
    free_index : Array or None
        Places of all bodies among the free ones or −1; None if no body is free.
    node_hessian_out : Array
        Of nodes, upper triangles, shape (n_node, 3, 3); added to.
    body_hessian_out : Array
        Of free bodies' (X, φ), shape (6 n_free, 6 n_free); added to.
    links : int
        Links listed so far.
    link_node_out, link_body_out, link_hessian_out : Array
        Written: node, free body and block of each link, shapes (·,), (·,), (·, 3, 6).
    """
    if a < 0:
        for p in range(3):
            for q in range(p, 3):
                node_hessian_out[i, p, q] += m[p, q]
    if free_index.shape[0] == 0:
        return links
    free_a, free_b = free_index[a] if a >= 0 else -1, free_index[b]
    if free_a < 0 and free_b < 0:
        return links
    local = stack_matrix(12, 12)
    _local_hessian(m, g, arm, lever, turning, local)
    if free_a >= 0:
        row = 6 * free_a
        for p in range(6):
            for q in range(6):
                body_hessian_out[row + p, row + q] += local[p, q]
    if free_b >= 0:
        row = 6 * free_b
        for p in range(6):
            for q in range(6):
                body_hessian_out[row + p, row + q] += local[6 + p, 6 + q]
    if free_a >= 0 and free_b >= 0:
        row, column = 6 * free_a, 6 * free_b
        for p in range(6):
            for q in range(6):
                body_hessian_out[row + p, column + q] += local[p, 6 + q]
                body_hessian_out[column + q, row + p] += local[p, 6 + q]
    if a < 0 and free_b >= 0:
        link_node_out[links] = i
        link_body_out[links] = free_b
        for p in range(3):
            for q in range(6):
                link_hessian_out[links, p, q] = local[p, 6 + q]
        links += 1
    return links
