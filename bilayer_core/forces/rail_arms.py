"""Derivatives of rails (`contact.rails`) by the edges at their nodes.

The arm of a rail is the mean of A = h m1 + b m2 over the edges before and after its node (at an end there is one edge,
alone). An increment (ε, θ) of an edge of length l with the tangent t moves A, by the parallel transport and turn of
`forces.bend_twist`, at first order with the *rate*

    ∂A/∂ε = −t Aᵀ/l,   ∂A/∂θ = t × A

and for a gradient g at second order by ½ of the quadratic form

    ∂²(g·A)/∂ε²  = [(g·t)(A tᵀ + t Aᵀ) − ½ (A g⊥ᵀ + g⊥ Aᵀ)]/l²,   g⊥ = g − (g·t) t
    ∂²(g·A)/∂ε∂θ = −(g·t) t × A/l,   ∂²(g·A)/∂θ² = −g·A

A gradient g at a rail is g at its node and gᵀ ∂A/∂(ε, θ) at the edges. Rates have four columns of the edge before, then
four of that after.
"""

from __future__ import annotations

from bilayer_core.contact.rails import has_arm
from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import combine, cross, dot, row


@kernel
def _share(rails, i):
    """Return the part that each edge at a node has in arms, and the number of these edges."""
    return (1.0, 1) if rails.node_edges[i, 0] == rails.node_edges[i, 1] else (0.5, 2)


@kernel
def _first(strands, i, e):
    """Return the first column of an edge in the rate of a rail."""
    return 4 if strands.edge_node[e] == i else 0


@kernel
def _arm(rails, at, r, e):
    """Return A of a rail by the directors of an edge, as a tuple [m]."""
    return combine(rails.arm[r, 0], row(at.director1, e), rails.arm[r, 1], row(at.director2, e))


@kernel
def note_rails(rails, contacts, noted_out):
    """Note the rails that have a part in contacts, and the left ones at their nodes."""
    noted_out[:] = False
    for c in range(contacts.count[0]):
        for side in range(2):
            for first in (contacts.node[c, side], contacts.right[c, side]):
                if first >= 0:
                    for r in range(first, first + 2):
                        noted_out[r] = noted_out[rails.node[r]] = True


@kernel
def touches(rails, strands, e):
    """Return whether a rail at a node of an edge has a part in a contact found last."""
    i = strands.edge_node[e]
    return rails.meets[i] or rails.meets[i + 1]


@kernel
def write_rail_rates(rails, strands, at, noted, rate_out):
    """Write the rates of all noted rails with an arm, shape (n_rail, 3, 8)."""
    for r in range(rails.node.shape[0]):
        if not (noted[r] and has_arm(rails, r)):
            continue
        i = rails.node[r]
        rate_out[r] = 0.0
        share, count = _share(rails, i)
        for side in range(count):
            e = rails.node_edges[i, side]
            first, t, a, length = _first(strands, i, e), row(at.tangent, e), _arm(rails, at, r, e), at.length[e]
            turned = cross(t, a)
            for c in range(3):
                for d in range(3):
                    rate_out[r, c, first + d] = -share * t[c] * a[d] / length
                rate_out[r, c, first + 3] = share * turned[c]


@kernel
def hand_on(rails, strands, gradient, rate, node_out, edge_out):
    """Add a gradient by rails to those by nodes and edges."""
    for r in range(rails.node.shape[0]):
        i, g0, g1, g2 = rails.node[r], gradient[r, 0], gradient[r, 1], gradient[r, 2]
        if g0 == 0.0 and g1 == 0.0 and g2 == 0.0:
            continue
        node_out[i, 0] += g0
        node_out[i, 1] += g1
        node_out[i, 2] += g2
        if not has_arm(rails, r):
            continue
        _, count = _share(rails, i)
        for side in range(count):
            e = rails.node_edges[i, side]
            first = _first(strands, i, e)
            for n in range(4):
                edge_out[e, n] += g0 * rate[r, 0, first + n] + g1 * rate[r, 1, first + n] + g2 * rate[r, 2, first + n]


@kernel
def arm_motion(rails, strands, rate, node_vectors, angles, r, c):
    """Return the component c of what the arm of a rail moves by, at first order, with its nodes and edges."""
    i, moved = rails.node[r], 0.0
    _, count = _share(rails, i)
    for side in range(count):
        e = rails.node_edges[i, side]
        first, n = _first(strands, i, e), strands.edge_node[e]
        for d in range(3):
            moved += rate[r, c, first + d] * (node_vectors[n + 1, d] - node_vectors[n, d])
        moved += rate[r, c, first + 3] * angles[e]
    return moved


@kernel
def write_rail_motions(rails, strands, noted, rate, node_vectors, angles, out):
    """Write the motions of noted rails at first order, from those of nodes and the turns of edges."""
    for r in range(rails.node.shape[0]):
        for c in range(3 if noted[r] else 0):
            out[r, c] = node_vectors[rails.node[r], c]
            if has_arm(rails, r):
                out[r, c] += arm_motion(rails, strands, rate, node_vectors, angles, r, c)


@kernel
def write_rail_slips(rails, strands, stage, at):
    """Write the motions of rails that rub since the origin of a stage with frozen rates [m]."""
    motion, turn = rails.node_motion, rails.turn
    for r in range(rails.node.shape[0]):
        if not rails.rubs[r]:
            continue
        for side in range(2):
            e = rails.node_edges[rails.node[r], side]
            turn[e] = at.total_angle[e] - stage.origin_angle[e]
            for i in range(strands.edge_node[e], strands.edge_node[e] + 2):
                for c in range(3):
                    motion[i, c] = at.position[i, c] - stage.origin_position[i, c]
    write_rail_motions(rails, strands, rails.rubs, rails.slip_rate, motion, turn, rails.slip)


@kernel
def write_rail_curvature(rails, strands, at):
    """Write the second derivatives of arms times `Rails.gradient` by the edges that touch, shape (n_edge, 4, 4)."""
    out = rails.curvature
    for e in range(out.shape[0]):
        if touches(rails, strands, e):
            out[e] = 0.0
    for r in range(rails.node.shape[0]):
        i, g = rails.node[r], row(rails.gradient, r)
        if not has_arm(rails, r) or (g[0] == 0.0 and g[1] == 0.0 and g[2] == 0.0):
            continue
        share, count = _share(rails, i)
        for side in range(count):
            e = rails.node_edges[i, side]
            t, a, length = row(at.tangent, e), _arm(rails, at, r, e), at.length[e]
            turned, along = cross(t, a), dot(g, t)
            across = g[0] - along * t[0], g[1] - along * t[1], g[2] - along * t[2]
            s = share / (length * length)
            for c in range(3):
                for d in range(3):
                    out[e, c, d] += s * (
                        along * (a[c] * t[d] + t[c] * a[d]) - 0.5 * (a[c] * across[d] + across[c] * a[d])
                    )
                out[e, c, 3] -= share * along * turned[c] / length
            out[e, 3, 3] -= share * dot(g, a)
