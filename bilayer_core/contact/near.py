"""The pairs of a contact point and a surface that are near each other, and how far anything has moved since the list.

A list made with a margin m holds every pair that can come nearer than the barrier distance, and the nearest of all,
until contact points and surfaces together have moved by more than m (a Verlet list; Verlet 1967). The motion of a
surface is that of its fastest point: |δX| + |δφ| times its extent, the radius of a ball about its position that holds
it; a gap can shrink by no more than that. A plane's extent is the largest distance of a contact point.

Points of rods between stations are not stored: `list_near` makes those that are near (`contact.between_stations`).
Boxes and cylinders divide rods where the list is made; so that no result depends on the list, each stage begins with
one where a scene has such (`Surfaces.divides`).

`surfaces` is a record `Surfaces`, `at` a configuration, `Configuration` (`model.records`).
"""

from __future__ import annotations

import math

from bilayer_core.contact.between_stations import list_between, note
from bilayer_core.contact.gap import gap_normal, rod_point
from bilayer_core.contact.shapes import PLANE
from bilayer_core.jit import kernel
from bilayer_core.jit.called import stack_matrix
from bilayer_core.kinematics.vector import row


@kernel
def list_near(surfaces, at, margin):
    """List pairs whose gap is at most max(d̂ + m, smallest gap + 2 m), by surfaces and then by contact points; of
    points between stations those within d̂ + m. Where there are such, points at stations are listed beyond that alone,
    without weight: they tell how far away a surface is.

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
    pending = stack_matrix(48, 5)  # 2 DEEPEST
    for s in range(position.shape[0]):
        plane, between = surfaces.kind[s] == PLANE, surfaces.sharpest[s] >= 0.0
        extent[s] = margin if plane else bound[s]
        beyond = rods.longest + longest if between else 0.0
        for i in range(group.shape[0]):
            if not can_collide[s, group[i]]:
                continue
            node, x, radius, length = i, (0.0, 0.0, 0.0), surfaces.radius[i], 0.0
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
                    if gap <= surfaces.d_hat + margin:
                        continue
                    weight = 0.0
                if plane and (i < nodes or i >= placed):
                    b, a = surfaces.node_edges[node, 0], surfaces.node_edges[node, 1]
                    length = 0.5 * (surfaces.edge_length[a] + (surfaces.edge_length[b] if b != a else 0.0))
                note(surfaces, count, i, s, gap, node, i >= placed, mix, radius, weight, length)
                count += 1
        if between:
            count = list_between(surfaces, at, s, surfaces.d_hat + margin, pending, count)
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
