"""Rotations inside kernels: exponential, logarithm and products of 3 × 3 matrices that are entries of an array.

The same formulas as in `kinematics.rotation`, which serves whoever needs one rotation at a time.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel
from bilayer_core.kinematics import rotation

quaternion_of = kernel(rotation.quaternion_of)


@kernel
def rotate_by(v0, v1, v2, matrix, b, out, c):
    """Write out[c] = exp([v]×) matrix[b] for a rotation vector v [rad] by Rodrigues' formula; `out[c]` is not
    `matrix[b]`.

    Column by column: exp([v]×) u = u + s v × u + k v × (v × u).
    """
    angle2 = v0 * v0 + v1 * v1 + v2 * v2
    if angle2 < 1e-8:  # series to the rounding limit: the next terms are below 1e-17
        s, k = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = math.sqrt(angle2)
        s, k = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
    for j in range(3):
        u0, u1, u2 = matrix[b, 0, j], matrix[b, 1, j], matrix[b, 2, j]
        w0, w1, w2 = v1 * u2 - v2 * u1, v2 * u0 - v0 * u2, v0 * u1 - v1 * u0
        out[c, 0, j] = u0 + s * w0 + k * (v1 * w2 - v2 * w1)
        out[c, 1, j] = u1 + s * w1 + k * (v2 * w0 - v0 * w2)
        out[c, 2, j] = u2 + s * w2 + k * (v0 * w1 - v1 * w0)


@kernel
def rotation_vector_between(first, a, last, b):
    """Return the rotation vector [rad] of last[b] first[a]ᵀ, by less than half a turn, as a tuple."""
    q00 = q11 = q22 = q21 = q12 = q02 = q20 = q10 = q01 = 0.0
    for k in range(3):
        q00 += last[b, 0, k] * first[a, 0, k]
        q11 += last[b, 1, k] * first[a, 1, k]
        q22 += last[b, 2, k] * first[a, 2, k]
        q21 += last[b, 2, k] * first[a, 1, k]
        q12 += last[b, 1, k] * first[a, 2, k]
        q02 += last[b, 0, k] * first[a, 2, k]
        q20 += last[b, 2, k] * first[a, 0, k]
        q10 += last[b, 1, k] * first[a, 0, k]
        q01 += last[b, 0, k] * first[a, 1, k]
    x, y, z = 0.5 * (q21 - q12), 0.5 * (q02 - q20), 0.5 * (q10 - q01)
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (q00 + q11 + q22 - 1.0)
    factor = 1.0 if sine < 1e-8 else math.atan2(sine, cosine) / sine
    return factor * x, factor * y, factor * z


@kernel
def compose_quaternion(v0, v1, v2, turned, out, f):
    """Write the vector part of the unit quaternion of exp([v]×) after that of turned[f] to out[f]; they may be the same
    array.

    Of turns by less than half a turn, whose quaternions have a positive real part. Small turns keep all their digits,
    which a matrix next to the unit matrix does not.
    """
    angle2 = v0 * v0 + v1 * v1 + v2 * v2
    if angle2 < 1e-8:  # as in `rotate_by`
        s, w = 0.5 - angle2 / 48.0, 1.0 - angle2 / 8.0
    else:
        angle = math.sqrt(angle2)
        s, w = math.sin(0.5 * angle) / angle, math.cos(0.5 * angle)
    p0, p1, p2 = s * v0, s * v1, s * v2
    q0, q1, q2 = turned[f, 0], turned[f, 1], turned[f, 2]
    u = real_part(turned, f)
    sign = -1.0 if w * u < p0 * q0 + p1 * q1 + p2 * q2 else 1.0
    out[f, 0] = sign * (w * q0 + u * p0 + (p1 * q2 - p2 * q1))
    out[f, 1] = sign * (w * q1 + u * p1 + (p2 * q0 - p0 * q2))
    out[f, 2] = sign * (w * q2 + u * p2 + (p0 * q1 - p1 * q0))


@kernel
def real_part(turned, f):
    """Return the real part of the unit quaternion with vector part turned[f], a rotation by less than half a turn."""
    return math.sqrt(max(1.0 - turned[f, 0] ** 2 - turned[f, 1] ** 2 - turned[f, 2] ** 2, 0.0))


@kernel
def rotated_by(turned, f, u0, u1, u2):
    """Return (E − 1) u = 2 w q×u + 2 q×(q×u) for the rotation E of the quaternion with the vector part q = turned[f],
    as a tuple.
    """
    q0, q1, q2 = turned[f, 0], turned[f, 1], turned[f, 2]
    w = real_part(turned, f)
    t0, t1, t2 = 2.0 * (q1 * u2 - q2 * u1), 2.0 * (q2 * u0 - q0 * u2), 2.0 * (q0 * u1 - q1 * u0)
    return (
        w * t0 + (q1 * t2 - q2 * t1),
        w * t1 + (q2 * t0 - q0 * t2),
        w * t2 + (q0 * t1 - q1 * t0),
    )


@kernel
def spin_of(v0, v1, v2, u0, u1, u2):
    """Return the angular velocity of exp([v]×) while v changes at the rate u, as a tuple; see `kinematics.rotation`."""
    angle2 = v0 * v0 + v1 * v1 + v2 * v2
    if angle2 < 1e-8:
        a, b = 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    else:
        angle = math.sqrt(angle2)
        a, b = (1.0 - math.cos(angle)) / angle2, (1.0 - math.sin(angle) / angle) / angle2
    w0, w1, w2 = v1 * u2 - v2 * u1, v2 * u0 - v0 * u2, v0 * u1 - v1 * u0
    return (
        u0 + a * w0 + b * (v1 * w2 - v2 * w1),
        u1 + a * w1 + b * (v2 * w0 - v0 * w2),
        u2 + a * w2 + b * (v0 * w1 - v1 * w0),
    )


@kernel
def product_transposed(left, a, right, b, out, c):
    """Write out[c] = left[a] right[b]ᵀ."""
    for i in range(3):
        for j in range(3):
            out[c, i, j] = (
                left[a, i, 0] * right[b, j, 0] + left[a, i, 1] * right[b, j, 1] + left[a, i, 2] * right[b, j, 2]
            )


@kernel
def inertia_tensor(second_moment, f, rotation, b, out):
    """Write R (tr(J) 1 − J) Rᵀ in the world's axes [kg m²], J the second moment of free body f, R = rotation[b]; (3,
    3).
    """
    trace = second_moment[f, 0, 0] + second_moment[f, 1, 1] + second_moment[f, 2, 2]
    for i in range(3):
        for j in range(3):
            total = trace if i == j else 0.0
            for k in range(3):
                for m in range(3):
                    total -= rotation[b, i, k] * second_moment[f, k, m] * rotation[b, j, m]
            out[i, j] = total


@kernel
def solve_three(matrix, x, y, z):
    """Return the solution of a regular 3 × 3 system by Cramer's rule, as a tuple."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    g, h, i = matrix[2, 0], matrix[2, 1], matrix[2, 2]
    inverse = 1.0 / (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
    return (
        inverse * (x * (e * i - f * h) - b * (y * i - f * z) + c * (y * h - e * z)),
        inverse * (a * (y * i - f * z) - x * (d * i - f * g) + c * (d * z - y * g)),
        inverse * (a * (e * z - y * h) - b * (d * z - y * g) + x * (d * h - e * g)),
    )
