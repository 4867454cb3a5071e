"""Curves along which rods lie at the start: positions and frames by arc length."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def straight(start: Array, tangent: Array, normal: Array, arc: Array) -> tuple[Array, Array, Array]:
    """Points [m], tangents and normals of a straight line at lengths `arc` [m] from its start, each of shape (n, 3)."""
    ones = np.ones((len(arc), 1))
    return start + np.outer(arc, tangent), ones * tangent, ones * normal


def circle(start: Array, tangent: Array, normal: Array, curvature: float, arc: Array) -> tuple[Array, Array, Array]:
    """Points [m], tangents and normals of a circle that bends towards its normal for a curvature [1/m] above zero.

    t(s) = cos κs t₀ + sin κs n₀,  n(s) = cos κs n₀ − sin κs t₀,  x(s) = x₀ + (sin κs t₀ + (1 − cos κs) n₀)/κ
    """
    angle = curvature * arc
    cosine, sine = np.cos(angle), np.sin(angle)
    points = start + (np.outer(sine, tangent) + np.outer(1.0 - cosine, normal)) / curvature
    return (
        points,
        np.outer(cosine, tangent) + np.outer(sine, normal),
        np.outer(cosine, normal) - np.outer(sine, tangent),
    )


def spiral(
    start: Array, tangent: Array, normal: Array, radius: float, growth: float, side: float, angle: Array
) -> tuple[Array, Array, Array]:
    """Points [m], tangents and normals of an Archimedean spiral r = r₀ + a φ at angles φ [rad] about its centre, which
    lies on the side ±1 of the normal.

    With e₁ the direction from the centre to the start, e₂ that in which φ grows, ρ = cos φ e₁ + sin φ e₂ and ρ′ =
    ∂ρ/∂φ,

    x = C + r ρ,   t = (a ρ + r ρ′)/√(r² + a²),   n = ± (a ρ′ − r ρ)/√(r² + a²)
    """
    slant = np.hypot(radius, growth)
    inward = side * normal
    e1, e2 = (growth * tangent - radius * inward) / slant, (radius * tangent + growth * inward) / slant
    own = (radius + growth * angle)[:, None]
    outward = np.outer(np.cos(angle), e1) + np.outer(np.sin(angle), e2)
    around = np.outer(np.cos(angle), e2) - np.outer(np.sin(angle), e1)
    slant = np.hypot(own, growth)
    points = start - radius * e1 + own * outward
    return points, (growth * outward + own * around) / slant, side * (growth * around - own * outward) / slant


def rest_strains(tangent_a: Array, m1_a: Array, tangent_b: Array, m1_b: Array) -> Array:
    """κ₁, κ₂, ψ [rad] between edges a and b (see `forces.bend_twist`), shape (n, 3)."""

    def dot(u: Array, v: Array) -> Array:
        return np.einsum("ij,ij->i", u, v)

    m2_a, m2_b = np.cross(tangent_a, m1_a), np.cross(tangent_b, m1_b)
    inverse = 1.0 / (1.0 + dot(tangent_a, tangent_b))
    kappa1 = (dot(tangent_b, m1_a) - dot(tangent_a, m1_b)) * inverse
    kappa2 = (dot(tangent_b, m2_a) - dot(tangent_a, m2_b)) * inverse
    cosine = dot(m1_a, m1_b) - dot(tangent_b, m1_a) * dot(tangent_a, m1_b) * inverse
    sine = dot(m2_a, m1_b) - dot(tangent_b, m2_a) * dot(tangent_a, m1_b) * inverse
    return np.stack([kappa1, kappa2, np.arctan2(sine, cosine)], axis=1)
