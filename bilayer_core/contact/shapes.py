"""Signed distances of convex shapes, each in a frame of its own.

======== =============================================== =========================================================
number   shape                                           size
======== =============================================== =========================================================
PLANE    half space z ≤ 0                                –
SPHERE   a point                                         –
BOX      edges along the axes                            half edges a, b, c
CYLINDER axis along z, flat ends                         radius a, (unused), half length c
======== =============================================== =========================================================

A rounding of radius r makes every distance smaller by r: a sphere is a point with its radius as rounding, a capsule a
cylinder of radius zero. With q the distances beyond the faces and v the part of q above zero (in the directions of the
faces it belongs to),

    φ = |v|,   ∇φ = v/|v|,   ∇²φ = (P − ∇φ ∇φᵀ)/|v| (+ the curvature of a cylinder's side),   P onto the faces passed

Outside, φ is convex and |∇φ| = 1. Inside, φ is the largest of q, negative, and exact for the shape without its
rounding.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel

PLANE, SPHERE, BOX, CYLINDER = 0, 1, 2, 3


@kernel
def shape_distance(kind, a, b, c, x, y, z):
    """Return φ [m] and ∇φ at a point of the shape's frame, as (φ, g₀, g₁, g₂)."""
    if kind == PLANE:
        return z, 0.0, 0.0, 1.0
    if kind == SPHERE:
        distance = math.sqrt(x * x + y * y + z * z)
        if distance == 0.0:
            return 0.0, 0.0, 0.0, 1.0
        return distance, x / distance, y / distance, z / distance
    if kind == BOX:
        q0, q1, q2 = abs(x) - a, abs(y) - b, abs(z) - c
        s0, s1, s2 = math.copysign(1.0, x), math.copysign(1.0, y), math.copysign(1.0, z)
        if q0 <= 0.0 and q1 <= 0.0 and q2 <= 0.0:
            if q0 >= q1 and q0 >= q2:
                return q0, s0, 0.0, 0.0
            return (q1, 0.0, s1, 0.0) if q1 >= q2 else (q2, 0.0, 0.0, s2)
        v0, v1, v2 = max(q0, 0.0), max(q1, 0.0), max(q2, 0.0)
        distance = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
        return distance, s0 * v0 / distance, s1 * v1 / distance, s2 * v2 / distance
    radial = math.sqrt(x * x + y * y)
    e0, e1 = (x / radial, y / radial) if radial > 0.0 else (1.0, 0.0)
    q0, q1 = radial - a, abs(z) - c
    s1 = math.copysign(1.0, z)
    if q0 <= 0.0 and q1 <= 0.0:
        return (q0, e0, e1, 0.0) if q0 >= q1 else (q1, 0.0, 0.0, s1)
    v0, v1 = max(q0, 0.0), max(q1, 0.0)
    distance = math.sqrt(v0 * v0 + v1 * v1)
    return distance, e0 * v0 / distance, e1 * v0 / distance, s1 * v1 / distance


@kernel
def shape_curvature(kind, a, b, c, x, y, z):
    """Return ∇²φ [1/m] at a point outside, as its upper triangle (h₀₀, h₀₁, h₀₂, h₁₁, h₁₂, h₂₂)."""
    distance, g0, g1, g2 = shape_distance(kind, a, b, c, x, y, z)
    if kind == PLANE:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    s = 1.0 / distance
    if kind == CYLINDER:
        radial = math.sqrt(x * x + y * y)
        if radial <= a:  # beyond an end: flat
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        e0, e1 = x / radial, y / radial
        along = e0 * g0 + e1 * g1
        side = along / radial
        rim = s * (1.0 - along * along) if abs(z) > c else 0.0
        mixed = -s * along * g2
        end = s * (1.0 - g2 * g2) if abs(z) > c else 0.0
        return (
            rim * e0 * e0 + side * e1 * e1,
            (rim - side) * e0 * e1,
            mixed * e0,
            rim * e1 * e1 + side * e0 * e0,
            mixed * e1,
            end,
        )
    p0 = p1 = p2 = 1.0
    if kind == BOX:
        p0 = 1.0 if abs(x) > a else 0.0
        p1 = 1.0 if abs(y) > b else 0.0
        p2 = 1.0 if abs(z) > c else 0.0
        if p0 + p1 + p2 == 1.0:  # beyond one face: flat
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return (
        s * (p0 - g0 * g0),
        -s * g0 * g1,
        -s * g0 * g2,
        s * (p1 - g1 * g1),
        -s * g1 * g2,
        s * (p2 - g2 * g2),
    )
