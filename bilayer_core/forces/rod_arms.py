"""Contacts of rods off their nodes: the arm turns with the edges at the node.

A contact point with the arm A along material directions is at y = x_i + ½ Σ A_e, the mean over the edges before and
after its node i (at an end there is one edge, alone). An increment (ε, θ) of an edge of length l with the tangent t
moves A_e, by the parallel transport and turn of `forces.bend_twist`, at first order with the *rate*

    ∂A/∂ε = ((t·A) I − t Aᵀ)/l,   ∂A/∂θ = t × A

and, if A is normal to t, with A′ = t × A and for a gradient g, at second order by ½ of the quadratic form

    ∂²(g·A)/∂ε²  = [(g·t)(A tᵀ + t Aᵀ) − ½ (A g⊥ᵀ + g⊥ Aᵀ)]/l²,   g⊥ = g − (g·t) t
    ∂²(g·A)/∂ε∂θ = −(g·t) A′/l,   ∂²(g·A)/∂θ² = −g·A

A contact with the first derivative g and second derivative M by y thus has gᵀ ∂y and ∂yᵀ M ∂y + ∂²(g·A) by node and
edges. The barrier's arm is that of the contact point (`model.rod_points`). Friction's goes on to the face, and its rate
is frozen with the contact, as are normal and force: the slip is that of the material point at the face, which turns
with the rod, x − x̄ + rate × (motion of the edges), and linear in the unknowns.

Second derivatives are listed: `engine.linear.arms` hands them to the unknowns.
"""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import combine, cross, dot, row


@kernel
def node_of(surfaces, i):
    """Node of a contact point of a rod."""
    points = surfaces.rod_points
    return points.node[i - points.first] if points.exists and i >= points.first else i


@kernel
def has_arm(surfaces, i):
    """Return whether contact point i is that of a rod with an arm from a node."""
    return surfaces.rod_points.exists and i >= surfaces.rod_points.first


@kernel
def material_arm(at, k, along1, along2):
    """A_e of an arm by its parts along m1 and m2, as a tuple."""
    m1, m2 = row(at.director1, k), row(at.director2, k)
    return along1 * m1[0] + along2 * m2[0], along1 * m1[1] + along2 * m2[1], along1 * m1[2] + along2 * m2[2]


@kernel
def place_rod_points(surfaces, at):
    """Write the positions of contact points with arms [m]."""
    if not (surfaces.exists and surfaces.rod_points.exists):
        return
    points, edges, last = surfaces.rod_points, surfaces.node_edges, -1
    m1 = m2 = (0.0, 0.0, 0.0)
    for k in range(points.node.shape[0]):
        i = points.node[k]
        if i != last:
            m1 = combine(0.5, row(at.director1, edges[i, 0]), 0.5, row(at.director1, edges[i, 1]))
            m2 = combine(0.5, row(at.director2, edges[i, 0]), 0.5, row(at.director2, edges[i, 1]))
            last = i
        arm = combine(points.arm[k, 0], m1, points.arm[k, 1], m2)
        for c in range(3):
            at.rod_point[k, c] = at.position[i, c] + arm[c]


@kernel
def _side(strands, i, edge):
    """First column of an edge in rates of arms from node i: 4 of the edge that begins there, 0 of that before."""
    return 4 if strands.edge_node[edge] == i else 0


@kernel
def _write_rate(share, a, t, length, first, k, rate_out):
    """Write a share of ∂A/∂(ε, θ) of an edge."""
    along, turned = dot(t, a), cross(t, a)
    for c in range(3):
        for d in range(3):
            rate_out[k, c, first + d] = -share * t[c] * a[d] / length
        rate_out[k, c, first + c] += share * along / length
        rate_out[k, c, first + 3] = share * turned[c]


@kernel
def write_rate(surfaces, strands, at, i, a, k, rate_out):
    """Write the rate of an arm a from node i, the same for both edges, to rate_out[k]: ∂y by (ε, θ) of the edge before,
    and of that after, shape (3, 8).
    """
    rate_out[k] = 0.0
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    share = 1.0 if before == after else 0.5
    _write_rate(share, a, row(at.tangent, before), at.length[before], _side(strands, i, before), k, rate_out)
    if after != before:
        _write_rate(share, a, row(at.tangent, after), at.length[after], 4, k, rate_out)


@kernel
def write_material_rate(surfaces, strands, at, i, k, rate_out):
    """Write the rate of the arm of a contact point to rate_out[k]."""
    points = surfaces.rod_points
    node, along1, along2 = node_of(surfaces, i), points.arm[i - points.first, 0], points.arm[i - points.first, 1]
    rate_out[k] = 0.0
    before, after = surfaces.node_edges[node, 0], surfaces.node_edges[node, 1]
    share = 1.0 if before == after else 0.5
    for side in range(1 if before == after else 2):
        e = before if side == 0 else after
        a = material_arm(at, e, along1, along2)
        _write_rate(share, a, row(at.tangent, e), at.length[e], _side(strands, node, e), k, rate_out)


@kernel
def add_to_edges(surfaces, strands, i, g, k, rate, gradient_out):
    """Add gᵀ ∂y to the gradients of the edges at node i."""
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    for side in range(1 if before == after else 2):
        e = before if side == 0 else after
        first = _side(strands, i, e)
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
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    for side in range(1 if before == after else 2):
        e = before if side == 0 else after
        first, n = _side(strands, i, e), strands.edge_node[e]
        x = (position[n + 1, 0] - origin[n + 1, 0]) - (position[n, 0] - origin[n, 0])
        y = (position[n + 1, 1] - origin[n + 1, 1]) - (position[n, 1] - origin[n, 1])
        z = (position[n + 1, 2] - origin[n + 1, 2]) - (position[n, 2] - origin[n, 2])
        for c in range(3):
            out[c] += _moved(rate, k, first, c, x, y, z, angle[e] - origin_angle[e])


@kernel
def add_step_of_arm(surfaces, strands, i, k, rate, node_step, angle_step, out):
    """Add to `out` what an arm moves by in a step of nodes and angles, at first order."""
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    for side in range(1 if before == after else 2):
        e = before if side == 0 else after
        first, n = _side(strands, i, e), strands.edge_node[e]
        x, y = node_step[n + 1, 0] - node_step[n, 0], node_step[n + 1, 1] - node_step[n, 1]
        z = node_step[n + 1, 2] - node_step[n, 2]
        for c in range(3):
            out[c] += _moved(rate, k, first, c, x, y, z, angle_step[e])


@kernel
def copy_rate(rate, k, rate_out, r):
    """rate_out[r] = rate[k]"""
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
def write_curvature(surfaces, strands, at, i, g, r, sums):
    """Write ∂²(g·A) of the arm of a contact point, by upper triangles."""
    points, out = surfaces.rod_points, sums.arm_curvature
    node, along1, along2 = node_of(surfaces, i), points.arm[i - points.first, 0], points.arm[i - points.first, 1]
    out[r], sums.arm_curved[r] = 0.0, True
    before, after = surfaces.node_edges[node, 0], surfaces.node_edges[node, 1]
    share = 1.0 if before == after else 0.5
    for side in range(1 if before == after else 2):
        e = before if side == 0 else after
        first, t, length = _side(strands, node, e), row(at.tangent, e), at.length[e]
        a = material_arm(at, e, along1, along2)
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
