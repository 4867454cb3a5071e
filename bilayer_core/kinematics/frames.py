"""Edges, tangents and material frames carried by parallel transport.

Parallel transport of a vector u perpendicular to the unit tangent a, to the unit tangent b, is the smallest
rotation that turns a into b:

    P u = u − (u·b)/(1 + a·b) (a + b)        (Bergou et al. 2010, eq. 9; Jawed et al. 2018, ch. 4)

A rigid motion therefore carries the frames with it and costs no energy.
"""

from __future__ import annotations

import math

from bilayer_core.jit import kernel
from bilayer_core.jit.called import flat, stack_matrix

BLOCK = 64
"""Edges whose directors are carried to scratch before they are written: what is read and what is written cannot overlap
then, so the compiler computes several edges at once.
"""
SMALL_TURN = 0.05
"""Angle up to which five terms of the series of cosine and sine are exact to rounding [rad]: the next is 1e-22."""


@kernel
def edge_geometry(position, edge_node, length_out, tangent_out):
    """Write the length [m] and the unit tangent of every edge.

    Parameters
    ----------
    position : Array
        Node positions [m], shape (n_node, 3).
    edge_node : Array
        First node of each edge; the second is the next one, shape (n_edge,).
    length_out, tangent_out : Array
        Written: shapes (≥ n_edge,) and (≥ n_edge, 3).
    """
    for k in range(edge_node.shape[0]):
        i = edge_node[k]
        x = position[i + 1, 0] - position[i, 0]
        y = position[i + 1, 1] - position[i, 1]
        z = position[i + 1, 2] - position[i, 2]
        length = math.sqrt(x * x + y * y + z * z)
        length_out[k] = length
        tangent_out[k, 0] = x / length
        tangent_out[k, 1] = y / length
        tangent_out[k, 2] = z / length


@kernel
def planar_frames(position, edge_node, normal, side, length_out, tangent_out, director1_out, director2_out):
    """Write the length [m] and the material frame of every edge of rods in a plane: m1 = σ normal × t, m2 = σ normal.

    Parameters are those of `edge_geometry`, the unit normal of the plane, shape (3,), and σ = ±1 of each edge.
    """
    n0, n1, n2 = normal[0], normal[1], normal[2]
    for k in range(edge_node.shape[0]):
        i = edge_node[k]
        x = position[i + 1, 0] - position[i, 0]
        y = position[i + 1, 1] - position[i, 1]
        z = position[i + 1, 2] - position[i, 2]
        length = math.sqrt(x * x + y * y + z * z)
        t0, t1, t2, s = x / length, y / length, z / length, side[k]
        length_out[k] = length
        tangent_out[k, 0], tangent_out[k, 1], tangent_out[k, 2] = t0, t1, t2
        director1_out[k, 0] = s * (n1 * t2 - n2 * t1)
        director1_out[k, 1] = s * (n2 * t0 - n0 * t2)
        director1_out[k, 2] = s * (n0 * t1 - n1 * t0)
        director2_out[k, 0], director2_out[k, 1], director2_out[k, 2] = s * n0, s * n1, s * n2


@kernel
def transport_directors(count, tangent, director1, director2, angle, new_tangent, director1_out, director2_out):
    """Carry material frames to new tangents and turn them about these.

    m1' = cos θ · P m1 + sin θ · P m2, made orthonormal again to rounding.

    Parameters
    ----------
    count : int
        Number of edges to carry.
    tangent, director1, director2 : Array
        Frames to start from, unit, shape (≥ count, 3).
    angle : Array
        Turn θ of each edge about its new tangent [rad], shape (count,).
    new_tangent : Array
        Unit, shape (≥ count, 3).
    director1_out, director2_out : Array
        Written, shape (≥ count, 3).
    """
    turn, carried = stack_matrix(2, BLOCK), stack_matrix(6, BLOCK)
    for first in range(0, count, BLOCK):
        last = min(first + BLOCK, count)
        _turns(angle[first:last], turn)
        a, b = flat(tangent[first:last]), flat(new_tangent[first:last])
        u, v = flat(director1[first:last]), flat(director2[first:last])
        _transport(last - first, a, b, u, v, turn, carried)
        for k in range(last - first):
            for c in range(3):
                director1_out[first + k, c], director2_out[first + k, c] = carried[c, k], carried[3 + c, k]


@kernel
def _turns(angle, turn_out):
    """Write cosines and sines of angles, by their series where all are small."""
    total = 0.0
    for k in range(angle.shape[0]):
        total += angle[k] * angle[k]
    if total < SMALL_TURN * SMALL_TURN:
        for k in range(angle.shape[0]):
            x = angle[k]
            y = x * x
            turn_out[0, k] = 1.0 - y * (0.5 - y * (1.0 / 24.0 - y * (1.0 / 720.0 - y / 40320.0)))
            turn_out[1, k] = x - x * y * (1.0 / 6.0 - y * (1.0 / 120.0 - y * (1.0 / 5040.0 - y / 362880.0)))
        return
    for k in range(angle.shape[0]):
        turn_out[0, k], turn_out[1, k] = math.cos(angle[k]), math.sin(angle[k])


@kernel
def _transport(count, a, b, u, v, turn, carried_out):
    """Write the directors of a block of edges, by components."""
    for k in range(count):
        a0, a1, a2 = a[3 * k], a[3 * k + 1], a[3 * k + 2]
        b0, b1, b2 = b[3 * k], b[3 * k + 1], b[3 * k + 2]
        u0, u1, u2 = u[3 * k], u[3 * k + 1], u[3 * k + 2]
        v0, v1, v2 = v[3 * k], v[3 * k + 1], v[3 * k + 2]
        inverse = 1.0 / (1.0 + a0 * b0 + a1 * b1 + a2 * b2)
        su = (u0 * b0 + u1 * b1 + u2 * b2) * inverse
        sv = (v0 * b0 + v1 * b1 + v2 * b2) * inverse
        c, s = turn[0, k], turn[1, k]
        scale = c * su + s * sv
        p0 = c * u0 + s * v0 - scale * (a0 + b0)
        p1 = c * u1 + s * v1 - scale * (a1 + b1)
        p2 = c * u2 + s * v2 - scale * (a2 + b2)
        along = p0 * b0 + p1 * b1 + p2 * b2
        p0 -= along * b0
        p1 -= along * b1
        p2 -= along * b2
        norm = 1.0 / math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
        p0 *= norm
        p1 *= norm
        p2 *= norm
        carried_out[0, k] = p0
        carried_out[1, k] = p1
        carried_out[2, k] = p2
        carried_out[3, k] = b1 * p2 - b2 * p1
        carried_out[4, k] = b2 * p0 - b0 * p2
        carried_out[5, k] = b0 * p1 - b1 * p0
