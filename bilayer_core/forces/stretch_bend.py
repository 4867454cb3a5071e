"""Stretching that bends, where a curve is off the neutral axis of its section.

A joint's natural curvature follows the strains of its two edges (`model.laminate`): with r = κ₁ − κ̄₁ and

    κ̄₁ = κ̄₁(rest) + b_a ε_a + b_b ε_b,   ε = |e|/|ē| − 1,

the energy is ½ k₁ r². `bend_twist`, given this κ̄₁, adds the derivatives through κ₁; what is left is, with t the
tangent of an edge and P = I − t tᵀ,

    ∂/∂e_i      −k₁ r b_i t_i/|ē_i|
    ∂²/∂e_i²    k₁ b_i² t_i t_iᵀ/|ē_i|² − k₁ r b_i P_i/(|ē_i| |e_i|) − k₁ (∂κ₁/∂e_i t_iᵀ + t_i ∂κ₁/∂e_iᵀ) b_i/|ē_i|
    ∂²/∂e_a∂e_b k₁ b_a b_b t_a t_bᵀ/(|ē_a| |ē_b|) − k₁ b_a t_a ∂κ₁/∂e_bᵀ/|ē_a| − k₁ b_b ∂κ₁/∂e_a t_bᵀ/|ē_b|

and the products of t_i with ∂κ₁/∂θ. ∂κ₁/∂e and ∂κ₁/∂θ are those of `bend_twist`.
"""

from __future__ import annotations

from ..jit import kernel
from ..kinematics.vector import (
    add_column,
    add_outer,
    add_row,
    add_upper_outer,
    add_upper_projector,
    add_upper_symmetric,
    combine,
    combine3,
    dot,
    row,
    scaled,
)


@kernel
def natural_curvature(joint, slope, edge_a, edge_b, rest_length, length, joint_rest, rest_out):
    """Write κ̄₁ of the coupled joints at the present strains into the first column of `rest_out` [rad].

    Parameters
    ----------
    joint, slope : Array
        Coupled joints and b/|ē| of their two edges [rad/m], 0 for a wall, shapes (n,), (n, 2).
    edge_a, edge_b, joint_rest : Array
        Of all joints, shapes (n_joint,), (n_joint, 3).
    rest_length, length : Array
        |ē| of edges and present |e| of edges and walls [m].
    """
    for i in range(joint.shape[0]):
        k = joint[i]
        shift = 0.0
        if slope[i, 0] != 0.0:
            shift += slope[i, 0] * (length[edge_a[k]] - rest_length[edge_a[k]])
        if slope[i, 1] != 0.0:
            shift += slope[i, 1] * (length[edge_b[k]] - rest_length[edge_b[k]])
        rest_out[k, 0] = joint_rest[k, 0] + shift


@kernel
def stretch_bend(
    joint,
    slope,
    edge_a,
    edge_b,
    stiffness,
    rest,
    strain,
    length,
    tangent,
    director1,
    director2,
    edge_gradient_out,
    edge_hessian_out,
    cross_hessian_out,
    with_hessian,
):
    """Add the derivatives of bending through κ̄₁ to the edge accumulators.

    Parameters
    ----------
    joint, slope, edge_a, edge_b, length
        As for `natural_curvature`.
    stiffness, rest, strain : Array
        k₁ k₂ k₃ [N m]; κ̄₁ κ̄₂ ψ̄ at the present strains and κ₁ κ₂ ψ [rad] of all joints, shape (n_joint, 3).
    tangent, director1, director2 : Array
        Of edges and walls, shape (n_edge + n_wall, 3).
    edge_gradient_out, edge_hessian_out, cross_hessian_out : Array
        As for `bend_twist`; added to.
    with_hessian : bool
    """
    for i in range(joint.shape[0]):
        k = joint[i]
        ka, kb = edge_a[k], edge_b[k]
        sa, sb = slope[i, 0], slope[i, 1]  # ∂κ̄₁/∂e = s t
        k1 = stiffness[k, 0]
        moment = k1 * (strain[k, 0] - rest[k, 0])
        a, b = row(tangent, ka), row(tangent, kb)
        add_row(edge_gradient_out, ka, -moment * sa, a)
        add_row(edge_gradient_out, kb, -moment * sb, b)
        if not with_hessian:
            continue
        m1a, m2a = row(director1, ka), row(director2, ka)
        m1b, m2b = row(director1, kb), row(director2, kb)
        ab = dot(a, b)
        ic = 1.0 / (1.0 + ab)
        kappa = strain[k, 0]
        ua = combine3(ab, m1a, 1.0, combine(1.0, m1b, -dot(a, m1b), a), kappa, combine(1.0, b, -ab, a))
        wb = combine3(ab, m1b, 1.0, combine(1.0, m1a, -dot(b, m1a), b), -kappa, combine(1.0, a, -ab, b))
        da, db = scaled(-ic / length[ka], ua), scaled(ic / length[kb], wb)  # ∂κ₁/∂e
        ta, tb = dot(b, m2a) * ic, -dot(a, m2b) * ic  # ∂κ₁/∂θ
        add_upper_outer(edge_hessian_out, ka, k1 * sa * sa, a)
        add_upper_outer(edge_hessian_out, kb, k1 * sb * sb, b)
        add_upper_projector(edge_hessian_out, ka, -moment * sa / length[ka], a)
        add_upper_projector(edge_hessian_out, kb, -moment * sb / length[kb], b)
        add_upper_symmetric(edge_hessian_out, ka, -k1 * sa, a, da)
        add_upper_symmetric(edge_hessian_out, kb, -k1 * sb, b, db)
        add_column(edge_hessian_out, ka, 3, -k1 * sa * ta, a)
        add_column(edge_hessian_out, kb, 3, -k1 * sb * tb, b)
        add_outer(cross_hessian_out, k, -k1 * sa, a, combine(1.0, db, -sb, b))
        add_outer(cross_hessian_out, k, -k1 * sb, da, b)
        add_column(cross_hessian_out, k, 3, -k1 * sa * tb, a)
        for n in range(3):
            cross_hessian_out[k, 3, n] -= k1 * sb * ta * b[n]
