"""Contacts of rods off their nodes: the arm turns with the edges at the node.

A contact point that is no node is at y = x_i + Σ c_e ε_e + Σ s_e A_e over the edges before and after its node i, with
the arm A_e along the directors of each (`contact.near`). An increment (ε, θ) of an edge of length l with the tangent t
moves A_e, by the parallel transport and turn of `forces.bend_twist`, at first order with the *rate*

    ∂A/∂ε = ((t·A) I − t Aᵀ)/l,   ∂A/∂θ = t × A

and, if A is normal to t, with A′ = t × A and for a gradient g, at second order by ½ of the quadratic form

    ∂²(g·A)/∂ε²  = [(g·t)(A tᵀ + t Aᵀ) − ½ (A g⊥ᵀ + g⊥ Aᵀ)]/l²,   g⊥ = g − (g·t) t
    ∂²(g·A)/∂ε∂θ = −(g·t) A′/l,   ∂²(g·A)/∂θ² = −g·A

so that ∂y/∂ε_e = c_e I + s_e ∂A_e/∂ε_e, ∂y/∂θ_e = s_e ∂A_e/∂θ_e. A contact with the first derivative g and second
derivative M by y thus has gᵀ ∂y and ∂yᵀ M ∂y + Σ s_e ∂²(g·A_e) by node and edges. Friction's arm goes on to the face,
and its rate is frozen with the contact, as are normal and force: the slip is that of the material point at the face,
which turns with the rod, x − x̄ + rate × (motion of the edges), and linear in the unknowns.

Second derivatives are listed: `engine.linear.arms` hands them to the unknowns.
"""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import cross, dot, row


@kernel
def material_arm(at, k, along1, along2):
    """Return A_e of an arm by its parts along m1 and m2, as a tuple."""
    m1, m2 = row(at.director1, k), row(at.director2, k)
    return along1 * m1[0] + along2 * m2[0], along1 * m1[1] + along2 * m2[1], along1 * m1[2] + along2 * m2[2]


@kernel
def _write_rate(along, share, a, t, length, first, k, rate_out):
    """Write c I + s ∂A/∂ε and s ∂A/∂θ of an edge."""
    stretched, turned = along + share * dot(t, a) / length, cross(t, a)
    for c in range(3):
        for d in range(3):
            rate_out[k, c, first + d] = -share * t[c] * a[d] / length
        rate_out[k, c, first + c] += stretched
        rate_out[k, c, first + 3] = share * turned[c]


@kernel
def write_rate(surfaces, at, i, mix, a, k, rate_out):
    """Write the rate of a point at node i with the arm a, the same for both edges, to rate_out[k]: ∂y by (ε, θ) of the
    edge before, and of that after, shape (3, 8).
    """
    for side in range(2):
        e = surfaces.node_edges[i, side]
        along, share = (mix[0], mix[2]) if side == 0 else (mix[1], mix[3])
        _write_rate(along, share, a, row(at.tangent, e), at.length[e], 4 * side, k, rate_out)


@kernel
def write_material_rate(surfaces, at, k, r, rate_out):
    """Write the rate of the contact point of pair k to rate_out[r]."""
    i, mix = surfaces.near_node[k], surfaces.near_mix
    for side in range(2):
        e = surfaces.node_edges[i, side]
        a = material_arm(at, e, mix[k, 4], mix[k, 5])
        _write_rate(mix[k, side], mix[k, 2 + side], a, row(at.tangent, e), at.length[e], 4 * side, r, rate_out)


@kernel
def add_to_edges(surfaces, i, g, k, rate, gradient_out):
    """Add gᵀ ∂y to the gradients of the edges at node i."""
    for side in range(2):
        e, first = surfaces.node_edges[i, side], 4 * side
        for n in range(4):
            gradient_out[e, n] += (
                g[0] * rate[k, 0, first + n] + g[1] * rate[k, 1, first + n] + g[2] * rate[k, 2, first + n]
            )


@kernel
def _moved(rate, k, first, c, x, y, z, angle):
    """Return the displacement of component c of an arm by the motion of an edge [m]."""
    return rate[k, c, first] * x + rate[k, c, first + 1] * y + rate[k, c, first + 2] * z + rate[k, c, first + 3] * angle


@kernel
def add_motion_of_arm(surfaces, strands, i, k, rate, position, origin, angle, origin_angle, out):
    """Add to `out` what an arm has moved by since edges had other positions and angles."""
    for side in range(2):
        e, first = surfaces.node_edges[i, side], 4 * side
        n = strands.edge_node[e]
        x = (position[n + 1, 0] - origin[n + 1, 0]) - (position[n, 0] - origin[n, 0])
        y = (position[n + 1, 1] - origin[n + 1, 1]) - (position[n, 1] - origin[n, 1])
        z = (position[n + 1, 2] - origin[n + 1, 2]) - (position[n, 2] - origin[n, 2])
        for c in range(3):
            out[c] += _moved(rate, k, first, c, x, y, z, angle[e] - origin_angle[e])


@kernel
def add_step_of_arm(surfaces, strands, i, k, rate, node_step, angle_step, out):
    """Add to `out` what an arm moves by in a step of nodes and angles, at first order."""
    for side in range(2):
        e, first = surfaces.node_edges[i, side], 4 * side
        n = strands.edge_node[e]
        x, y = node_step[n + 1, 0] - node_step[n, 0], node_step[n + 1, 1] - node_step[n, 1]
        z = node_step[n + 1, 2] - node_step[n, 2]
        for c in range(3):
            out[c] += _moved(rate, k, first, c, x, y, z, angle_step[e])


@kernel
def copy_rate(rate, k, rate_out, r):
    """Write rate_out[r] = rate[k]."""
    for c in range(3):
        for n in range(8):
            rate_out[r, c, n] = rate[k, c, n]


@kernel
def new_arm(sums, i):
    """Take a slot in the list of contacts with an arm for a contact at node i, and return it."""
    r = sums.arms[0]
    sums.arm_node[r], sums.arm_curved[r] = i, False
    sums.arms[0] = r + 1
    return r


@kernel
def write_curvature(surfaces, at, k, g, r, sums):
    """Write Σ s_e ∂²(g·A_e) of the contact point of pair k, by upper triangles."""
    i, mix, out = surfaces.near_node[k], surfaces.near_mix, sums.arm_curvature
    out[r], sums.arm_curved[r] = 0.0, True
    for side in range(2):
        e, first, share = surfaces.node_edges[i, side], 4 * side, mix[k, 2 + side]
        t, length = row(at.tangent, e), at.length[e]
        a = material_arm(at, e, mix[k, 4], mix[k, 5])
        turned, along = cross(t, a), dot(g, t)
        across = g[0] - along * t[0], g[1] - along * t[1], g[2] - along * t[2]
        s = share / (length * length)
        for c in range(3):
            for d in range(c, 3):
                out[r, first + c, d] = s * (
                    along * (a[c] * t[d] + t[c] * a[d]) - 0.5 * (a[c] * across[d] + across[c] * a[d])
                )
            out[r, first + c, 3] = -share * along * turned[c] / length
        out[r, first + 3, 3] = -share * dot(g, a)
