"""Light from far away on layers of rods: how they face it, and what stands before it.

An element of a layer, an edge with the outward normal n of its outer face, sees of a light from the direction l the
part

    b = V max(0, n·l)

of its brightness; a layer that nothing covers on either side sees |n·l|. V is 1, or with cast shadows the part that
nothing hides from the middle x of the face. A ray x + τ l, τ > 0, passes

- an edge of a rod, a rectangle about c with tangent t, m1, m2, length L and half width w, in its plane at the distances
  α along t and β along m2 from c. It covers the product of S over both, for its ends α ± L/2 and its borders β ± w,
  measured across the ray, and of S over τ. So the covers of the edges of a smooth rod add up to that of the rod;
- the surface of a body or an obstacle at a least distance d, where τ = τ_d, by bisection on the slope of the distance,
  which is convex. It covers 1 − S(d/min(s, τ_d)): a ray that only leaves a surface is not hidden by it. A half space
  hides all that looks into it.

S is the smooth step 3 z² − 2 z³ over a width s, the length of the element's edge: the edge of a shadow is as soft as
the mesh is fine. V = max(0, 1 − Σ covers). Thickness and width of the element that is lit are not looked at, nor light
that is scattered or shines through.

`light` is a record `model.records.light.Light`.
"""

from __future__ import annotations

import math

from bilayer_core.contact.shapes import PLANE, shape_distance
from bilayer_core.jit import kernel
from bilayer_core.kinematics.frames import edge_geometry
from bilayer_core.kinematics.vector import cross, dot, row

GRAZING = 1e-9
"""Cosine between a ray and the normal of an edge below which it passes along it."""
HALVINGS = 40
"""Of the part of a ray on which it may pass a shape nearest."""
NEAREST = 1e-12
"""Least width of a shadow's edge [m]."""


@kernel
def brightness(side, facing, visible):
    """Return b of an element whose outward normal is `side` × m1, or both of these for 0."""
    seen = abs(facing) if side == 0.0 else max(0.0, side * facing)
    return visible * seen


@kernel
def _step(z):
    """Return 0 below −1/2, 1 above 1/2, smooth between."""
    z = min(max(z + 0.5, 0.0), 1.0)
    return z * z * (3.0 - 2.0 * z)


@kernel
def covered_by_edge(light, e, x, toward, soft):
    """Return the part of the light from the direction `toward` that edge e hides from x."""
    i = light.edge_node[e]
    a, b = row(light.node_position, i), row(light.node_position, i + 1)
    r = 0.5 * (a[0] + b[0]) - x[0], 0.5 * (a[1] + b[1]) - x[1], 0.5 * (a[2] + b[2]) - x[2]
    half, width, along = 0.5 * light.length[e], light.half_width[e], dot(r, toward)
    off = dot(r, r) - along * along
    radius = half + width + soft
    if along < -radius or off > radius * radius:
        return 0.0
    t, m1 = row(light.tangent, e), row(light.director1, e)
    cosine = dot(toward, m1)
    if abs(cosine) < GRAZING:
        return 0.0
    tau = dot(r, m1) / cosine
    if tau <= 0.0:
        return 0.0
    m2 = cross(t, m1)
    h = tau * toward[0] - r[0], tau * toward[1] - r[1], tau * toward[2] - r[2]
    of_end, of_border = dot(toward, m2), dot(toward, t)
    across_end = abs(cosine) / math.sqrt(max(1.0 - of_end * of_end, GRAZING))
    across_border = abs(cosine) / math.sqrt(max(1.0 - of_border * of_border, GRAZING))
    alpha, beta = dot(h, t), dot(h, m2)
    narrow = min(soft, 2.0 * width * across_border)
    ends = _step((alpha + half) * across_end / soft) - _step((alpha - half) * across_end / soft)
    borders = _step((beta + width) * across_border / narrow) - _step((beta - width) * across_border / narrow)
    return ends * borders * _step(tau / soft - 0.5)


@kernel
def covered_by_shape(light, s, x, toward, soft):
    """Return the part of the light from the direction `toward` that the surface s hides from x."""
    b, kind, rounding = light.body[s], light.kind[s], light.rounding[s]
    p, axes = light.position[s], light.body_rotation
    r = (
        light.body_position[b, 0] + axes[b, 0, 0] * p[0] + axes[b, 0, 1] * p[1] + axes[b, 0, 2] * p[2] - x[0],
        light.body_position[b, 1] + axes[b, 1, 0] * p[0] + axes[b, 1, 1] * p[1] + axes[b, 1, 2] * p[2] - x[1],
        light.body_position[b, 2] + axes[b, 2, 0] * p[0] + axes[b, 2, 1] * p[1] + axes[b, 2, 2] * p[2] - x[2],
    )
    along = dot(r, toward)
    if kind != PLANE:
        radius = light.bound[s] + soft
        if along < -radius or dot(r, r) - along * along > radius * radius:
            return 0.0
    y, v = _in_frame(light, s, b, r), _in_frame(light, s, b, toward)
    if kind == PLANE:
        return 1.0 if v[2] < 0.0 else 0.0
    size = light.size
    first, last = 0.0, max(along + light.bound[s] + soft, 0.0)
    d, slope = _along_ray(kind, size, s, y, v, 0.0)
    if slope >= 0.0:
        last = 0.0
    for _ in range(HALVINGS):
        if last == 0.0:
            break
        middle = 0.5 * (first + last)
        d, slope = _along_ray(kind, size, s, y, v, middle)
        if slope < 0.0:
            first = middle
        else:
            last = middle
    return 1.0 - _step((d - rounding) / max(min(soft, first), NEAREST))


@kernel
def _in_frame(light, s, b, r):
    """Return a vector of the world in the frame of a surface."""
    turn, axes = light.body_rotation, light.rotation
    u = (
        turn[b, 0, 0] * r[0] + turn[b, 1, 0] * r[1] + turn[b, 2, 0] * r[2],
        turn[b, 0, 1] * r[0] + turn[b, 1, 1] * r[1] + turn[b, 2, 1] * r[2],
        turn[b, 0, 2] * r[0] + turn[b, 1, 2] * r[1] + turn[b, 2, 2] * r[2],
    )
    return (
        axes[s, 0, 0] * u[0] + axes[s, 1, 0] * u[1] + axes[s, 2, 0] * u[2],
        axes[s, 0, 1] * u[0] + axes[s, 1, 1] * u[1] + axes[s, 2, 1] * u[2],
        axes[s, 0, 2] * u[0] + axes[s, 1, 2] * u[1] + axes[s, 2, 2] * u[2],
    )


@kernel
def _along_ray(kind, size, s, y, v, tau):
    """Return the distance of a ray's point from a surface [m], and its slope; y is where the surface is, seen from the
    start.
    """
    q0, q1, q2 = tau * v[0] - y[0], tau * v[1] - y[1], tau * v[2] - y[2]
    d, g0, g1, g2 = shape_distance(kind, size[s, 0], size[s, 1], size[s, 2], q0, q1, q2)
    return d, g0 * v[0] + g1 * v[1] + g2 * v[2]


@kernel
def face_of(light, k, facing):
    """Return the middle of the face of element k that is towards its light: it has two if it has no side."""
    i, m1, up = light.edge_node[light.edge[k]], row(light.director1, light.edge[k]), light.height[k]
    a, b = row(light.node_position, i), row(light.node_position, i + 1)
    if light.side[k] == 0.0:
        up += math.copysign(light.half[k], facing)
    return 0.5 * (a[0] + b[0]) + up * m1[0], 0.5 * (a[1] + b[1]) + up * m1[1], 0.5 * (a[2] + b[2]) + up * m1[2]


@kernel
def covered(light, e, x, toward):
    """Return the part of the light that all edges and surfaces hide from a face of edge e, more than 1 if they do so
    together.
    """
    found, soft = 0.0, light.softness[e]
    for j in range(light.blocker.shape[0]):
        other = light.blocker[j]
        if light.section[other] != light.section[e]:
            found += covered_by_edge(light, other, x, toward, soft)
    for s in range(light.kind.shape[0]):
        found += covered_by_shape(light, s, x, toward, soft)
    return found


@kernel
def look_at_light(light, end):
    """Write n·l without its sign and V of every element, for where nodes, frames and bodies of `light` are, to column
    `end` of `facing` and `visible`.
    """
    edge_geometry(light.node_position, light.edge_node, light.length, light.tangent)
    for k in range(light.edge.shape[0]):
        e, source = light.edge[k], light.source[k]
        toward = row(light.direction, source)
        light.facing[k, end], light.visible[k, end] = dot(row(light.director1, e), toward), 1.0
        if light.casts[source]:
            x = face_of(light, k, light.facing[k, end])
            light.visible[k, end] = max(0.0, 1.0 - covered(light, e, x, toward))
