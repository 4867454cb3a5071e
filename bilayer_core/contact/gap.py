"""Gaps between contact points and surfaces, and where contact points of rods are.

Contact points of rods that are not nodes are at parts of the two edges at a node: with the vectors ε and directors m of
the edges before (b) and after (a), and an arm (h, w) along the directors,

    y = x + c_b ε_b + c_a ε_a + s_b (h m1_b + w m2_b) + s_a (h m1_a + w m2_a)

At the node itself c = 0, s = ½. Beside it, at the part −½ ≤ ξ ≤ ½ of an edge, −1 ≤ ξ ≤ 1 towards a free end, y is on
the parabola through the node and its neighbours, and directors are linear between the middles of edges and those of the
last edge beyond them, as they are at an end:

    c = (ξ ∓ ξ²)/2,   s = ½ ∓ ξ, between 0 and 1

which leaves the smooth curve by ⅛ l³ dκ/ds at most.

`surfaces` is a record `Surfaces`, `at` a configuration, `Configuration` (`model.records`).
"""

from __future__ import annotations

from bilayer_core.contact.shapes import PLANE, shape_distance
from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import row


@kernel
def gap_normal(surfaces, at, radius, s, x0, x1, x2):
    """Return the gap between a contact point of a radius [m] and surface s, were the point at x, and the surface's
    outward normal.

    Parameters
    ----------
    surfaces, at
    radius : float
    s : int
    x0, x1, x2 : float
        [m]

    Returns
    -------
    gap : float
        [m]
    n0, n1, n2 : float
        The normal in the world.
    p0, p1, p2 : float
        x in the surface's frame [m]; above a plane, its height alone.
    """
    kind, size, position, axes = surfaces.kind[s], surfaces.size, at.surface_position, at.surface_rotation
    inward = surfaces.rounding[s]
    z0, z1, z2 = x0 - position[s, 0], x1 - position[s, 1], x2 - position[s, 2]
    p2 = axes[s, 0, 2] * z0 + axes[s, 1, 2] * z1 + axes[s, 2, 2] * z2
    if kind == PLANE:
        return p2 - inward - radius, axes[s, 0, 2], axes[s, 1, 2], axes[s, 2, 2], 0.0, 0.0, p2
    p0 = axes[s, 0, 0] * z0 + axes[s, 1, 0] * z1 + axes[s, 2, 0] * z2
    p1 = axes[s, 0, 1] * z0 + axes[s, 1, 1] * z1 + axes[s, 2, 1] * z2
    d, g0, g1, g2 = shape_distance(kind, size[s, 0], size[s, 1], size[s, 2], p0, p1, p2)
    n0 = axes[s, 0, 0] * g0 + axes[s, 0, 1] * g1 + axes[s, 0, 2] * g2
    n1 = axes[s, 1, 0] * g0 + axes[s, 1, 1] * g1 + axes[s, 1, 2] * g2
    n2 = axes[s, 2, 0] * g0 + axes[s, 2, 1] * g1 + axes[s, 2, 2] * g2
    return d - inward - radius, n0, n1, n2, p0, p1, p2


@kernel
def rod_point(surfaces, at, i, mix):
    """Return the place of a contact point of a rod at node i [m], by its mix (c_b, c_a, s_b, s_a, h, w), as a tuple."""
    b, a = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    along_b, along_a, part_b, part_a, h, w = mix
    along_b, along_a = along_b * at.length[b], along_a * at.length[a]
    x, t, m1, m2 = row(at.position, i), at.tangent, at.director1, at.director2
    return (
        x[0] + along_b * t[b, 0] + along_a * t[a, 0]
        + h * (part_b * m1[b, 0] + part_a * m1[a, 0]) + w * (part_b * m2[b, 0] + part_a * m2[a, 0]),
        x[1] + along_b * t[b, 1] + along_a * t[a, 1]
        + h * (part_b * m1[b, 1] + part_a * m1[a, 1]) + w * (part_b * m2[b, 1] + part_a * m2[a, 1]),
        x[2] + along_b * t[b, 2] + along_a * t[a, 2]
        + h * (part_b * m1[b, 2] + part_a * m1[a, 2]) + w * (part_b * m2[b, 2] + part_a * m2[a, 2]),
    )  # fmt: skip


@kernel
def mix_of(surfaces, k):
    """Return the mix of the contact point of pair k; see `rod_point`."""
    mix = surfaces.near_mix
    return mix[k, 0], mix[k, 1], mix[k, 2], mix[k, 3], mix[k, 4], mix[k, 5]


@kernel
def place_of(surfaces, at, k):
    """Return the place of the contact point of pair k [m], as a tuple."""
    if surfaces.near_arm[k]:
        return rod_point(surfaces, at, surfaces.near_node[k], mix_of(surfaces, k))
    return row(at.contact_point, surfaces.near_contact_point[k])


@kernel
def stands_aside(surfaces, k):
    """Return whether pair k is of a station where points between stations bear: it tells how far away a surface is, but
    neither bears nor bounds steps.
    """
    return surfaces.near_weight[k] == 0.0 and surfaces.contact_point_body[surfaces.near_contact_point[k]] < 0
