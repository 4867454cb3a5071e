"""Quadratic drag of a fluid at rest or in uniform flow, once for the whole section of a rod.

    F = −½ ρ_f Δl (w C∥ |v_t| v_t t + w C⊥ |v₁| v₁ m1 + h C⊥ |v₂| v₂ m2)        (paper, eq. 27)

v is the velocity relative to the fluid, v_t, v₁, v₂ its components along the tangent, through the thickness and
across the width; w is the
width, h the thickness of the section, Δl the Voronoi length; the layers of a section share its drag. (The paper has
the width for the sideways part as well, a flat ribbon's broad face.)

With the directions held fixed each component has a convex dissipation potential in the displacement u over a stage of
length h_t, v = u/h_t − U (U the flow):

    D = h_t ρ_f A C |v·n|³/6,    ∂D/∂u = ½ ρ_f A C |v·n| (v·n) n,    ∂²D/∂u² = ρ_f A C |v·n|/h_t n nᵀ

The drag is implicit: it cannot overshoot, however long the step. The directions move along with Newton's corrections
and end as those at the end of the stage, so that the drag has the integrator's order: held at the start of the step,
they made the stroke of a swimmer 6 % wrong at 1 ms with any integrator.
"""

from __future__ import annotations

import math

from ..jit import kernel
from ..kinematics.vector import add_row, add_upper_outer_sum, combine, combine3, cross, dot, row, scaled


@kernel
def node_directions(node, edge_before, edge_after, tangent, director1, direction_out):
    """Mean directions (t, m1, m2) at nodes, made orthonormal; written, shape (n_drag, 3, 3).

    `edge_before` and `edge_after` are the edges that meet at each of `node`; at an end they are the same.
    """
    for k in range(node.shape[0]):
        a, b = edge_before[k], edge_after[k]
        t = combine(1.0, row(tangent, a), 1.0, row(tangent, b))
        t = scaled(1.0 / math.sqrt(dot(t, t)), t)
        m = combine(1.0, row(director1, a), 1.0, row(director1, b))
        m = combine(1.0, m, -dot(m, t), t)
        m = scaled(1.0 / math.sqrt(dot(m, m)), m)
        n = cross(t, m)
        for c in range(3):
            direction_out[k, 0, c] = t[c]
            direction_out[k, 1, c] = m[c]
            direction_out[k, 2, c] = n[c]


@kernel
def drag(
    node,
    coefficient,
    direction,
    flow,
    step_length,
    position,
    origin,
    node_gradient_out,
    node_hessian_out,
    with_hessian,
):
    """Add the dissipation potential of drag and return it [J].

    Parameters
    ----------
    node : Array
        Nodes that carry drag, shape (n_drag,).
    coefficient : Array
        ρ_f A C along t, m1 and m2 [kg/m], shape (n_drag, 3).
    direction : Array
        From `node_directions`.
    flow : Array
        Velocity of the fluid [m/s], shape (3,).
    step_length : float
        [s]
    position, origin : Array
        Of nodes now and at the origin of the stage [m], shape (n_node, 3).
    node_gradient_out, node_hessian_out : Array
        Shapes (n_node, 3) and (n_node, 3, 3) (upper triangle); added to.
    with_hessian : bool
    """
    energy = 0.0
    for k in range(node.shape[0]):
        i = node[k]
        v = (
            (position[i, 0] - origin[i, 0]) / step_length - flow[0],
            (position[i, 1] - origin[i, 1]) / step_length - flow[1],
            (position[i, 2] - origin[i, 2]) / step_length - flow[2],
        )
        t, m, n = row(direction[k], 0), row(direction[k], 1), row(direction[k], 2)
        vt, vm, vn = dot(v, t), dot(v, m), dot(v, n)
        ct, cm, cn = coefficient[k, 0] * abs(vt), coefficient[k, 1] * abs(vm), coefficient[k, 2] * abs(vn)
        energy += step_length * (ct * vt * vt + cm * vm * vm + cn * vn * vn) / 6.0
        add_row(node_gradient_out, i, 0.5, combine3(ct * vt, t, cm * vm, m, cn * vn, n))
        if with_hessian:
            t_, m_, n_ = scaled(ct, t), scaled(cm, m), scaled(cn, n)
            add_upper_outer_sum(node_hessian_out, i, 1.0 / step_length, t_, t, m_, m, n_, n)
    return energy
