"""Inertia and damping of free rigid bodies.

A body is the continuum of its mass points y = X + R r. Their squared distance from where inertia alone would take
them is

    m/(2h²) |X − X̃|² + tr((R − R̃) J (R − R̃)ᵀ)/(2h²),    J = ∫ r rᵀ dm = ½ tr(I) 1 − I

(Ferguson et al. 2021, eq. 6; X̃ and R̃ come from the integrator). With R → exp([φ]×) R, A = R̃ J Rᵀ and ax(A) = (A₃₂
− A₂₃, A₁₃ − A₃₁, A₂₁ − A₁₂):

    gradient −ax(A)/h²,    Hessian (tr(A) 1 − ½ (A + Aᵀ))/h²

Mass damping is the same with R̃ = Rₙ and α/h in place of 1/h².
"""

from __future__ import annotations

from ..jit import kernel
from ..kinematics.stack import stack_matrix


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
