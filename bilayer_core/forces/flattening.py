"""Flattening: the part of a strip's energy that the three squares of bending and twist do not have.

A strip of width w and thickness H that is curved by κ along and twisted by τ cannot curl across as it would without
stress: that would stretch its middle surface. The section deforms to u(y), D u⁗ + E H κ² u = 0 with free borders, which
leaves per length, for all widths (κ̄x, κ̄y, τ̄ natural curvatures along and across and natural twist of the free plate),

    U/w = ½ D [(κ − κ̄x)² + (q − κ̄y)² + 2ν (κ − κ̄x)(q − κ̄y) + 2(1 − ν)(τ − τ̄)² − c² g(ψ)]
    q = τ²/κ,   c = κ̄y − ν (κ − κ̄x) − q,   g = 2 (cosh ψ − cos ψ)/[ψ (sinh ψ + sin ψ)],   ψ⁴ = 3(1 − ν²) w⁴ κ²/H²

Its first three terms are (1 − ν²)(κ − κ̄x)² + c², and D (1 − ν²) w = E I₁: so the strip is the beam of
`forces.bend_twist` and F = ½ D w c² (1 − g) beside it. With the strains of a joint, κ₁ = κ Δl and θ = τ Δl, with
z = ψ⁴ = Λ κ₁² and φ = (1 − g)/z,

    F = ½ s N² φ(Λ κ₁²),   N = κ₁ c Δl = (κ̄y Δl + ν κ̄₁) κ₁ − ν κ₁² − θ² + θ̄²
    s = w⁴ EA/(4 Δl³),   Λ = s (1 − ν²)/k₁

N is a polynomial and φ is analytic, φ(0) = 1/180, so that nothing is special at κ = 0, where q is infinite. θ̄² belongs
to a strip that is twisted at the start: its middle surface has the metric of that shape. In layers of the same ν, EA,
k₁ and κ̄₁ are those of the laminate, for the matrices A, B and D of the plate are those of the beam times one matrix.

φ and its derivatives follow from the series Σ zᵐ/(4m + 2)! and Σ zᵐ/(4m + 1)! of (cosh ψ − cos ψ)/2ψ² and
(sinh ψ + sin ψ)/2ψ for small z, and from the formula with all terms times e^−ψ for large z.

Derivatives by edges are those of κ₁ and ψ (`forces.bend_twist`), with the 2 × 2 matrix of ∂²F/∂(κ₁, θ)² in place of k.
"""

from __future__ import annotations

import math
from fractions import Fraction

from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.vector import (
    add_column,
    add_outer_sum,
    add_row,
    add_upper_outer_sum,
    angle,
    combine,
    combine3,
    dot,
    row,
    scaled,
)
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.parts import Plane, Space
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.step import Configuration, Stage

FLATTENING = slot_of("flattening")
TWO_PI = 2.0 * math.pi
SERIES = 8.0
"""z below which φ is its series, which converges to 125."""
TERMS = 14


def _coefficients() -> tuple[float, ...]:
    """Return those of φ = (1 − 2 Σ zᵐ/(4m + 2)!/Σ zᵐ/(4m + 1)!)/z, the highest power first."""
    sines = [Fraction(1, math.factorial(4 * m + 1)) for m in range(TERMS + 1)]
    quotient: list[Fraction] = []
    for m in range(TERMS + 1):
        whole = Fraction(2, math.factorial(4 * m + 2))
        quotient.append(whole - sum(quotient[i] * sines[m - i] for i in range(m)))
    return tuple(-float(part) for part in quotient[:0:-1])


COEFFICIENTS = _coefficients()


@kernel
def flatness(z):
    """Return φ, φ′ and φ″ of z ≥ 0."""
    if z < SERIES:
        value = first = second = 0.0
        for c in COEFFICIENTS:
            second = second * z + first
            first = first * z + value
            value = value * z + c
        return value, first, 2.0 * second
    psi = math.sqrt(math.sqrt(z))
    e = math.exp(-psi)
    even, odd, cosine, sine = 0.5 * (1.0 + e * e), 0.5 * (1.0 - e * e), e * math.cos(psi), e * math.sin(psi)
    d = 1.0 / (odd + sine)
    r, s = (even - cosine) * d, (even + cosine) * d
    r1 = 1.0 - r * s
    r2 = -r1 * s - r * ((odd - sine) * d - s * s)
    ip = 1.0 / psi
    g = 2.0 * r * ip
    g1 = 2.0 * (r1 - r * ip) * ip
    g2 = 2.0 * (r2 - 2.0 * (r1 - r * ip) * ip) * ip
    cube = 0.25 * ip * ip * ip  # ∂ψ/∂z
    value = (1.0 - g) / z
    first = -(g1 * cube + value) / z
    return value, first, -((g2 - 3.0 * g1 * ip) * cube * cube + 2.0 * first) / z


@kernel
def flattening_law(flattening, rest, i, kappa, theta):
    """Return F of strip joint i [J], its derivatives by κ₁ and θ, ∂²F/∂κ₁², ∂²F/∂κ₁∂θ, ∂²F/∂θ², and the first and
    second derivative by κ̄y Δl, at the strains without stress `rest` (`Stage.rest_joint`).
    """
    s, scale, nu, k = flattening.stiffness[i], flattening.scale[i], flattening.poisson[i], flattening.joint[i]
    natural = rest[flattening.first + i, 0] + nu * rest[k, 0]
    n = kappa * (natural - nu * kappa) - theta * theta + rest[k, 2] * rest[k, 2]
    n1, n3 = natural - 2.0 * nu * kappa, -2.0 * theta
    phi, first, second = flatness(scale * kappa * kappa)
    d1 = 2.0 * scale * kappa * first  # ∂φ/∂κ₁
    d11 = 2.0 * scale * first + 4.0 * scale * scale * kappa * kappa * second
    return (
        0.5 * s * n * n * phi,
        s * n * (n1 * phi + 0.5 * n * d1),
        s * n * n3 * phi,
        s * ((n1 * n1 - 2.0 * nu * n) * phi + 2.0 * n * n1 * d1 + 0.5 * n * n * d11),
        s * n3 * (n1 * phi + n * d1),
        s * (n3 * n3 - 2.0 * n) * phi,
        s * n * kappa * phi,
        s * kappa * kappa * phi,
    )


@kernel
def pull_of_rest(p, at, stage):
    """Write ∂F/∂ of each row of `Stage.rest_joint`, and the second derivative by κ̄y Δl of each strip joint, at a
    configuration as it is.
    """
    strands, flattening = p.strands, p.flattening
    for i in range(flattening.joint.shape[0]):
        k = flattening.joint[i]
        ka, kb = strands.joint_a[k], strands.joint_b[k]
        a, b, m1a, m1b = row(at.tangent, ka), row(at.tangent, kb), row(at.director1, ka), row(at.director1, kb)
        ic, p1, q1 = 1.0 / (1.0 + dot(a, b)), dot(b, m1a), dot(a, m1b)
        theta = 0.0
        if p.space.exists:
            m2a = row(at.director2, ka)
            theta = angle(dot(m1a, m1b) - p1 * q1 * ic, dot(m2a, m1b) - dot(b, m2a) * q1 * ic)
            theta += TWO_PI * math.floor((at.joint_strain[k, 2] - theta) / TWO_PI + 0.5)
        _, _, _, _, _, _, pull, slope = flattening_law(flattening, stage.rest_joint, i, (p1 - q1) * ic, theta)
        flattening.pull[flattening.first + i], flattening.pull[k] = pull, flattening.poisson[i] * pull
        flattening.slope[i] = slope


@kernel
def pull_of_change(flattening, change):
    """Replace ∂F/∂ of rows of `Stage.rest_joint` by what it gains with a change of these."""
    for i in range(flattening.joint.shape[0]):
        k, nu = flattening.joint[i], flattening.poisson[i]
        pull = flattening.slope[i] * (change[flattening.first + i, 0] + nu * change[k, 0])
        flattening.pull[flattening.first + i], flattening.pull[k] = pull, nu * pull


@kernel
def _form(k11, k13, k33, x1, x3, y1, y3):
    """Return k₁₁ x₁ y₁ + k₁₃ (x₁ y₃ + x₃ y₁) + k₃₃ x₃ y₃."""
    return x1 * (k11 * y1 + k13 * y3) + x3 * (k13 * y1 + k33 * y3)


@piece(float, Space, Problem, Configuration, Stage, bool)
def add_flattening(_, p, at, stage, with_hessian):
    """Add F of strips and its derivatives by edges; names are those of `bend_twist.add_bending`."""
    strands, flattening, sums = p.strands, p.flattening, p.sums
    if not sums.selected[FLATTENING]:
        return math.inf
    length, tangent, director1, director2 = at.length, at.tangent, at.director1, at.director2
    gradient_out, hessian_out, cross_out = sums.edge, sums.edge_hessian, sums.cross_hessian
    total = 0.0
    for i in range(flattening.joint.shape[0]):
        k = flattening.joint[i]
        ka, kb = strands.joint_a[k], strands.joint_b[k]
        a, b = row(tangent, ka), row(tangent, kb)
        m1a, m2a = row(director1, ka), row(director2, ka)
        m1b, m2b = row(director1, kb), row(director2, kb)
        ila, ilb = 1.0 / length[ka], 1.0 / length[kb]
        s = dot(a, b)
        ic = 1.0 / (1.0 + s)
        p1, p2, q1, q2 = dot(b, m1a), dot(b, m2a), dot(a, m1b), dot(a, m2b)
        r11, r12, r21, r22 = dot(m1a, m1b), dot(m1a, m2b), dot(m2a, m1b), dot(m2a, m2b)
        kappa = (p1 - q1) * ic
        theta = angle(r11 - p1 * q1 * ic, r21 - p2 * q1 * ic)
        theta += TWO_PI * math.floor((stage.twist[k] - theta) / TWO_PI + 0.5)
        energy, g1, g3, k11, k13, k33, _, _ = flattening_law(flattening, stage.rest_joint, i, kappa, theta)
        total += energy

        u1, u2 = -(s + r11 + kappa * p1) * ic, -(r21 + kappa * p2) * ic
        w1, w2 = (s + r11 - kappa * q1) * ic, (r12 - kappa * q2) * ic
        h1, h2, j1, j2 = -p2 * ic, p1 * ic, q2 * ic, -q1 * ic
        ga1, ga2, gb1, gb2 = g1 * u1 + g3 * h1, g1 * u2 + g3 * h2, g1 * w1 + g3 * j1, g1 * w2 + g3 * j2
        fa, fb = -g1 * h1, -g1 * j1
        gradient_a, gradient_b = combine(ga1, m1a, ga2, m2a), combine(gb1, m1b, gb2, m2b)
        add_row(gradient_out, ka, ila, gradient_a)
        add_row(gradient_out, kb, ilb, gradient_b)
        gradient_out[ka, 3] += fa - g3
        gradient_out[kb, 3] += fb + g3
        if not with_hessian:
            continue
        f = g1 * kappa

        # edge a with itself
        x1, x2 = -ic * (g1 * u1 + 0.5 * (g1 + g3 * h1)), -ic * (g1 * u2 + 0.5 * g3 * h2)
        own = (q1 * g1 + f * s) * ic
        s11 = own + 2.0 * p1 * x1 + _form(k11, k13, k33, u1, h1, u1, h1)
        s12 = p1 * x2 + p2 * x1 + _form(k11, k13, k33, u1, h1, u2, h2)
        s22 = own + 2.0 * p2 * x2 + _form(k11, k13, k33, u2, h2, u2, h2)
        rows = combine3(s11, m1a, s12, m2a, -ga1, a), combine3(s12, m1a, s22, m2a, -ga2, a)
        add_upper_outer_sum(hessian_out, ka, ila * ila, m1a, rows[0], m2a, rows[1], scaled(-1.0, a), gradient_a)
        t1 = _form(k11, k13, k33, u1, h1, -h1, -1.0) - ic * fa * p1
        t2 = _form(k11, k13, k33, u2, h2, -h1, -1.0) - ic * (s * g1 + fa * p2)
        add_column(hessian_out, ka, 3, ila, combine(t1, m1a, t2, m2a))
        hessian_out[ka, 3, 3] += _form(k11, k13, k33, -h1, -1.0, -h1, -1.0) - p1 * g1 * ic

        # edge b with itself
        x1, x2 = -ic * (g1 * w1 - 0.5 * (g1 - g3 * j1)), -ic * (g1 * w2 + 0.5 * g3 * j2)
        own = (f * s - p1 * g1) * ic
        s11 = own + 2.0 * q1 * x1 + _form(k11, k13, k33, w1, j1, w1, j1)
        s12 = q1 * x2 + q2 * x1 + _form(k11, k13, k33, w1, j1, w2, j2)
        s22 = own + 2.0 * q2 * x2 + _form(k11, k13, k33, w2, j2, w2, j2)
        rows = combine3(s11, m1b, s12, m2b, -gb1, b), combine3(s12, m1b, s22, m2b, -gb2, b)
        add_upper_outer_sum(hessian_out, kb, ilb * ilb, m1b, rows[0], m2b, rows[1], scaled(-1.0, b), gradient_b)
        t1 = _form(k11, k13, k33, w1, j1, -j1, 1.0) - ic * fb * q1
        t2 = _form(k11, k13, k33, w2, j2, -j1, 1.0) + ic * (s * g1 - fb * q2)
        add_column(hessian_out, kb, 3, ilb, combine(t1, m1b, t2, m2b))
        hessian_out[kb, 3, 3] += _form(k11, k13, k33, -j1, 1.0, -j1, 1.0) + q1 * g1 * ic

        # rows of a, columns of b
        x1, x2 = -ic * (g1 * u1 + g1 + g3 * h1), -ic * (g1 * u2 + g3 * h2)
        y1, y2 = -ic * (g1 * w1 - g1), -ic * g1 * w2
        fc, gc = f * ic, g3 * ic
        s11 = x1 * q1 + p1 * y1 - fc * r11 - gc * r21 + _form(k11, k13, k33, u1, h1, w1, j1)
        s12 = x1 * q2 + p1 * y2 - fc * r12 - gc * r22 + _form(k11, k13, k33, u1, h1, w2, j2)
        s21 = x2 * q1 + p2 * y1 - fc * r21 + gc * r11 + _form(k11, k13, k33, u2, h2, w1, j1)
        s22 = x2 * q2 + p2 * y2 - fc * r22 + gc * r12 + _form(k11, k13, k33, u2, h2, w2, j2)
        rows = combine(s11, m1b, s12, m2b), combine(s21, m1b, s22, m2b)
        add_outer_sum(cross_out, k, ila * ilb, m1a, rows[0], m2a, rows[1])
        t1 = _form(k11, k13, k33, u1, h1, -j1, 1.0) - ic * (g1 * r12 + fb * p1)
        t2 = _form(k11, k13, k33, u2, h2, -j1, 1.0) - ic * (g1 * r22 + fb * p2)
        add_column(cross_out, k, 3, ila, combine(t1, m1a, t2, m2a))
        t1 = _form(k11, k13, k33, -h1, -1.0, w1, j1) + ic * (g1 * r21 - fa * q1)
        t2 = _form(k11, k13, k33, -h1, -1.0, w2, j2) + ic * (g1 * r22 - fa * q2)
        theta_row = combine(t1, m1b, t2, m2b)
        for c in range(3):
            cross_out[k, 3, c] += ilb * theta_row[c]
        cross_out[k, 3, 3] += _form(k11, k13, k33, -h1, -1.0, -j1, 1.0)
    sums.energy[FLATTENING] = total
    return math.inf


@piece(float, Plane, Problem, Configuration, Stage, bool)
def add_flattening_in_plane(plane, p, at, stage, with_hessian):
    """Add F of strips in a plane, θ = 0, after what `planar.add_elasticity_in_plane` has measured."""
    strands, flattening, sums, axes = p.strands, p.flattening, p.sums, p.strands.axes
    if not sums.selected[FLATTENING]:
        return math.inf
    frame, gradient, hessian = plane.frame, plane.polar_gradient, plane.polar_hessian
    total = 0.0
    for i in range(flattening.joint.shape[0]):
        k = flattening.joint[i]
        a, b = strands.joint_a[k], strands.joint_b[k]
        ap, aq, bp, bq = frame[a, 0], frame[a, 1], frame[b, 0], frame[b, 1]
        inverse = 1.0 / (1.0 + ap * bp + aq * bq)
        slope = 2.0 * plane.side[a] * inverse
        kappa = slope * (ap * bq - aq * bp)
        energy, g1, _, k11, _, _, _, _ = flattening_law(flattening, stage.rest_joint, i, kappa, 0.0)
        total += energy
        moment = g1 * slope
        for e, own in ((a, -moment), (b, moment)):
            gradient[e, 1] += own
            for c in range(3):
                sums.edge[e, c] += own * (frame[e, 2] * axes[0, c] + frame[e, 3] * axes[1, c])
        if with_hessian:
            second = k11 * slope * slope + g1 * kappa * inverse
            hessian[a, 2] += second
            hessian[b, 2] += second
            plane.cross_hessian[k, 3] -= second
    sums.energy[FLATTENING] = total
    return math.inf
