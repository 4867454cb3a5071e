"""The pairs of a contact point and a surface that are near each other, and how far anything has moved since the list.

A list made with a margin m holds every pair that can come nearer than the barrier distance, and the nearest of all,
until contact points and surfaces together have moved by more than m (a Verlet list; Verlet 1967). The motion of a
surface is that of its fastest point: |δX| + |δφ| times its extent, the radius of a ball about its position that holds
it; a gap can shrink by no more than that. A plane's extent is the largest distance of a contact point.

Contact points of rods that are not nodes are at parts of the two edges at a node: with the vectors ε and directors m of
the edges before (b) and after (a), and an arm (h, w) along the directors,

    y = x + c_b ε_b + c_a ε_a + s_b (h m1_b + w m2_b) + s_a (h m1_a + w m2_a)

At the node itself c = 0, s = ½. Beside it, at the part −½ ≤ ξ ≤ ½ of an edge, −1 ≤ ξ ≤ 1 towards a free end, y is on
the parabola through the node and its neighbours, and directors are linear between the middles of edges:

    c = (ξ ∓ ξ²)/2,   s = ½ ∓ ξ

which leaves the smooth curve by ⅛ l³ dκ/ds at most. A surface that is not flat meets rods in a grid of such points,
which is not stored: `list_near` makes those that are near. A ball of radius R, or an edge that is rounded so, sinks
between four points h apart by h²/4ρ, ρ = R + r with half the thickness r. That is the part `SAG` of the barrier
distance, so

    h = √(4 ρ SAG d̂)

and a ball presses on π/(2 SAG) = 31 points at most, however large it is. (Contact on flat faces has more of them, which
is what `Surfaces.least_spacing` is for; and a strip that is bent away from a surface with the curvature κ has
ρ = 1/(1/R + κ).) A plane, R = ∞, meets rods in such points that are bent so much that it sinks deeper between
stations; across the width it has the borders and the middle, and an end stands on it with its whole half edge, as it
does where no points are between stations. Stations, borders and ends are points of each grid. A point stands for its
part of the width and of the rod's length; where a ball presses, the width is that of the patch 2√(2ρd̂) within which
it can, if that is narrower.

`surfaces` is a record `Surfaces`, `at` a configuration, `Configuration` (`model.records`).
"""

from __future__ import annotations

import math

from bilayer_core.contact.shapes import PLANE, SPHERE, shape_distance
from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import row

SAG = 0.05
"""Part of the barrier distance by which a surface may sink between points: at a gap so small the barrier presses 20
times as hard as at half its distance.
"""


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
    neither bears nor bounds steps. (At an end, the borders of those lie elsewhere, along directors extrapolated to it.)
    """
    return surfaces.near_weight[k] == 0.0 and surfaces.contact_point_body[surfaces.near_contact_point[k]] < 0


@kernel
def _note(surfaces, k, i, s, gap, node, arm, mix, radius, weight):
    """Write pair k, if there is capacity for it."""
    if k >= surfaces.near_contact_point.shape[0]:
        return
    surfaces.near_contact_point[k], surfaces.near_surface[k], surfaces.near_gap[k] = i, s, gap
    surfaces.near_node[k], surfaces.near_arm[k] = node, arm
    surfaces.near_radius[k], surfaces.near_weight[k] = radius, weight
    for c in range(6):
        surfaces.near_mix[k, c] = mix[c]


@kernel
def spacing_between(surfaces, s, radius):
    """Return the distance of points h that surface s demands of a rod with half the thickness `radius` [m]."""
    fine = math.sqrt(4.0 * (surfaces.sharpest[s] + radius) * SAG * surfaces.d_hat)
    return max(fine, surfaces.least_spacing[s])


@kernel
def _list_between(surfaces, at, s, limit, count):
    """List the points between stations and across the width whose gap to surface s is at most `limit`."""
    edges, section, plane = surfaces.node_edges, surfaces.section, surfaces.kind[s] == PLANE
    for i in range(edges.shape[0]):
        b, a = edges[i, 0], edges[i, 1]
        if not surfaces.node_between[s, i] or not (surfaces.edge_can_collide[s, b] or surfaces.edge_can_collide[s, a]):
            continue
        inner, single = b != a, False
        if not inner:  # an end, which belongs to its neighbour, if that has two edges
            single = surfaces.node_part[i, 1] == 1.0 and edges[i + 1, 0] == edges[i + 1, 1]
            if not single:
                continue
        spacing = spacing_between(surfaces, s, section[i, 0])
        longest, thickest = max(at.length[b], at.length[a]), section[i + 1, 0]
        parts = 2 * int(math.ceil(0.5 * (max(surfaces.edge_length[b], surfaces.edge_length[a]) / spacing - 1.0))) + 1
        first, last = -(parts // 2), parts // 2
        if inner and edges[i - 1, 0] == edges[i - 1, 1] and section[i - 1, 3] > 0.0:
            first = -parts
        if edges[i + 1, 0] == edges[i + 1, 1] and section[i + 1, 3] > 0.0:
            last = parts
        first = first if inner else 0
        if inner:
            thickest = max(thickest, section[i - 1, 0])
        x = row(at.position, i)
        gap = gap_normal(surfaces, at, max(thickest, section[i, 0]), s, x[0], x[1], x[2])[0]
        if gap > limit + 1.25 * longest + surfaces.rod_points.longest:  # a gap changes by no more than the way
            continue
        for j in range(first, last + 1):
            other, part = i - 1 if j < 0 else i + 1, j / parts
            if plane and parts // 2 < abs(j) < parts or (plane and single and 0 < j < parts):
                continue
            if j != 0 and not surfaces.edge_can_collide[s, b if j < 0 else a]:
                continue
            station = i if j == 0 else other if abs(j) == parts else -1
            if station >= 0 and not surfaces.node_can_collide[s, station]:
                continue
            aside = abs(part)
            radius = section[i, 0] + aside * (section[other, 0] - section[i, 0]) if j != 0 else section[i, 0]
            border = section[i, 1] + aside * (section[other, 1] - section[i, 1]) if j != 0 else section[i, 1]
            height = section[i, 2] + aside * (section[other, 2] - section[i, 2]) if j != 0 else section[i, 2]
            along_b, along_a = 0.5 * (part - part * part), 0.5 * (part + part * part)
            part_b, part_a = 0.5 - part, 0.5 + part
            weight = surfaces.edge_length[b if j < 0 else a]
            if single:
                along_b, along_a, part_b, part_a = 0.0, part, 0.0, 1.0
            elif j == 0:
                weight = 0.5 * (surfaces.edge_length[b] + surfaces.edge_length[a])
            is_end = abs(j) == parts or (single and j == 0)
            weight *= 0.5 if plane and is_end else (0.5 if is_end else 1.0) / parts
            if surfaces.kind[s] == SPHERE and border > 0.0:
                patch = math.sqrt(2.0 * (surfaces.sharpest[s] + radius) * surfaces.d_hat)
                weight *= max(1.0, border / patch)
            count = _list_across(
                surfaces,
                at,
                s,
                i,
                (along_b, along_a, part_b, part_a, height, border),
                max(spacing, border) if plane else spacing,
                radius,
                weight,
                limit,
                count,
            )
    return count


@kernel
def _list_across(surfaces, at, s, i, mix, spacing, radius, weight, limit, count):
    """List those of one section, whose borders are at ± w of the mix and whose weight together is `weight`.

    They lie on a line, along which a gap changes by no more than the way, so points from where it is large are passed.
    """
    along_b, along_a, part_b, part_a, height, border = mix
    half, step = int(math.ceil(border / spacing)), 0.0
    if half > 0:
        c = rod_point(surfaces, at, i, (along_b, along_a, part_b, part_a, height, 0.0))
        e = rod_point(surfaces, at, i, mix)
        step = math.sqrt((e[0] - c[0]) ** 2 + (e[1] - c[1]) ** 2 + (e[2] - c[2]) ** 2) / half
    k = -half
    while k <= half:
        own = along_b, along_a, part_b, part_a, height, border * k / half if half > 0 else 0.0
        p = rod_point(surfaces, at, i, own)
        gap = gap_normal(surfaces, at, radius, s, p[0], p[1], p[2])[0]
        if gap <= limit:
            share = weight if half == 0 else weight * (0.25 if abs(k) == half else 0.5) / half
            _note(surfaces, count, i, s, gap, i, True, own, radius, share)
            count += 1
        k += max(1, int(min((gap - limit) / step, 2.0 * half))) if gap > limit and step > 0.0 else 1
    return count


@kernel
def list_near(surfaces, at, margin):
    """List pairs whose gap is at most max(d̂ + m, smallest gap + 2 m), by surfaces and then by contact points; of
    points between stations those within d̂ + m. Where there are such, points at stations have no weight.

    The list with its gaps, the extents of surfaces and where everything is are written to `surfaces`; pairs beyond the
    capacity of the list are counted but not written.

    Parameters
    ----------
    surfaces, at
    margin : float
        m [m]

    Returns
    -------
    count : int
    """
    bound, group, can_collide, rods = surfaces.bound, surfaces.group, surfaces.can_collide, surfaces.rod_points
    point, position, extent, nodes = at.contact_point, at.surface_position, surfaces.extent, surfaces.node_part.shape[0]
    placed, count, smallest, longest = point.shape[0], 0, math.inf, 0.0
    for e in range(surfaces.edge_length.shape[0]):
        longest = max(longest, surfaces.edge_length[e])
    mix = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for s in range(position.shape[0]):
        plane, between = surfaces.kind[s] == PLANE, surfaces.sharpest[s] >= 0.0
        extent[s] = margin if plane else bound[s]
        beyond = rods.longest + longest if between else 0.0
        for i in range(group.shape[0]):
            if not can_collide[s, group[i]]:
                continue
            node, x, radius = i, (0.0, 0.0, 0.0), surfaces.radius[i]
            if i < placed:
                x = row(point, i)
                if i < nodes:
                    mix = 0.0, 0.0, surfaces.node_part[i, 0], surfaces.node_part[i, 1], 0.0, 0.0
            else:
                node = rods.node[i - placed]
                mix = 0.0, 0.0, surfaces.node_part[node, 0], surfaces.node_part[node, 1], 0.0, 0.0
                mix = mix[0], mix[1], mix[2], mix[3], rods.arm[i - placed, 0], rods.arm[i - placed, 1]
                x = rod_point(surfaces, at, node, mix)
            square = 0.0
            for c in range(3):
                square += (x[c] - position[s, c]) ** 2
            limit = max(surfaces.d_hat + margin, smallest + 2.0 * margin)
            if plane:
                extent[s] = max(extent[s], math.sqrt(square) + margin + beyond)
            elif square > (bound[s] + radius + limit) ** 2:
                continue
            gap = gap_normal(surfaces, at, radius, s, x[0], x[1], x[2])[0]
            smallest = min(smallest, gap)
            if gap <= limit:
                weight = surfaces.weight[i]
                if between and (i < nodes or i >= placed) and surfaces.node_between[s, node]:
                    weight = 0.0
                _note(surfaces, count, i, s, gap, node, i >= placed, mix, radius, weight)
                count += 1
        if between:
            count = _list_between(surfaces, at, s, surfaces.d_hat + margin, count)
    for i in range(placed):
        for c in range(3):
            surfaces.listed_contact_point[i, c] = point[i, c]
    if rods.exists:
        for e in range(surfaces.listed_director1.shape[0]):
            for c in range(3):
                surfaces.listed_director1[e, c] = at.director1[e, c]
                surfaces.listed_director2[e, c] = at.director2[e, c]
    for s in range(position.shape[0]):
        for c in range(3):
            surfaces.listed_surface_position[s, c] = position[s, c]
            for k in range(3):
                surfaces.listed_surface_rotation[s, c, k] = at.surface_rotation[s, c, k]
    return count


@kernel
def moved_since(surfaces, at):
    """Return the largest motion of a contact point plus that of a surface's point since the list was made [m]."""
    point, listed_point = at.contact_point, surfaces.listed_contact_point
    position, listed_position = at.surface_position, surfaces.listed_surface_position
    axes, listed_axes = at.surface_rotation, surfaces.listed_surface_rotation
    largest, of_nodes, turned, fastest = 0.0, 0.0, 0.0, 0.0
    for i in range(point.shape[0]):
        square = 0.0
        for c in range(3):
            square += (point[i, c] - listed_point[i, c]) ** 2
        largest = max(largest, square)
        if i < surfaces.node_part.shape[0]:
            of_nodes = max(of_nodes, square)
    largest = math.sqrt(largest)
    if surfaces.rod_points.exists:
        for e in range(surfaces.listed_director1.shape[0]):
            square = 0.0
            for c in range(3):
                square += (at.director1[e, c] - surfaces.listed_director1[e, c]) ** 2
                square += (at.director2[e, c] - surfaces.listed_director2[e, c]) ** 2
            turned = max(turned, square)
        of_nodes = surfaces.rod_points.node_factor * math.sqrt(of_nodes)
        largest = max(largest, of_nodes + surfaces.rod_points.longest * math.sqrt(turned))
    for s in range(position.shape[0]):
        shift, chord = 0.0, 0.0
        for c in range(3):
            shift += (position[s, c] - listed_position[s, c]) ** 2
            for k in range(3):
                chord += (axes[s, c, k] - listed_axes[s, c, k]) ** 2
        # |R − R₀| (Frobenius) is √2 times the chord of the rotation
        fastest = max(fastest, math.sqrt(shift) + math.sqrt(0.5 * chord) * surfaces.extent[s])
    return largest + fastest
