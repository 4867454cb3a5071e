"""Forces at points and moments on bodies, as potentials of one step.

A force F that keeps its direction is conservative:

    V = −F·x,    ∂V/∂x = −F,    no Hessian

A moment M that keeps its direction is not: no potential of a rotation has the gradient −M everywhere. Over a step it
has one up to second order. With R̃ the rotation that inertia predicts, Q = R R̃ᵀ the small turn beyond it, and
ax(A) = (A₃₂ − A₂₃, A₁₃ − A₃₁, A₂₁ − A₁₂):

    V = −½ M·ax(Q) = −tr(A),    A = ½ [M]× Qᵀ
    R → exp([φ]×) R:    gradient −ax(A),    Hessian tr(A) 1 − ½ (A + Aᵀ)

(the same form as inertia in `forces.body`). For Q = exp([δ]×) the moment that acts is −∂V/∂φ = M − ½ M×δ + O(δ²), and
δ is the angular acceleration times the square of the step: the error is of second order. V is work, not energy.

A load that turns with what it acts on ("follower") takes its direction from the configuration to which Newton moved
last, as drag does, and is then one of these: the step ends with the direction that it has there.
"""

from __future__ import annotations

from ..jit import kernel
from ..jit.stack import stack_matrix


@kernel
def point_force(index, force, position, gradient_out):
    """Add −Σ F·x and return it [J].

    Parameters
    ----------
    index : Array
        Node or free body on which each force acts, shape (n_force,).
    force : Array
        F [N], shape (n_force, 3).
    position : Array
        Of nodes or of free bodies [m], shape (n, 3).
    gradient_out : Array
        ∂/∂x in the first three columns, shape (n, ≥ 3); added to.
    """
    energy = 0.0
    for k in range(index.shape[0]):
        i = index[k]
        for c in range(3):
            gradient_out[i, c] -= force[k, c]
            energy -= force[k, c] * position[i, c]
    return energy


@kernel
def body_moment(index, moment, rotation, predicted_rotation, body_gradient_out, body_hessian_out, with_hessian):
    """Add −½ Σ M·ax(R R̃ᵀ) and return it [J].

    Parameters
    ----------
    index : Array
        Free body on which each moment acts, shape (n_moment,).
    moment : Array
        M [N m], shape (n_moment, 3).
    rotation, predicted_rotation : Array
        R and R̃ of free bodies, shape (n_free, 3, 3).
    body_gradient_out, body_hessian_out : Array
        ∂/∂(X, φ), shape (n_free, 6), and ∂², shape (6 n_free, 6 n_free); added to.
    with_hessian : bool
    """
    energy = 0.0
    for k in range(index.shape[0]):
        b = index[k]
        # row i of [M]× R̃ is that of the cross products of M with the columns of R̃
        a = stack_matrix(3, 3)
        for j in range(3):
            a[0, j] = a[1, j] = a[2, j] = 0.0
            for m in range(3):
                r0, r1, r2 = predicted_rotation[b, 0, m], predicted_rotation[b, 1, m], predicted_rotation[b, 2, m]
                half = 0.5 * rotation[b, j, m]
                a[0, j] += half * (moment[k, 1] * r2 - moment[k, 2] * r1)
                a[1, j] += half * (moment[k, 2] * r0 - moment[k, 0] * r2)
                a[2, j] += half * (moment[k, 0] * r1 - moment[k, 1] * r0)
        trace = a[0, 0] + a[1, 1] + a[2, 2]
        energy -= trace
        body_gradient_out[b, 3] -= a[2, 1] - a[1, 2]
        body_gradient_out[b, 4] -= a[0, 2] - a[2, 0]
        body_gradient_out[b, 5] -= a[1, 0] - a[0, 1]
        if with_hessian:
            base = 6 * b + 3
            for i in range(3):
                body_hessian_out[base + i, base + i] += trace
                for j in range(3):
                    body_hessian_out[base + i, base + j] -= 0.5 * (a[i, j] + a[j, i])
    return energy
