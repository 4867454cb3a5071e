"""Stretching of an edge with eigenstrain.

    S = ½ EA (ε − η)² |ē|,   ε = |e|/|ē| − 1        (paper, eqs. 3 and 4; η subtracted, weight the rest length)

With n = EA (ε − η) the axial force, t the tangent and P = I − t tᵀ:

    ∂S/∂e = n t,   ∂²S/∂e² = EA/|ē| t tᵀ + n/|e| P
"""

from __future__ import annotations

from ..jit import kernel
from ..kinematics.vector import add_row, add_upper_outer, add_upper_projector, row


@kernel
def stretch(
    axial_stiffness, rest_length, eigenstrain, length, tangent, edge_gradient_out, edge_hessian_out, with_hessian
):
    """Add stretching to the edge accumulators and return its energy [J].

    Parameters
    ----------
    axial_stiffness, rest_length, eigenstrain : Array
        EA [N], |ē| [m], η of each edge, shape (n_edge,).
    length, tangent : Array
        Present |e| [m] and unit tangent, shapes (≥ n_edge,), (≥ n_edge, 3).
    edge_gradient_out : Array
        ∂/∂(e, θ) of each edge, shape (≥ n_edge, 4); added to.
    edge_hessian_out : Array
        Upper triangle of ∂²/∂(e, θ)², shape (≥ n_edge, 4, 4); added to.
    with_hessian : bool
    """
    energy = 0.0
    for k in range(axial_stiffness.shape[0]):
        strain = length[k] / rest_length[k] - 1.0 - eigenstrain[k]
        force = axial_stiffness[k] * strain
        energy += 0.5 * force * strain * rest_length[k]
        t = row(tangent, k)
        add_row(edge_gradient_out, k, force, t)
        if with_hessian:
            add_upper_outer(edge_hessian_out, k, axial_stiffness[k] / rest_length[k], t)
            add_upper_projector(edge_hessian_out, k, force / length[k], t)
    return energy
