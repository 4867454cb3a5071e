"""Flattening: the part of a strip's energy that the three squares of bending and twist do not have.

A strip of width w that is curved by κ along and twisted by τ cannot curl across as it would without stress: that would
stretch its middle surface, by ε(y) with ε″ = τ² − κ κ_y. In-plane stresses across vanish at every point. The laminate's
energy per area is then that of the longitudinal force p and of the curvatures beyond their free values κ̄,

    ½ p²/Ẽ + ½ (κ − κ̄)ᵀ D* (κ − κ̄),   p = Ẽ ε + b κ_y + const,   b = β √(Ẽ D₂₂),   D*₂₂ = (1 − β²) D₂₂

with (κ, κ_y, 2τ) and D* of a plate without membrane forces. b = 0 unless layers differ in Poisson's ratio or are
anisotropic. At c = 0 the section is free:

    c = κ̄y − a₁ (κ − κ̄x) − 2 a₃ (τ − τ̄) − τ²/κ,   a₁ = D*₁₂/D*₂₂ (ν of like layers),   a₃ = D*₂₆/D*₂₂

Without c this is the beam of `forces.bend_twist`, and the coupling k₁₃ (κ₁ − κ̄₁)(ψ − ψ̄) of bending and twist beside
it, all with D*ᵢⱼ − D*ᵢ₂ D*₂ⱼ/D*₂₂. With c the minimum over sections with free borders is the multiplier λ of ε″,

    D₂₂ λ⁗ − 2 b κ λ″ + Ẽ κ² λ = κ c D*₂₂,   λ = λ′ = 0 at borders,   U = ½ c Ẽ κ ∫ λ dy = ½ w D*₂₂ c² (1 − g)
    g = 2 [C(u) − C(v)]/(x [S(u) + S(v)]),   u = (β + 1) x,   v = (β − 1) x,   x = ½ w² κ √(Ẽ/D₂₂)
    C(s) = cosh √s,   S(s) = sinh √s/√s

(β = 0: g = 2 (cosh ψ − cos ψ)/[ψ (sinh ψ + sin ψ)], ψ⁴ = x²). Beside the beam, with the strains of a joint, κ₁ = κ Δl
and ψ = τ Δl, with x = √Λ κ₁ and φ = (1 − g)/x², there is

    F = k₁₃ (κ₁ − κ̄₁)(ψ − ψ̄) + ½ s N² φ(√Λ κ₁; β)
    N = κ₁ c Δl = κ₁ [κ̄y Δl − a₁ (κ₁ − κ̄₁) − 2 a₃ (ψ − ψ̄)] − ψ² + θ₀²
    s = (1 − β²) w⁵ Ẽ/(4 Δl³),   Λ = w⁴ Ẽ/(4 D₂₂ Δl²)

N is a polynomial and φ is analytic, φ(0; β) = 1/180, so that nothing is special at κ = 0, where τ²/κ is infinite. θ₀
belongs to a strip that is twisted at the start: its middle surface has the metric of that shape. Ẽ, D₂₂ and κ̄x are
those of the section about its own neutral axis. Where the curve is off it, a joint's κ̄₁ is that at the strain 0 of the
curve (`model.laminate_section`): then κ̄y Δl has a₁ (κ̄x Δl − κ̄₁) with it, and k₁₃ couples twist with κ₁ − κ̄x Δl.

φ is the quotient of two entire series (`model.plate_strip.flattening_series`) up to |x| = 32, from where on g is used.
"""

from __future__ import annotations

import math

from bilayer_core.forces.elements import multiple_of_joint
from bilayer_core.jit import kernel, piece, record
from bilayer_core.jit.record import Indices, Matrix, Vector
from bilayer_core.kinematics.vector import angle, dot, row
from bilayer_core.model.plate_strip import TERMS
from bilayer_core.model.records.parts import Flattening

TWO_PI = 2.0 * math.pi
SERIES = 1024.0
"""x² below which φ is its series."""
FEW, FEWER = 64.0, 8
"""x² up to which so many of its terms are exact to rounding."""


@kernel
def _polynomial(series, i, c, z):
    """Return polynomial c of `series` for strip joint i, and its first and second derivative by z."""
    value = first = second = 0.0
    if z > FEW:
        for m in range(TERMS - FEWER):
            second, first, value = second * z + first, first * z + value, value * z + series[i, c, m]
    for m in range(TERMS - FEWER, TERMS):
        second, first, value = second * z + first, first * z + value, value * z + series[i, c, m]
    return value, first, 2.0 * second


@kernel
def flatness(series, i, offset, x):
    """Return φ and its first and second derivative by x of strip joint i."""
    z = x * x
    if z < SERIES:
        above, above1, above2 = _polynomial(series, i, 0, z)
        below, below1, below2 = _polynomial(series, i, 1, z)
        above1, above2 = 2.0 * x * above1, 2.0 * above1 + 4.0 * z * above2
        below1, below2 = 2.0 * x * below1, 2.0 * below1 + 4.0 * z * below2
        if offset != 0.0:
            odd, odd1, odd2 = _polynomial(series, i, 2, z)
            above, above1 = above + x * odd, above1 + odd + 2.0 * z * odd1
            above2 += x * (6.0 * odd1 + 4.0 * z * odd2)
            odd, odd1, odd2 = _polynomial(series, i, 3, z)
            below, below1 = below + x * odd, below1 + odd + 2.0 * z * odd1
            below2 += x * (6.0 * odd1 + 4.0 * z * odd2)
        inverse = 1.0 / below
        value = above * inverse
        first = (above1 - value * below1) * inverse
        return value, first, (above2 - 2.0 * first * below1 - value * below2) * inverse
    t, sign = abs(x), math.copysign(1.0, x)
    up, down = 1.0 + sign * offset, 1.0 - sign * offset
    p, q = math.sqrt(up * t), math.sqrt(down * t)
    e = math.exp(-p)  # all of the following is times 2 e
    cosh, sinh, cos, sin = 1.0 + e * e, (1.0 - e * e) / p, 2.0 * e * math.cos(q), 2.0 * e * math.sin(q) / q
    half = 0.5 / t
    below = sinh + sin
    below1 = (cosh + cos - below) * half
    below2 = (0.5 * (up * sinh - down * sin) - 3.0 * below1) * half
    inverse = 1.0 / below
    r = (cosh - cos) * inverse
    r1 = (0.5 * (up * sinh + down * sin) - r * below1) * inverse
    r2 = (0.5 * half * (up * (cosh - sinh) + down * (cos - sin)) - 2.0 * r1 * below1 - r * below2) * inverse
    g = 4.0 * half * r
    g1 = 4.0 * half * (r1 - 2.0 * half * r)
    g2 = 4.0 * half * (r2 - 4.0 * half * (r1 - 2.0 * half * r))
    value = (1.0 - g) / z
    first = -(g1 + 2.0 * t * value) / z
    return value, sign * first, -(g2 + 2.0 * value + 4.0 * t * first) / z


@kernel
def strip_law(flattening, rest, i, k, kappa, psi, multiple):
    """Return F of strip joint i, which is joint k [J], at the strains without stress `rest` (`Stage.rest_joint`) and a
    multiple of its moduli, its derivatives by κ₁ and ψ, ∂²F/∂κ₁², ∂²F/∂κ₁∂ψ, ∂²F/∂ψ², and the first and second
    derivative by κ̄y Δl.
    """
    s, curl, skew = multiple * flattening.stiffness[i], flattening.curl[i], flattening.skew[i]
    root, coupling = flattening.scale[i], multiple * flattening.coupling[i]
    natural = rest[flattening.first + i, 0] + curl * rest[k, 0] + skew * rest[k, 2] - skew * psi
    n = kappa * (natural - curl * kappa) - psi * psi + flattening.start[i]
    n1, n3 = natural - 2.0 * curl * kappa, -skew * kappa - 2.0 * psi
    phi, first, second = flatness(flattening.series, i, flattening.offset[i], root * kappa)
    first, second = root * first, root * root * second  # by κ₁
    d1, d3, sn = kappa - rest[k, 0] - rest[flattening.first + i, 1], psi - rest[k, 2], s * n
    return (
        coupling * d1 * d3 + 0.5 * sn * n * phi,
        coupling * d3 + sn * (n1 * phi + 0.5 * n * first),
        coupling * d1 + sn * n3 * phi,
        s * ((n1 * n1 - 2.0 * curl * n) * phi + 2.0 * n * n1 * first + 0.5 * n * n * second),
        coupling + s * ((n1 * n3 - skew * n) * phi + n * n3 * first),
        s * (n3 * n3 - 2.0 * n) * phi,
        sn * kappa * phi,
        s * kappa * kappa * phi,
    )


@kernel
def viscous_coupling(p, stage, i):
    """Return β k₁₃ of strip joint i, and its κ₁ and ψ at the strains' origin: viscosity has β k₁₃ (κ₁ − κ₁°)(ψ − ψ°)
    beside the squares of `forces.viscosity`.
    """
    k = p.flattening.joint[i]
    lag = p.viscosity.joint_time[k, 0] / stage.length * p.flattening.coupling[i]
    first = p.strands.edge_count + 3 * k
    kappa, psi = stage.origin_strain[first], stage.origin_strain[first + 2]
    if lag != 0.0 and p.off_axis.exists:
        kappa += _bent_by_strains_of_origin(p, stage, k)
    return lag, kappa, psi


@kernel
def _bent_by_strains_of_origin(p, stage, k):
    """Return Σ b ε of joint k at the strains' origin, which are without it [rad]."""
    joint, slope, strands = p.off_axis.joint, p.off_axis.slope, p.strands
    low, high = 0, joint.shape[0]
    while low < high:
        middle = (low + high) // 2
        if joint[middle] < k:
            low = middle + 1
        else:
            high = middle
    bend = 0.0
    if low < joint.shape[0] and joint[low] == k:
        a, b = strands.joint_a[k], strands.joint_b[k]
        if slope[low, 0] != 0.0:  # a clamp edge has none
            bend += slope[low, 0] * strands.rest_length[a] * stage.origin_strain[a]
        if slope[low, 1] != 0.0:
            bend += slope[low, 1] * strands.rest_length[b] * stage.origin_strain[b]
    return bend


@record
class Sections:
    """The law of strip joints at given strains."""

    rest: Matrix  # `Stage.rest_joint`
    strip: Indices  # strip joint of each, shape (n_section,)
    kappa: Vector  # κ₁, likewise
    psi: Vector  # ψ, likewise
    pull: Vector  # ∂F/∂κ̄y Δl [N m], likewise
    tangent: Matrix  # ∂²F/∂κ₁², ∂²F/∂κ₁∂ψ and ∂²F/∂ψ² [N m], shape (n_section, 3)


@piece(int, Flattening, Sections)
def write_sections(flattening, of):
    """Write the law, for the multiple 1 of moduli, for those who look at sections between steps."""
    for i in range(of.kappa.shape[0]):
        strip = of.strip[i]
        _, _, _, k11, k13, k33, pull, _ = strip_law(
            flattening, of.rest, strip, flattening.joint[strip], of.kappa[i], of.psi[i], 1.0
        )
        of.pull[i] = pull
        of.tangent[i, 0], of.tangent[i, 1], of.tangent[i, 2] = k11, k13, k33
    return 0


@kernel
def pull_of_rest(p, at, stage):
    """Write the derivatives of bending, twist and F of strips by values of `Stage.rest_joint`, and the second by κ̄y Δl,
    at a configuration as it is, of which `bend_by_strains` has written what strains of edges bend.
    """
    strands, flattening, rest = p.strands, p.flattening, stage.rest_joint
    stiffness, pull_out, stretches = strands.joint_stiffness, flattening.pull, p.off_axis.exists
    for i in range(flattening.joint.shape[0]):
        k = flattening.joint[i]
        multiple = multiple_of_joint(p, stage, k, 0)
        coupling, k1, k3 = multiple * flattening.coupling[i], multiple * stiffness[k, 0], multiple * stiffness[k, 2]
        ka, kb = strands.joint_a[k], strands.joint_b[k]
        a, b, m1a, m1b = row(at.tangent, ka), row(at.tangent, kb), row(at.director1, ka), row(at.director1, kb)
        ic, p1, q1 = 1.0 / (1.0 + dot(a, b)), dot(b, m1a), dot(a, m1b)
        kappa, psi = (p1 - q1) * ic, 0.0
        if p.space.exists:
            m2a = row(at.director2, ka)
            psi = angle(dot(m1a, m1b) - p1 * q1 * ic, dot(m2a, m1b) - dot(b, m2a) * q1 * ic)
            psi += TWO_PI * math.floor((at.joint_strain[k, 2] - psi) / TWO_PI + 0.5)
        d1, d3 = kappa - (p.off_axis.rest[k, 0] if stretches else rest[k, 0]), psi - rest[k, 2]
        _, _, _, _, _, _, pull, slope = strip_law(flattening, rest, i, k, kappa, psi, multiple)
        j = flattening.first + i
        pull_out[j, 0], pull_out[j, 1] = pull, -coupling * d3
        pull_out[k, 0] = flattening.curl[i] * pull - coupling * d3 - k1 * d1
        d1 = kappa - rest[k, 0] - rest[j, 1]
        pull_out[k, 2] = flattening.skew[i] * pull - coupling * d1 - k3 * d3
        flattening.slope[i] = slope


@kernel
def pull_of_change(p, change):
    """Replace the derivatives of `pull_of_rest` by what they gain with a change of `Stage.rest_joint`."""
    stiffness, flattening = p.strands.joint_stiffness, p.flattening
    for i in range(flattening.joint.shape[0]):
        k, j, coupling = flattening.joint[i], flattening.first + i, flattening.coupling[i]
        d1, d3, curl, skew = change[k, 0], change[k, 2], flattening.curl[i], flattening.skew[i]
        pull = flattening.slope[i] * (change[j, 0] + curl * d1 + skew * d3)
        flattening.pull[j, 0], flattening.pull[j, 1] = pull, coupling * d3
        flattening.pull[k, 0] = curl * pull + coupling * d3 + stiffness[k, 0] * d1
        flattening.pull[k, 2] = skew * pull + coupling * (d1 + change[j, 1]) + stiffness[k, 2] * d3
