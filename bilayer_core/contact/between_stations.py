"""The points of rods between stations and across the width that are near a surface.

A surface that is not flat would sink between points that are far apart. The part `SAG` of the barrier distance d̂ is
allowed.

**Balls** of radius R meet rods in a grid. With half the thickness r one sinks between four points h apart by h²/4ρ,
ρ = R + r, so

    h = √(4 ρ SAG d̂)

and a ball presses on π/(2 SAG) = 31 points at most, however large it is. A point stands for its part of the width and
of the rod's length; where a ball presses, the width is that of the patch 2√(2ρd̂) within which it can, if that is
narrower.

**Planes**, R = ∞, meet rods in such points along them that are bent so much that an edge sinks deeper (a strip that is
bent away from a surface with the curvature κ has ρ = 1/(1/R + κ)); across the width they have the borders and the
middle, and an end stands on a plane with its whole half edge, as it does where no points are between stations.

**Boxes and cylinders** are flat in most places and sharp in few. They begin with the points that meet planes: sections
at stations, each with its middle and borders. A gap is a convex function of the place, so between two points at which
it is d₀ and d₁, and changes by the slopes g₀ and g₁ over the way to the other, it lies above its tangents there and
below its chord by no more than

    (d₁ − d₀ − g₀)(g₁ − d₁ + d₀)/(g₁ − g₀)

Where that is more than SAG d̂, a stretch across is halved, and a stretch along is divided into three, whose middle one
keeps its section. (At a parabola of radius ρ it is h²/4ρ.) On a face it is zero: a strip that lies there has the points
that it has on a plane, and edges and corners have many close by. A stretch hands on its weight to its parts by a share
that rises from 0 at half of the allowed depth to 1, so that weights have no steps as things move.

A point at an end belongs to the end's node, any other between stations to that in whose cell it is.

`surfaces` is a record `Surfaces`, `at` a configuration, `Configuration` (`model.records`).
"""

from __future__ import annotations

import math

from bilayer_core.contact.gap import gap_normal, rod_point
from bilayer_core.contact.shapes import BOX, CYLINDER, PLANE, SPHERE
from bilayer_core.jit import kernel
from bilayer_core.kinematics.vector import row

SAG = 0.05
"""Part of the barrier distance by which a surface may sink between points: at a gap so small the barrier presses 20
times as hard as at half its distance.
"""
DEEPEST = 24
"""Parts that wait to be looked at, at most: of a width all that is 2²³ times as wide, of an edge 3¹¹ times as long."""


@kernel
def note(surfaces, k, i, s, gap, node, arm, mix, radius, weight, length):
    """Write pair k, if there is capacity for it."""
    if k >= surfaces.near_contact_point.shape[0]:
        return
    surfaces.near_contact_point[k], surfaces.near_surface[k], surfaces.near_gap[k] = i, s, gap
    surfaces.near_node[k], surfaces.near_arm[k] = node, arm
    surfaces.near_radius[k], surfaces.near_weight[k], surfaces.near_length[k] = radius, weight, length
    for c in range(6):
        surfaces.near_mix[k, c] = mix[c]


@kernel
def spacing_between(surfaces, s, radius):
    """Return the distance of points h that surface s demands of a rod with half the thickness `radius` [m]."""
    return math.sqrt(4.0 * (surfaces.sharpest[s] + radius) * SAG * surfaces.d_hat)


@kernel
def _section_at(surfaces, i, part, single):
    """Return the mix of a border of the section at a part of the edges at node i, and its half thickness [m]; `single`
    says whether the rod has one edge, which node i begins.
    """
    section, other, aside = surfaces.section, i - 1 if part < 0.0 else i + 1, abs(part)
    radius, border, height = section[i, 0], section[i, 1], section[i, 2]
    if part != 0.0:
        radius += aside * (section[other, 0] - radius)
        border += aside * (section[other, 1] - border)
        height += aside * (section[other, 2] - height)
    if single:
        return (0.0, part, 0.0, 1.0, height, border), radius
    after = min(max(0.5 + part, 0.0), 1.0)
    return (0.5 * (part - part * part), 0.5 * (part + part * part), 1.0 - after, after, height, border), radius


@kernel
def _note_between(surfaces, count, i, s, part, gap, mix, across, radius, weight, length):
    """Write the pair of a point at the part `across` of the border's arm in a section at a part of the edges at node
    i; one at an end belongs to that.
    """
    node, w = i, mix[5] * across
    own = mix[0], mix[1], mix[2], mix[3], mix[4], w
    if abs(part) == 1.0:
        node = i - 1 if part < 0.0 else i + 1
        own = 0.0, 0.0, surfaces.node_part[node, 0], surfaces.node_part[node, 1], mix[4], w
    note(surfaces, count, node, s, gap, node, True, own, radius, weight, length)


@kernel
def list_between(surfaces, at, s, limit, pending, count):
    """List the points between stations and across the width whose gap to surface s is at most `limit`; `pending` is
    scratch, shape (2 DEEPEST, 5). Returns how many pairs there are.
    """
    edges, section, divides = surfaces.node_edges, surfaces.section, surfaces.kind[s] == BOX
    divides |= surfaces.kind[s] == CYLINDER
    for i in range(edges.shape[0]):
        b, a = edges[i, 0], edges[i, 1]
        if not surfaces.node_between[s, i] or not (surfaces.edge_can_collide[s, b] or surfaces.edge_can_collide[s, a]):
            continue
        inner, single = b != a, False
        if not inner:  # an end, whose half edge its neighbour lists, if that has two edges
            single = surfaces.node_part[i, 1] == 1.0 and edges[i + 1, 0] == edges[i + 1, 1]
            if not single:
                continue
        longest, thickest = max(at.length[b], at.length[a]), max(section[i, 0], section[i + 1, 0])
        if inner:
            thickest = max(thickest, section[i - 1, 0])
        x = row(at.position, i)
        gap, _, _, _, p0, p1, p2 = gap_normal(surfaces, at, thickest, s, x[0], x[1], x[2])
        if gap > limit + 1.25 * longest + surfaces.rod_points.longest:  # a gap changes by no more than the way
            continue
        ends_before = inner and edges[i - 1, 0] == edges[i - 1, 1] and section[i - 1, 3] > 0.0
        ends_after = edges[i + 1, 0] == edges[i + 1, 1] and section[i + 1, 3] > 0.0
        if not divides:
            count = _list_grid(surfaces, at, s, i, single, ends_before, ends_after, limit, count)
            continue
        flat = longest <= surfaces.coarsest[i] and _faces_one(
            surfaces, s, p0, p1, p2, 1.25 * longest + surfaces.rod_points.longest
        )
        before, after = 0.5 * surfaces.edge_length[b], 0.5 * surfaces.edge_length[a]
        for stretch in range(-1 if ends_before else 0, 2 if ends_after else 1):  # about the station; from ends inward
            middle, inward, weight = 1.0 * stretch, -1.0 * stretch, before if stretch < 0 else after
            if stretch == 0 and single:
                inward = 1.0
            elif stretch == 0:
                weight = before + after
            count = _list_stretch(surfaces, at, s, i, single, middle, inward, weight, flat, limit, pending, count)
    return count


@kernel
def _list_grid(surfaces, at, s, i, single, ends_before, ends_after, limit, count):
    """List the points near a ball, or a plane, in the cell of node i."""
    b, a, plane = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1], surfaces.kind[s] == PLANE
    spacing = spacing_between(surfaces, s, surfaces.section[i, 0])
    parts = 2 * int(math.ceil(0.5 * (max(surfaces.edge_length[b], surfaces.edge_length[a]) / spacing - 1.0))) + 1
    first = 0 if single else -parts if ends_before else -(parts // 2)
    last = parts if ends_after else parts // 2
    for j in range(first, last + 1):
        part = j / parts
        if plane and parts // 2 < abs(j) < parts or (plane and single and 0 < j < parts):
            continue
        if not _can_meet(surfaces, s, i, part):
            continue
        mix, radius = _section_at(surfaces, i, part, single)
        border, weight = mix[5], surfaces.edge_length[b if j < 0 else a]
        if j == 0 and not single:
            weight = 0.5 * (surfaces.edge_length[b] + surfaces.edge_length[a])
        is_end = abs(j) == parts or (single and j == 0)
        weight *= 0.5 if plane and is_end else (0.5 if is_end else 1.0) / parts
        length = weight if plane else 0.0
        if surfaces.kind[s] == SPHERE and border > 0.0:
            patch = math.sqrt(2.0 * (surfaces.sharpest[s] + radius) * surfaces.d_hat)
            weight *= max(1.0, border / patch)
        apart = max(spacing, border) if plane else spacing
        count = _list_across(surfaces, at, s, i, part, mix, apart, radius, weight, length, limit, count)
    return count


@kernel
def _can_meet(surfaces, s, i, part):
    """Return whether the section at a part of the edges at node i can meet surface s."""
    before, after = surfaces.node_edges[i, 0], surfaces.node_edges[i, 1]
    if part != 0.0 and not surfaces.edge_can_collide[s, before if part < 0.0 else after]:
        return False
    station = i if part == 0.0 else i - 1 if part == -1.0 else i + 1 if part == 1.0 else -1
    return station < 0 or surfaces.node_can_collide[s, station]


@kernel
def _list_across(surfaces, at, s, i, part, mix, spacing, radius, weight, length, limit, count):
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
            across = k / half if half > 0 else 0.0
            _note_between(surfaces, count, i, s, part, gap, mix, across, radius, share, length)
            count += 1
        k += max(1, int(min((gap - limit) / step, 2.0 * half))) if gap > limit and step > 0.0 else 1
    return count


@kernel
def _faces_one(surfaces, s, x, y, z, reach):
    """Return whether all within `reach` [m] of a point of the surface's frame is before one flat face of it."""
    size = surfaces.size
    if surfaces.kind[s] == BOX:
        x, y, z = abs(x) - size[s, 0], abs(y) - size[s, 1], abs(z) - size[s, 2]
        return (1 if x > -reach else 0) + (1 if y > -reach else 0) + (1 if z > -reach else 0) == 1
    return math.sqrt(x * x + y * y) <= size[s, 0] - reach


@kernel
def _sag(gap0, slope0, gap1, slope1):
    """Return by how much a convex function may lie below its chord, and its least value at least; slopes are changes
    over the way.
    """
    change, turn = gap1 - gap0, slope1 - slope0
    if turn <= 0.0:
        return 0.0, min(gap0, gap1)
    sag = max((change - slope0) * (slope1 - change) / turn, 0.0)
    if slope0 >= 0.0 or slope1 <= 0.0:
        return sag, min(gap0, gap1)
    return sag, gap0 + slope0 * (slope1 - change) / turn


@kernel
def _share_of_parts(surfaces, sag):
    """Return the share of its weight that a stretch hands on to its parts."""
    return min(max(2.0 * sag / (SAG * surfaces.d_hat) - 1.0, 0.0), 1.0)


@kernel
def _list_stretch(surfaces, at, s, i, single, middle, inward, weight, flat, limit, pending, count):
    """List the points near surface s of a stretch of the edges at node i, about its middle, or from an end inward.

    Parameters
    ----------
    surfaces, at, s, i, single
    middle : float
        Part of an edge where its section is, or the end.
    inward : float
        0 about the middle, ±1 of a stretch from there.
    weight : float
        [m]
    flat : bool
        Whether it is before one flat face, so that it has no parts.
    limit : float
        [m]
    pending : Matrix
        Scratch; stretches come first, `_walk_across` has the other half.
    count : int
        Of pairs so far.
    """
    edges = surfaces.node_edges
    longest = max(at.length[edges[i, 0]], at.length[edges[i, 1]])
    pending[0, 0], pending[0, 1], pending[0, 2], pending[0, 3] = middle, 0.5, inward, weight
    top = 1
    while top > 0:
        top -= 1
        c, e, inward, left = pending[top, 0], pending[top, 1], pending[top, 2], pending[top, 3]
        itself = _section_at(surfaces, i, c, single)
        mix, radius = itself
        spacing, own, divides = spacing_between(surfaces, s, radius), 0.0, not flat
        while True:  # look along the rod, and list where there is nothing more to divide
            looks = divides and 2.0 * e * longest > spacing and top + 2 < DEEPEST
            before, after, way = itself, itself, 0.0
            if looks:
                before = _section_at(surfaces, i, c - 2.0 * e if inward <= 0.0 else c, single)
                after = _section_at(surfaces, i, c + 2.0 * e if inward >= 0.0 else c, single)
                way = 2.0 * e * longest
            elif not _can_meet(surfaces, s, i, c):
                break
            listed = 0.0 if looks else own + left
            count, sag = _walk_across(
                surfaces, at, s, i, c, mix, radius, before, after, way, limit, listed, pending, count
            )
            if not looks:
                break
            share = _share_of_parts(surfaces, sag)
            divides = share > 0.0
            if not divides:
                continue
            own += (1.0 - share) * left
            left *= share / 3.0
            for side in range(-1, 2, 2):
                if inward == 0.0 or inward == side:
                    pending[top, 0], pending[top, 1] = c + side * 2.0 * e / 3.0, e / 3.0
                    pending[top, 2], pending[top, 3] = 0.0, left if inward == 0.0 else 2.0 * left
                    top += 1
            e /= 3.0
    return count


@kernel
def _walk_across(surfaces, at, s, i, part, mix, radius, before, after, way, limit, weight, pending, count):
    """Go across the section at a part of the edges at node i, by points that are dense where its gap bends.

    With a weight, those within the limit are listed. Without one, the gap along the rod is looked at, from each to the
    same place of the sections before and after it, at most `way` [m] off.

    Parameters
    ----------
    surfaces, at, s, i, part
    mix : tuple of float
        Of its border.
    radius : float
        Half its thickness [m].
    before, after : tuple
        Mix and half thickness of the neighbours.
    way, limit, weight : float
        [m]
    pending : Matrix
        Scratch.
    count : int
        Of pairs so far.

    Returns
    -------
    count : int
    sag : float
        The largest along the rod [m].
    """
    largest, border = 0.0, mix[5]
    v, carried = (-1.0, 0.0) if border > 0.0 else (0.0, 1.0)
    c = rod_point(surfaces, at, i, (mix[0], mix[1], mix[2], mix[3], mix[4], 0.0))
    e = rod_point(surfaces, at, i, mix)
    h0, h1, h2 = e[0] - c[0], e[1] - c[1], e[2] - c[2]
    half, spacing = math.sqrt(h0 * h0 + h1 * h1 + h2 * h2), spacing_between(surfaces, s, radius)
    gap, n0, n1, n2, _, _, _ = gap_normal(surfaces, at, radius, s, c[0] - h0, c[1] - h1, c[2] - h2)
    slope = n0 * h0 + n1 * h1 + n2 * h2
    for half_width in range(0 if border > 0.0 else 2, 3):  # from border to middle, to the other border, and that itself
        first, end, own = DEEPEST, 1.0 * half_width, 0.5
        if half_width == 2:
            end, own = v, 0.0
        end_gap, n0, n1, n2, _, _, _ = gap_normal(
            surfaces, at, radius, s, c[0] + end * h0, c[1] + end * h1, c[2] + end * h2
        )
        pending[first, 0], pending[first, 1], pending[first, 2] = end, own, 0.0
        pending[first, 3], pending[first, 4] = end_gap, n0 * h0 + n1 * h1 + n2 * h2
        top = first + 1
        while top > first:
            k = top - 1
            end, own, more = pending[k, 0], pending[k, 1], pending[k, 2]
            length, share = end - v, 0.0
            if length * half > spacing and top < 2 * DEEPEST:
                sag, least = _sag(gap, slope * length, pending[k, 3], pending[k, 4] * length)
                if least <= limit + way:
                    share = _share_of_parts(surfaces, sag)
            if share > 0.0:  # halve it
                m = v + 0.5 * length
                middle_gap, n0, n1, n2, _, _, _ = gap_normal(
                    surfaces, at, radius, s, c[0] + m * h0, c[1] + m * h1, c[2] + m * h2
                )
                carried += 0.5 * (1.0 - share) * own
                pending[k, 1], pending[k, 2] = 0.5 * share * own, more + 0.5 * (1.0 - share) * own
                pending[top, 0], pending[top, 1], pending[top, 2] = m, 0.5 * share * own, 0.0
                pending[top, 3], pending[top, 4] = middle_gap, n0 * h0 + n1 * h1 + n2 * h2
                top += 1
                continue
            carried = (carried + 0.5 * own) * weight
            count, sag = _at_place(
                surfaces, at, s, i, part, mix, radius, before, after, way, limit, v, carried, weight, count
            )
            largest = max(largest, sag)
            v, gap, slope, carried = end, pending[k, 3], pending[k, 4], 0.5 * own + more
            top -= 1
    return count, largest


@kernel
def _at_place(surfaces, at, s, i, part, mix, radius, before, after, way, limit, across, weight, length, count):
    """List the point at the part `across` of the border's arm, or look at the gap along the rod there; see
    `_walk_across`.
    """
    own = mix[0], mix[1], mix[2], mix[3], mix[4], mix[5] * across
    x = rod_point(surfaces, at, i, own)
    gap, n0, n1, n2, _, _, _ = gap_normal(surfaces, at, radius, s, x[0], x[1], x[2])
    if way == 0.0:
        if gap <= limit:
            _note_between(surfaces, count, i, s, part, gap, mix, across, radius, weight, length)
            count += 1
        return count, 0.0
    if gap <= limit + way and way > surfaces.coarsest[i]:
        return count, math.inf
    largest = 0.0
    for side in range(2):
        other, other_radius = before if side == 0 else after
        y = rod_point(surfaces, at, i, (other[0], other[1], other[2], other[3], other[4], other[5] * across))
        d0, d1, d2, thicker = y[0] - x[0], y[1] - x[1], y[2] - x[2], other_radius - radius
        there, m0, m1, m2, _, _, _ = gap_normal(surfaces, at, other_radius, s, y[0], y[1], y[2])
        slope0, slope1 = n0 * d0 + n1 * d1 + n2 * d2 - thicker, m0 * d0 + m1 * d1 + m2 * d2 - thicker
        sag, least = _sag(gap, slope0, there, slope1)
        if least <= limit:
            largest = max(largest, sag)
    return count, largest
