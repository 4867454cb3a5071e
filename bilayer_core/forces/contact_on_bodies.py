"""Forces and derivatives of a contact with a surface, on the node or body on one side and the body on the other.

A contact's energy is a function of the motion of a contact point relative to a point of the surface's body. With g and
the symmetric M its first and second derivatives with respect to that motion, a and ρ the arms from the bodies'
positions, and J = (1, −[a]×, −1, [ρ]×) the motion's derivative with respect to (x or X_A, φ_A, X_B, φ_B),

    gradient (g, a × g, −g, −ρ × g),   Hessian Jᵀ M J + T_A ± T_B (+ cross terms),   T = ½ (a gᵀ + g aᵀ) − (a·g) 1

(arms turn to second order, as in `engine.linear.attachments`). Where the normal turns with the surface (barrier) T_B
counts + and the cross terms are −[g]×, −[a]× [g]× and [g]× with φ_B; where it is frozen (friction) T_B counts − and
there are none. Blocks between a node and a free body ("links") are listed: the node, the body, and ∂²/∂x ∂(X, φ). Where
a rod has an arm from the node, x is the contact point at its end, and what it depends on is `forces.rod_arms`'.
"""

from __future__ import annotations

from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix
from bilayer_core.jit.record import Matrix, Vector
from bilayer_core.model.records.problem import Problem


@kernel
def condense_contact(has_contact, bodies, sums):
    """Give nodes and free bodies their share of contact."""
    if not has_contact:
        return
    for i in range(sums.node.shape[0]):
        for c in range(3):
            sums.node[i, c] += sums.contact_point[i, c]
    for f in range(bodies.body_of_free.shape[0]):
        for c in range(6):
            sums.body[f, c] += sums.contact[bodies.body_of_free[f], c]


@kernel
def add_force(gradient_out, body, sign, arm, g):
    """Add ± (g, arm × g) to the gradient of a body's (X, φ)."""
    gradient_out[body, 0] += sign * g[0]
    gradient_out[body, 1] += sign * g[1]
    gradient_out[body, 2] += sign * g[2]
    gradient_out[body, 3] += sign * (arm[1] * g[2] - arm[2] * g[1])
    gradient_out[body, 4] += sign * (arm[2] * g[0] - arm[0] * g[2])
    gradient_out[body, 5] += sign * (arm[0] * g[1] - arm[1] * g[0])


@kernel
def add_second_derivative(p, m, g, arm, lever, turning, i, r, a, b):
    """Add the second derivative of one contact to `Sums`.

    Parameters
    ----------
    p : Problem
    m : Array
        M, by its upper triangle [N/m], shape (3, 3).
    g : Array
        First derivative [N], shape (3,).
    arm, lever : Array
        a and ρ [m]; a counts only where the contact point is on a free body.
    turning : float
        1 if g turns with the surface's body, −1 if it is frozen.
    i, r, a, b : int
        The node; its arm's slot in the list, −1 without one; the body that the contact point is on, −1 for a rod's;
        the surface's body.
    """
    if a < 0:
        for c in range(3):
            for d in range(c, 3):
                if r < 0:
                    p.sums.node_hessian[i, c, d] += m[c, d]
                else:
                    p.sums.arm_matrix[r, c, d] = m[c, d]
    free = p.surfaces.free_index
    if free.shape[0] > 0 and (free[b] >= 0 or (a >= 0 and free[a] >= 0)):
        add_contact_to_bodies(p, m, g, arm, lever, turning, i, r, a, b)


@kernel
def _skew(a, out):
    """Write out = [a]×, shape (3, 3)."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -a[2], a[1], -a[0]
    out[1, 0], out[2, 0], out[2, 1] = a[2], -a[1], a[0]


@piece(int, Problem, Matrix, Vector, Vector, Vector, float, int, int, int, int)
def add_contact_to_bodies(p, m, g, arm, lever, turning, i, r, a, b):
    """Add the part of `add_second_derivative` that concerns free bodies; at least one of the two bodies is free."""
    sums, free = p.sums, p.surfaces.free_index
    jacobian, upper = stack_matrix(3, 12), stack_matrix(12, 12)  # by (x or X_A, φ_A, X_B, φ_B)
    crossed_arm, crossed_lever, crossed = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    _skew(arm, crossed_arm)
    _skew(lever, crossed_lever)
    _skew(g, crossed)
    for c in range(3):
        for k in range(3):
            jacobian[c, k], jacobian[c, 3 + k] = 0.0, -crossed_arm[c, k]
            jacobian[c, 6 + k], jacobian[c, 9 + k] = 0.0, crossed_lever[c, k]
        jacobian[c, c], jacobian[c, 6 + c] = 1.0, -1.0
    for k in range(12):
        j0, j1, j2 = jacobian[0, k], jacobian[1, k], jacobian[2, k]
        v0 = m[0, 0] * j0 + m[0, 1] * j1 + m[0, 2] * j2
        v1 = m[0, 1] * j0 + m[1, 1] * j1 + m[1, 2] * j2
        v2 = m[0, 2] * j0 + m[1, 2] * j1 + m[2, 2] * j2
        for n in range(k + 1):
            upper[n, k] = jacobian[0, n] * v0 + jacobian[1, n] * v1 + jacobian[2, n] * v2
    of_arm = arm[0] * g[0] + arm[1] * g[1] + arm[2] * g[2]
    of_lever = lever[0] * g[0] + lever[1] * g[1] + lever[2] * g[2]
    for k in range(3):
        for n in range(k, 3):
            upper[3 + k, 3 + n] += 0.5 * (arm[k] * g[n] + g[k] * arm[n])
            upper[9 + k, 9 + n] += 0.5 * turning * (lever[k] * g[n] + g[k] * lever[n])
        upper[3 + k, 3 + k] -= of_arm
        upper[9 + k, 9 + k] -= turning * of_lever
    if turning > 0.0:
        for k in range(3):
            for n in range(3):
                upper[k, 9 + n] -= crossed[k, n]
                upper[6 + k, 9 + n] += crossed[k, n]
                upper[3 + k, 9 + n] -= g[k] * arm[n]  # −[a]× [g]× = (a·g) 1 − g aᵀ
            upper[3 + k, 9 + k] += of_arm
    row_a, row_b = 6 * free[a] if a >= 0 else -1, 6 * free[b]  # negative where not free
    for k in range(12):
        row = row_a + k if k < 6 else row_b + k - 6
        if (row_a if k < 6 else row_b) < 0:
            continue
        for n in range(k, 12):
            column = row_a + n if n < 6 else row_b + n - 6
            if (row_a if n < 6 else row_b) < 0:
                continue
            sums.body_hessian[row, column] += upper[k, n]
            if n > k:
                sums.body_hessian[column, row] += upper[k, n]
    if a < 0:
        link = sums.links[0]
        sums.link_node[link], sums.link_arm[link], sums.link_body[link] = i, r, free[b]
        for k in range(3):
            for n in range(6):
                sums.link_hessian[link, k, n] = upper[k, 6 + n]
        sums.links[0] = link + 1
    return 0
