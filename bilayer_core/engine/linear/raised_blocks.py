"""Raised edges in the Newton matrix: second derivatives by the positions of their two nodes and their angle.

By x₀, x₁ and w = m1 as if it were free (`forces.raised`) there are masses and what a fluid adds, with M₀ and M₁ of the
two halves, which it moves at the height z:

    A₀ = ∂²/∂x₀∂w = f a + z M₀,   A₁ = f b + z M₁,   C = ∂²/∂w² = f c + z² (M₀ + M₁)

With ∂w = −t (w·ε)/l + θ m2, the pull g and ε = x₁ − x₀ the blocks by ε and θ are

    E = ∂²/∂ε² = (t·C t) w wᵀ/l² + ∂²(g·w)/∂ε²,   e = ∂²/∂ε∂θ = −(t·C m2) w/l − (g·t) m2/l,   m2·C m2 − g·w

and with u = A t/l those by positions

    x₀x₀: E + u₀ wᵀ + w u₀ᵀ,   x₀x₁: −E − u₀ wᵀ + w u₁ᵀ,   x₁x₁: E − u₁ wᵀ − w u₁ᵀ,   x₀θ: A₀ m2 − e,   x₁θ: A₁ m2 + e.
"""

from __future__ import annotations

from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.vector import POSITIVE, combine, combine3, dot, row, scaled
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration


@kernel
def _times(hessian, h, factor, v):
    """Return factor × M v with the symmetric M of half h by its upper triangle."""
    return (
        factor * (hessian[h, 0, 0] * v[0] + hessian[h, 0, 1] * v[1] + hessian[h, 0, 2] * v[2]),
        factor * (hessian[h, 0, 1] * v[0] + hessian[h, 1, 1] * v[1] + hessian[h, 1, 2] * v[2]),
        factor * (hessian[h, 0, 2] * v[0] + hessian[h, 1, 2] * v[1] + hessian[h, 2, 2] * v[2]),
    )


@kernel
def _by_positions(band, d0, d1, count, w, p0, p1):
    """Add x₀x₀: w p₀ᵀ + p₀ wᵀ, x₁x₁: w p₁ᵀ + p₁ wᵀ, x₀x₁: −w p₁ᵀ − p₀ wᵀ, by the first components."""
    for m in range(count):
        for n in range(count):
            if n >= m:
                band[d0 + m, n - m] += w[m] * p0[n] + p0[m] * w[n]
                band[d1 + m, n - m] += w[m] * p1[n] + p1[m] * w[n]
            band[d0 + m, (d1 + n - d0 - m) & POSITIVE] -= w[m] * p1[n] + p0[m] * w[n]


@piece(int, Problem, Configuration, float)
def assemble_raised(p, at, factor):
    """Add second derivatives of raised edges, with `factor` times the masses, to the band."""
    raised, strands, sums, band = p.raised, p.strands, p.sums, p.system.band
    hessian, in_plane = sums.raised_hessian, strands.dimension == 2
    axis1, axis2, wet = row(strands.axes, 0), row(strands.axes, 1), hessian.shape[0] > 0
    for r in range(raised.edge.shape[0]):
        k = raised.edge[r] & POSITIVE
        i, inverse, z = strands.edge_node[k] & POSITIVE, 1.0 / at.length[k], raised.middle[r]
        d0, d1, square = strands.row[i] & POSITIVE, strands.row[i + 1] & POSITIVE, inverse * inverse
        a, b = factor * raised.first_moment[r, 0], factor * raised.first_moment[r, 1]
        g, t, w, mass = row(sums.pull, r), row(at.tangent, k), row(at.director1, k), factor * raised.second_moment[r]
        along, second = dot(g, t), mass  # g·t, t·C t
        u0, u1 = scaled(a * inverse, t), scaled(b * inverse, t)
        if wet:
            f0, f1 = _times(hessian, 2 * r, z, t), _times(hessian, 2 * r + 1, z, t)
            u0, u1 = combine(1.0, u0, inverse, f0), combine(1.0, u1, inverse, f1)
            second += z * (dot(t, f0) + dot(t, f1))
        v = combine3(0.5 * square * second, w, 1.5 * square * along, t, -0.5 * square, g)  # E = w vᵀ + v wᵀ
        p0, p1 = combine(1.0, v, 1.0, u0), combine(1.0, v, -1.0, u1)
        if in_plane:
            w2, p2 = (dot(axis1, w), dot(axis2, w)), (dot(axis1, p0), dot(axis2, p0))
            _by_positions(band, d0, d1, 2, w2, p2, (dot(axis1, p1), dot(axis2, p1)))
            continue
        _by_positions(band, d0, d1, 3, w, p0, p1)
        m2, turn, turning, theta = row(at.director2, k), 0.0, mass, strands.edge_unknown[k]
        a0, a1 = scaled(a, m2), scaled(b, m2)
        if wet:
            f0, f1 = _times(hessian, 2 * r, z, m2), _times(hessian, 2 * r + 1, z, m2)
            a0, a1, both = combine(1.0, a0, 1.0, f0), combine(1.0, a1, 1.0, f1), combine(z, f0, z, f1)
            turn, turning = dot(t, both), mass + dot(m2, both)
        e = combine(-turn * inverse, w, -along * inverse, m2)
        for m in range(3):
            band[d0 + m, theta - d0 - m] += a0[m] - e[m]
            band[theta, d1 + m - theta] += a1[m] + e[m]
        band[theta, 0] += turning - dot(g, w)
    return READY
