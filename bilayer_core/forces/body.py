"""Inertia and damping of free rigid bodies.

A body is the continuum of its mass points y = X + R r. Their squared distance from where inertia alone would take
them is

    m/(2h²) |X − X̃|² + tr((R − R̃) J (R − R̃)ᵀ)/(2h²),    J = ∫ r rᵀ dm = ½ tr(I) 1 − I

(Ferguson et al. 2021, eq. 6; X̃ and R̃ come from the integrator). With R → exp([φ]×) R, A = R̃ J Rᵀ and ax(A) = (A₃₂
− A₂₃, A₁₃ − A₃₁, A₂₁ − A₁₂):

    gradient −ax(A)/h²,    Hessian (tr(A) 1 − ½ (A + Aᵀ))/h²

With R = E R̃, N = E − 1 and S = R̃ J R̃ᵀ, which is symmetric, A = S + S Nᵀ, ax(A) = ax(S Nᵀ), and the energy of turning is
tr(N S Nᵀ)/(2h²). N = 2 w [q]× + 2 [q]×² with the quaternion (w, q) of E: short steps and slow turns keep their digits.

Mass damping is the same with R̃ = Rₙ and α/h in place of 1/h².
"""

from __future__ import annotations

from ..jit import kernel
from ..jit.stack import stack_matrix
from ..kinematics.turning import real_part


@kernel
def body_spring(
    mass,
    second_moment,
    factor,
    position,
    rotation,
    reference_position,
    reference_rotation,
    body_gradient_out,
    body_hessian_out,
    with_hessian,
):
    """Add ½ factor (m |X − X_ref|² + tr((R − R_ref) J (R − R_ref)ᵀ)) of every free body and return it [J].

    Parameters
    ----------
    mass, second_moment : Array
        m [kg], shape (n_free,); J in the body's frame [kg m²], shape (n_free, 3, 3).
    factor : float
        1/h² for inertia, α/h for damping [1/s²].
    position, rotation, reference_position, reference_rotation : Array
        Shapes (n_free, 3), (n_free, 3, 3).
    body_gradient_out, body_hessian_out : Array
        ∂/∂(X, φ), shape (n_free, 6), and ∂², shape (6 n_free, 6 n_free); added to.
    with_hessian : bool
    """
    energy = 0.0
    for b in range(mass.shape[0]):
        weight = factor * mass[b]
        for i in range(3):
            difference = position[b, i] - reference_position[b, i]
            energy += 0.5 * weight * difference * difference
            body_gradient_out[b, i] += weight * difference
        # A = R_ref J Rᵀ, and the energy from the columns of R − R_ref (no cancellation)
        a = stack_matrix(3, 3)
        for i in range(3):
            for j in range(3):
                a[i, j] = 0.0
                for k in range(3):
                    for m in range(3):
                        jkm = second_moment[b, k, m]
                        a[i, j] += reference_rotation[b, i, k] * jkm * rotation[b, j, m]
                        if i == j:
                            dk = rotation[b, i, k] - reference_rotation[b, i, k]
                            dm = rotation[b, i, m] - reference_rotation[b, i, m]
                            energy += 0.5 * factor * dk * jkm * dm
        body_gradient_out[b, 3] -= factor * (a[2, 1] - a[1, 2])
        body_gradient_out[b, 4] -= factor * (a[0, 2] - a[2, 0])
        body_gradient_out[b, 5] -= factor * (a[1, 0] - a[0, 1])
        if with_hessian:
            trace = a[0, 0] + a[1, 1] + a[2, 2]
            base = 6 * b
            for i in range(3):
                body_hessian_out[base + i, base + i] += weight
                body_hessian_out[base + 3 + i, base + 3 + i] += factor * trace
                for j in range(3):
                    body_hessian_out[base + 3 + i, base + 3 + j] -= 0.5 * factor * (a[i, j] + a[j, i])
    return energy


@kernel
def _second_moment_turned(second_moment, f, rotation, out):
    """S = R J Rᵀ of free body f in the world's axes [kg m²], shape (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.0
            for k in range(3):
                for m in range(3):
                    out[i, j] += rotation[f, i, k] * second_moment[f, k, m] * rotation[f, j, m]


@kernel
def _turn_less_one(turned, f, out):
    """N = E − 1 for the quaternion with the vector part turned[f], shape (3, 3)."""
    q0, q1, q2, w = turned[f, 0], turned[f, 1], turned[f, 2], real_part(turned, f)
    out[0, 0], out[1, 1], out[2, 2] = -2.0 * (q1 * q1 + q2 * q2), -2.0 * (q0 * q0 + q2 * q2), -2.0 * (q0 * q0 + q1 * q1)
    out[0, 1], out[1, 0] = 2.0 * (q0 * q1 - w * q2), 2.0 * (q0 * q1 + w * q2)
    out[0, 2], out[2, 0] = 2.0 * (q0 * q2 + w * q1), 2.0 * (q0 * q2 - w * q1)
    out[1, 2], out[2, 1] = 2.0 * (q1 * q2 - w * q0), 2.0 * (q1 * q2 + w * q0)


@kernel
def _times_transposed(left, right, out):
    for i in range(3):
        for j in range(3):
            out[i, j] = left[i, 0] * right[j, 0] + left[i, 1] * right[j, 1] + left[i, 2] * right[j, 2]


@kernel
def moment_of_turn(second_moment, f, reference_rotation, turned):
    """ax(A) [kg m²] of free body f, as a tuple; parameters as for `body_inertia`."""
    s, n, a = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    _second_moment_turned(second_moment, f, reference_rotation, s)
    _turn_less_one(turned, f, n)
    _times_transposed(s, n, a)
    return a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]


@kernel
def body_inertia(
    mass,
    second_moment,
    factor,
    departure,
    turned,
    reference_rotation,
    body_gradient_out,
    body_hessian_out,
    with_hessian,
):
    """`body_spring` from where bodies are relative to the reference.

    Parameters
    ----------
    departure : Array
        X − X̃ [m], shape (n_free, 3).
    turned : Array
        Vector part q of the unit quaternion of R R̃ᵀ, by less than half a turn, shape (n_free, 3).
    reference_rotation : Array
        R̃, shape (n_free, 3, 3).
    """
    energy = 0.0
    s, n, a = stack_matrix(3, 3), stack_matrix(3, 3), stack_matrix(3, 3)
    for b in range(mass.shape[0]):
        weight = factor * mass[b]
        _second_moment_turned(second_moment, b, reference_rotation, s)
        _turn_less_one(turned, b, n)
        _times_transposed(s, n, a)
        for i in range(3):
            energy += 0.5 * weight * departure[b, i] * departure[b, i]
            body_gradient_out[b, i] += weight * departure[b, i]
            for j in range(3):
                energy += 0.5 * factor * n[i, j] * a[j, i]
        body_gradient_out[b, 3] -= factor * (a[2, 1] - a[1, 2])
        body_gradient_out[b, 4] -= factor * (a[0, 2] - a[2, 0])
        body_gradient_out[b, 5] -= factor * (a[1, 0] - a[0, 1])
        if with_hessian:
            trace = a[0, 0] + a[1, 1] + a[2, 2] + s[0, 0] + s[1, 1] + s[2, 2]
            base = 6 * b
            for i in range(3):
                body_hessian_out[base + i, base + i] += weight
                body_hessian_out[base + 3 + i, base + 3 + i] += factor * trace
                for j in range(3):
                    body_hessian_out[base + 3 + i, base + 3 + j] -= factor * (0.5 * (a[i, j] + a[j, i]) + s[i, j])
    return energy
